"""Rays from a scene's own surfaces: a value for each face, corner, vertex or texel of the chosen objects.

bake       finds the objects, casts the rays block by block, and knows what need not be done again
settings   what a bake asks, checked. Does not depend on Blender.
receivers  the points from which rays start, and how they belong to the elements of a mesh
kinds      how each kind makes rays from points, and values from answers. Does not depend on Blender.
baked      the result, as attributes, images and tables
sun        the sun's place, tables of its directions, and light by weather files. Does not depend on Blender.
piece_bake tables of many frames in a folder, chunk by chunk
"""

from .bake import Baker, bake_rays
from .baked import Bake, BakedObject
from .settings import BakeSettings
from .sun import DirectionTable, Place, irradiance_table, read_epw, sun_position, sun_table

__all__ = [
    "Bake",
    "BakeSettings",
    "BakedObject",
    "Baker",
    "DirectionTable",
    "Place",
    "bake_rays",
    "irradiance_table",
    "read_epw",
    "sun_position",
    "sun_table",
]
