"""What a user can set: the modes, what a Blender scene carries, the add-on's preferences."""
