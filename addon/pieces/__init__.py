"""Long work over frames as files of some frames each, which are recognised when it is run again.

piece         which frames and files belong together, and how frames are divided
inputs        what the bytes of pieces depend on: files by their contents, and options
scene_inputs  what those of a scene depend on that is open in Blender
work          the work itself, at once or in steps, and what came of it
folder        manifests: what counts as done, and what a folder of other work is
"""
