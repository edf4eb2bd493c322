"""Records of a scene and their way into the engine; knows no Blender."""
