"""Long work over frames as files of some frames each, which are recognised when it is run again. Knows no Blender.

piece   which frames and files belong together, and how frames are divided
inputs  what the bytes of pieces depend on: files by their contents, and options
folder  manifests: what counts as done, and what a folder of other work is
"""
