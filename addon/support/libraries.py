"""Libraries that only some files need, imported when they do; and the formats of point clouds, by what they need."""

from __future__ import annotations

import importlib
from typing import Any

# How files end, what menus say, and the modules that write them; in the order that .blend files keep of the choice.
POINT_FORMATS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("npz", "NumPy", "An .npz file with all columns and names; needs no library", ()),
    ("ply", "PLY", "Polygon file format, with all columns; by the library plyfile", ("plyfile",)),
    ("las", "LAS", "As surveyors exchange point clouds; by the library laspy", ("laspy",)),
    ("laz", "LAZ", "LAS, compressed; by the libraries laspy and lazrs", ("laspy", "lazrs")),
    ("csv", "CSV", "A table as text, with commas between; by the library pyarrow", ("pyarrow.csv",)),
    ("parquet", "Parquet", "A compressed table of columns; by the library pyarrow", ("pyarrow.parquet",)),
    ("h5", "HDF5", "An array for each column; by the library h5py", ("h5py",)),
)


def data_library(name: str, who_needs: str) -> Any:
    """A module of the extra `data`. who_needs: it, as in "EXR files need OpenEXR".

    Raises ImportError, which says that and what to install.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{who_needs}: pip install 'perfect-bvh[data]'") from error
