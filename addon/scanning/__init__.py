"""Rays as a tool: a scanner's pattern of rays goes in, a point cloud comes out.

patterns     which rays a sensor casts: a camera's grid, a spinning LiDAR with several lines. Knows no Blender.
scan         places the sensor frame by frame, casts the rays, collects what they meet
poses        where a sensor is between two frames. Knows no Blender.
point_cloud  the result as columns, and as an .npz file. Knows no Blender.
point_colors a colour for each point, by distance, object or intensity. Knows no Blender.
point_data   the result as an object of Blender's whose points carry the columns as attributes
point_nodes  the nodes that show it
"""

from .patterns import CameraGrid, Pattern, Rays, SpinningLidar
from .point_cloud import PointCloud
from .point_data import make_point_object
from .scan import Scanner, scan

__all__ = ["CameraGrid", "Pattern", "PointCloud", "Rays", "Scanner", "SpinningLidar", "make_point_object", "scan"]
