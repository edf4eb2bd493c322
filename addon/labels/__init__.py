"""Exact labels of what a camera sees, from one pass of rays: a scene goes in, images of ids, masks and depths come out.

label_image  casts a ray through each pixel's centre and lists all surfaces on it
labels       the result as arrays, and as an .npz file. Knows no Blender.
masks        the pixels of many things, which may overlap. Knows no Blender.
things       what the numbers stand for: names, numbers that users gave, categories
surfaces     normals and uvs where rays met meshes. Knows no Blender.
files        one labelled image as .npz, .npy, PNG and EXR, and what their numbers mean. Knows no Blender.
png          16 bits of grey. Knows no Blender.
exr          layers of 32 bits. Knows no Blender.
run_lengths  masks as COCO has them, all at once. Knows no Blender.
coco         many labelled images as one file of the format of COCO. Knows no Blender.
"""

from .coco import CocoFile
from .files import save_labels
from .label_image import label_image
from .labels import Labels, Masks, Thing

__all__ = ["CocoFile", "Labels", "Masks", "Thing", "label_image", "save_labels"]
