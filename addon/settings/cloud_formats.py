"""The formats of files of points, and the libraries that they need. Imports neither Blender nor numpy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CloudFormat:
    """name: the ending without its dot. modules: of Python, that writing it imports."""

    name: str
    label: str
    description: str
    modules: tuple[str, ...] = ()


CLOUD_FORMATS = (
    CloudFormat("npz", "NumPy", "An .npz file with all columns and names; needs no library"),
    CloudFormat("ply", "PLY", "Polygon file format, with all columns; by the library plyfile", ("plyfile",)),
    CloudFormat("las", "LAS", "As surveyors exchange point clouds; by the library laspy", ("laspy",)),
    CloudFormat("laz", "LAZ", "LAS, compressed; by the libraries laspy and lazrs", ("laspy", "lazrs")),
    CloudFormat("csv", "CSV", "A table as text, with commas between; by the library pyarrow", ("pyarrow.csv",)),
    CloudFormat("parquet", "Parquet", "A compressed table of columns; by the library pyarrow", ("pyarrow.parquet",)),
    CloudFormat("h5", "HDF5", "An array for each column; by the library h5py", ("h5py",)),
)
MODULES = {f".{one.name}": one.modules for one in CLOUD_FORMATS}
