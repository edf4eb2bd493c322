"""Rays as a tool: a scanner's pattern of rays goes in, a point cloud comes out.

patterns       which rays a sensor casts: a camera's grid, a spinning LiDAR with several lines. Knows no Blender.
more_patterns  of sensors that do not spin: rosettes, rasters, depth cameras. Knows no Blender.
sensor_files   sensors as TOML files, and those that the add-on brings (`sensors/`). Knows no Blender.
light          how wide beams are, which echoes count, what is detected, noise. Knows no Blender.
light_tables   the same in a sensor's file. Knows no Blender.
scan           places the sensor from key moment to key moment, casts the rays, collects what they meet
traced_stretch its rays, batch after batch. Knows no Blender.
stretches      from one key moment to the next. Knows no Blender.
stretch_sync   the scene at both ends of a stretch, each read once
poses          where a sensor is between two of them. Knows no Blender.
scene_bend     how far from straight lines the scene's own ways are. Knows no Blender.
second_eye     what the other eye of a depth camera does not see. Knows no Blender.
beams          beams of light through the scene, and what the sensor measures of them. Knows no Blender, nor do:
  beam_rays      the rays that stand for a beam
  light_paths    their ways through glass, alpha and by mirrors
  surface_reader, image_lookup, reflectance  what surfaces are made of there, and what of the light they give back
  echoes         echoes of a beam: merged, detected, chosen
  measuring, ray_noise  noise that belongs to each ray
collector      hits of many batches as one cloud. Knows no Blender.
outcomes       what became of each ray, in numbers. Knows no Blender.
complaints     why a scan is of no use, in words. Knows no Blender.
mount          the object that carries the sensor, with its children, and how rays go through them
point_cloud    the result as columns, and as an .npz file. Knows no Blender.
format_columns what labels are called in files of each format. Knows no Blender.
formats        the result in the formats of others: PLY, LAS, LAZ, CSV, Parquet, HDF5. Knows no Blender.
pieces         a long scan as files of some frames each, which are recognised when it is run again. Knows no Blender.
piece_scan     the same in steps, for the command line and for the button
point_colors   a colour for each point, by any column. Knows no Blender.
point_data     the result as an object of Blender's whose points carry the columns as attributes
point_nodes    the nodes that show it
"""

from .formats import save_cloud
from .light.model import Beam, Detection, Light, Noise, Optics
from .more_patterns import DepthCamera, Raster, Rosette
from .outcomes import RayCounts
from .patterns import CameraGrid, Pattern, Rays, SpinningLidar
from .point_cloud import PointCloud
from .point_data import make_point_object
from .scan import Scanner, scan
from .sensor_files import Sensor, load_sensor, sensor_names

__all__ = [
    "Beam",
    "CameraGrid",
    "DepthCamera",
    "Detection",
    "Light",
    "Noise",
    "Optics",
    "Pattern",
    "PointCloud",
    "Raster",
    "RayCounts",
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
