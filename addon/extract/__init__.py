"""Reads an evaluated depsgraph into plain records; the only part of the add-on that touches Blender's geometry."""

from .scene import ReadCache, read_scene

__all__ = ["ReadCache", "read_scene"]
