"""What surfaces and the environment look like: materials and their nodes, images, lights, the world.

materials    rows of the table of materials, and objects' slots
node_graph   from a socket to what feeds it; which nodes are shown, roughly shown, or named
node_colors  a surface: what its shader nodes come to
node_values  a value: what the nodes before a socket come to
node_maths   ... of colours, vectors and numbers
node_textures  ... of procedural textures
node_places  ... of places, images, attributes and normals
values       numbers and instructions of a material's program
lobes        shares of a surface that mirror, refract, or let light through
finishes     sheen, coats, brushed and rough structure, distributions of facets
volumes      what glass absorbs inside
images       pixels, read once
lights       lights and the world
sky          Sky Texture
older_skies  its two oldest models
"""
