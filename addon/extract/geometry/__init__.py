"""What a depsgraph shows: instances, the objects and meshes that they are of, and the arrays of those meshes."""
