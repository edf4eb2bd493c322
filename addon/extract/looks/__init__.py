"""The looks of surfaces and the environment: materials and their nodes, images, lights, the world.

materials    rows of the table of materials, and objects' slots
node_graph   from a socket to its source; which nodes are supported, simplified, or reported
node_colors  a surface: the result of its shader nodes
node_values  a value: the result of the nodes before a socket
node_maths   ... of colours, vectors and numbers
node_textures  ... of procedural textures
node_places  ... of positions, images, attributes and normals
values       numbers and instructions of a material's program
lobes        shares of a surface that mirror, refract, or let light through
finishes     sheen, coats, brushed and rough structure, distributions of facets
volumes      the absorption inside glass
images       pixels, read once
lights       lights and the world
sky          Sky Texture
older_skies  its two oldest models
"""
