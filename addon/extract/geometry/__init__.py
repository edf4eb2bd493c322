"""The geometry of a depsgraph: instances, their objects and meshes, and the arrays of those meshes.

listing             all instances of one evaluation, and Blender's own list of them
geometry_instances  those of geometry nodes, as arrays
instancer_survey    the instances of each object
groups              data that instances share, looked up once: mesh, object, instancer, mask
instance_columns    data of instances for shader nodes
mesh_table          each distinct mesh once, with a key that lasts
meshes              one mesh: triangles, and the requested attributes
tangents            of meshes along a UV map, for normal maps
curves_and_points   hair curves and point clouds
hair_shape          flat or round, bent or straight
particle_hair       old particle hair as curves
particle_roots      the emitting mesh's attributes at their roots
"""
