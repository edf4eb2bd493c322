"""The users' settings: the modes, the properties of a Blender scene, the add-on's preferences.

properties        rows of the tables of properties
modes             the shading modes, one row each
scene_settings    of a scene: `scene.perfect_bvh`
scan_settings     of the Scan button: `scene.perfect_bvh.scan`
label_settings    of the Label Images button: `scene.perfect_bvh.label_images`
bake_settings     of the Bake Sun, Sky and Thickness button: `scene.perfect_bvh.bake`
bake_choices      the kinds of bakes, and where their values go
scan_choices      choices of scans: formats, colours of points, sensors
view_settings     of overlays and compared trees
shading_settings  of one viewport's shading
preferences       the add-on's, and the folders where OpenImageDenoise is searched
native_fault      why the engine cannot be loaded, and advice
"""
