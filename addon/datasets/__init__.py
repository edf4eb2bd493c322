"""Scans with the camera's images as data sets that loaders of others open: frame by frame, in chunks.

shots       the camera's image of a frame as a PNG file, its labels, and its matrices
kitti       files of the format of KITTI: points, calibration, 3D boxes, poses. Needs no Blender.
bag         messages of ROS 2 in a bag (MCAP). Needs no Blender.
bop_work    the chunks of labels in the format of BOP, with images
drive_work  the chunks of scans in the formats of KITTI and of bags, with images
"""
