"""Rays as a tool: a scanner's pattern of rays goes in, a point cloud comes out.

patterns       the rays of a sensor: a camera's grid, a spinning LiDAR with several lines. Needs no Blender.
more_patterns  sensors that do not spin: rosettes, rasters, depth cameras. Needs no Blender.
sensor_files   sensors as TOML files, and the sensors that come with the add-on. Needs no Blender.
sensors        those sensors, a TOML file each
sensor_settings the sensor that the Scan panel describes
light          the physics of beams: echoes, detection, noise. Needs no Blender.
scan           moves the sensor from time sample to time sample, casts the rays, collects the hits
stretches      the interval between two time samples: the sensor's pose, and points that a second eye does not see
stretch_sync   the scene at both ends of an interval, the error of its straight paths, and the rays between
outcomes       the outcome of each ray, in numbers, and why a scan is useless, in words. Needs no Blender.
mount          the object that carries the sensor, with its children, and how rays go through them
things         the boxes of object instances in the sensor's reach, and the points on each. Needs no Blender.
point_cloud    hits of many batches as columns, and as an .npz file. Needs no Blender.
formats        the result in other programs' formats: PLY, LAS, LAZ, CSV, Parquet, HDF5. Needs no Blender.
las            writes LAS 1.4. Needs no library
piece_scan     a long scan as files of some frames each, which are recognised when it is run again
point_data     the result as a Blender object: its attributes, its colours, the nodes that show it
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
