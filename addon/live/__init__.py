"""A Blender scene and the engine's copy of it, in step for as long as both live."""
