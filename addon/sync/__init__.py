"""Records of a scene and their transfer to the engine; does not depend on Blender.

records           the data that extraction writes: instances, objects, meshes, camera
look_records      the same of materials, images, lights and the world
scene_difference  the edits that a new record needs in the engine's scene
compare           the differences, field by field. Changes nothing.
state             applies the difference, then commits
held              meshes that the engine holds, and edits of them
mesh_edits        one mesh into the engine: triangles, curves or points
plan              the expected changes of each mesh: guessed, then corrected
keys              identifies instances across evaluations
moments           the time samples of a shutter, and the identity of instances there
motion            the motion between them, as the engine takes it
appearance        camera and looks as the engine takes them
boxes             the box around each instance, along its object's axes
lookup            from the engine's ids back to objects and polygons
not_shown         the parts of the scene that an image lacks
report            the actions of one sync, their targets and reasons
"""
