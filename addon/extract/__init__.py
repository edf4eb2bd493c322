"""Reads an evaluated depsgraph into plain records; the only part of the add-on that touches Blender's geometry.

scene             one evaluated depsgraph -> one `SceneRecord`
scene_in_time     the same at several moments of a shutter
read_again        where Blender evaluated nothing but places and settings
geometry          instances, objects and meshes
looks             materials, images, lights, the world
camera            the camera's view
visibility        who is seen by which rays
label_values      custom properties and names as labels
ignored_settings  settings that change Cycles' picture and not ours
strand_cache      strands of particle systems
pointer_views     Blender's arrays in bulk
"""

from .scene import ReadCache, read_scene

__all__ = ["ReadCache", "read_scene"]
