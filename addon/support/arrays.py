"""Named arrays as a file of numpy's."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt


def write_arrays(path: Path, arrays: Mapping[str, npt.NDArray[Any]], *, is_compressed: bool = False) -> None:
    """What np.savez does; but that leaves its archive open when the disk is full. Raises OSError."""
    kind = zipfile.ZIP_DEFLATED if is_compressed else zipfile.ZIP_STORED
    with open(path, "wb") as file, zipfile.ZipFile(file, "w", kind, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)
