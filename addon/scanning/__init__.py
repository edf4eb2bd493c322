"""Rays as a tool: a scanner's pattern of rays goes in, a point cloud comes out.

patterns     which rays a sensor casts: a camera's grid, a spinning LiDAR with several lines. Knows no Blender.
scan         places the sensor frame by frame, casts the rays, collects what they meet
point_cloud  the result as columns, and as an .npz file. Knows no Blender.
point_mesh   the result as a mesh whose vertices carry the columns as attributes
"""

from .patterns import CameraGrid, Pattern, Rays, SpinningLidar
from .point_cloud import PointCloud
from .point_mesh import make_point_mesh
from .scan import Scanner, scan

__all__ = ["CameraGrid", "Pattern", "PointCloud", "Rays", "Scanner", "SpinningLidar", "make_point_mesh", "scan"]
