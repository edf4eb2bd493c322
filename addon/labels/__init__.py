"""Exact labels of a camera's view, from one pass of rays: a scene goes in, images of ids, masks and depths come out.

label_image  casts a ray through each pixel's centre and lists all surfaces on it, with their normals and uvs
labels       the result as arrays and as an .npz file: masks, which may overlap, and the meaning of the numbers
files        one labelled image as .npz, .npy, PNG and EXR, and the meaning of their numbers. Needs no Blender.
piece_labels labels of many frames into a folder, chunk by chunk
coco         many labelled images as one file of the format of COCO. Needs no Blender.
bop          the same as a data set in the format of BOP. Does not depend on Blender.
"""

from .coco import CocoFile
from .files import save_labels
from .label_image import label_image
from .labels import Labels, Masks, Thing

__all__ = ["CocoFile", "Labels", "Masks", "Thing", "label_image", "save_labels"]
