"""The scenes' makers: each fills an empty Blender file from a seed."""
