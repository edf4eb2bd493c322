"""What a depsgraph shows: instances, the objects and meshes that they are of, and the arrays of those meshes.

listing             all instances of one evaluation, and Blender's own list of them
geometry_instances  those of geometry nodes, as arrays
instancer_survey    what each object shows beside itself
groups              what instances share, looked up once: mesh, object, instancer, mask
instance_columns    what shader nodes ask of instances
mesh_table          each distinct mesh once, with a key that lasts
meshes              one mesh: triangles, and the attributes asked for
tangents            of meshes along a UV map, for normal maps
curves_and_points   hair curves and point clouds
hair_shape          flat or round, bent or straight
particle_hair       old particle hair as curves
particle_roots      what the emitting mesh has where they are rooted
"""
