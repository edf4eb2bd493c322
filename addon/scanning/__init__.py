"""Rays as a tool: a scanner's pattern of rays goes in, a point cloud comes out.

patterns       which rays a sensor casts: a camera's grid, a spinning LiDAR with several lines. Knows no Blender.
more_patterns  of sensors that do not spin: rosettes, rasters, depth cameras. Knows no Blender.
sensor_files   sensors as TOML files, and those that the add-on brings (`sensors/`). Knows no Blender.
scan           places the sensor from key moment to key moment, casts the rays, collects what they meet
stretches      from one key moment to the next. Knows no Blender.
stretch_sync   the scene at both ends of a stretch, each read once
poses          where a sensor is between two of them. Knows no Blender.
scene_bend     how far from straight lines the scene's own ways are. Knows no Blender.
second_eye     what the other eye of a depth camera does not see. Knows no Blender.
collector      hits of many batches as one cloud. Knows no Blender.
point_cloud    the result as columns, and as an .npz file. Knows no Blender.
formats        the result in the formats of others: PLY, LAS, LAZ, CSV, Parquet, HDF5. Knows no Blender.
pieces         a long scan as files of some frames each, which are recognised when it is run again. Knows no Blender.
point_colors   a colour for each point, by distance, object or intensity. Knows no Blender.
point_data     the result as an object of Blender's whose points carry the columns as attributes
point_nodes    the nodes that show it
"""

from .formats import save_cloud
from .more_patterns import DepthCamera, Raster, Rosette
from .patterns import CameraGrid, Pattern, Rays, SpinningLidar
from .point_cloud import PointCloud
from .point_data import make_point_object
from .scan import Scanner, scan
from .sensor_files import Sensor, load_sensor, sensor_names

__all__ = [
    "CameraGrid",
    "DepthCamera",
    "Pattern",
    "PointCloud",
    "Raster",
    "Rays",
    "Rosette",
    "Scanner",
    "Sensor",
    "SpinningLidar",
    "load_sensor",
    "make_point_object",
    "save_cloud",
    "scan",
    "sensor_names",
]
