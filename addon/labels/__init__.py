"""Exact labels of what a camera sees, from one pass of rays: a scene goes in, images of ids, masks and depths come out.

label_image  casts a ray through each pixel's centre and lists all surfaces on it, with their normals and uvs
labels       the result as arrays and as an .npz file: masks, which may overlap, and what the numbers stand for
files        one labelled image as .npz, .npy, PNG and EXR, and what their numbers mean. Knows no Blender.
piece_labels labels of many frames into a folder, piece by piece
coco         many labelled images as one file of the format of COCO. Knows no Blender.
bop          the same as a data set in the format of BOP. Does not depend on Blender.
"""

from .coco import CocoFile
from .files import save_labels
from .label_image import label_image
from .labels import Labels, Masks, Thing

__all__ = ["CocoFile", "Labels", "Masks", "Thing", "label_image", "save_labels"]
