"""Records of a scene and their way into the engine; knows no Blender.

records           what extraction writes: instances, objects, meshes, camera
look_records      the same of materials, images, lights and the world
scene_difference  what a new record asks of the engine's scene
compare           what differs, field by field. Changes nothing.
state             applies the difference, then commits
held              meshes that the engine holds, and edits of them
mesh_edits        one mesh into the engine: triangles, curves or points
plan              what each mesh is expected to do: guessed, then corrected
keys              which instance is which, across evaluations
moments           which moments of a shutter are read, and which instance is which there
motion            what moves between them, as the engine takes it
appearance        camera and looks as the engine takes them
lookup            from the engine's ids back to objects and polygons
not_shown         what an image lacks of the scene
report            what one sync did, to what, and why
"""
