"""The cost of work on this machine: the numbers by which the engine weighs builds, refits and rays, and their file.

`perfect-bvh calibrate` measures them once (see `perfect_bvh.calibrate`). They are kept in a JSON file. Its path is in
the environment variable PERFECT_BVH_CALIBRATION, else it is `calibration.json` in the user's cache folder. Without a
file, the numbers that come with the package are used. They are from another machine, but only their ratios matter.
"""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

VARIABLE = "PERFECT_BVH_CALIBRATION"
VERSION = 2  # of the file: it changes with the meaning of the numbers
BUILDERS = ("fast", "binned", "spatial")
NUMBERS = (
    "node_nanoseconds",
    "leaf_nanoseconds",
    "refit_nanoseconds",
    "rotate_nanoseconds",
    "rebuild_parts_nanoseconds",
    "rotation_gain",
)
DEFAULT_FILE = Path(__file__).with_name("calibration.json")
_LARGEST = 1e9


class CalibrationError(ValueError):
    """A calibration file that cannot be used."""


@dataclass(frozen=True, slots=True)
class BuilderCost:
    """The cost of a builder, for a mesh of 65,536 triangles.

    Attributes:
        build_nanoseconds: For each triangle, until the tree is ready to trace.
        trace_nanoseconds: For each ray that meets the mesh's box, the geometric mean of two meshes.
    """

    build_nanoseconds: float
    trace_nanoseconds: float


@dataclass(frozen=True, slots=True)
class Calibration:
    """Costs in nanoseconds of one thread.

    Attributes:
        node_nanoseconds, leaf_nanoseconds: For a ray's visit to a node and to a leaf block.
        refit_nanoseconds: For refitting a triangle
        rotate_nanoseconds: For restructuring the refitted tree by rotations, for each triangle, without the refit
        rebuild_parts_nanoseconds: For rebuilding parts of a tree, for each triangle in them, in addition to twice
            the refit of the whole tree.
        rotation_gain: The gain of rotations as a share, up to 1, of the expected gain of rebuilt parts.
        builders: The costs of "fast", "binned" and "spatial".
        machine: A description of the machine that was measured.

    Raises:
        CalibrationError: (a ValueError) for numbers that are not positive and finite.
    """

    node_nanoseconds: float
    leaf_nanoseconds: float
    refit_nanoseconds: float
    rotate_nanoseconds: float
    rebuild_parts_nanoseconds: float
    rotation_gain: float
    builders: Mapping[str, BuilderCost]
    machine: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if set(self.builders) != set(BUILDERS):
            raise CalibrationError(f"Calibration: builders must be {', '.join(BUILDERS)}, got {sorted(self.builders)}")
        numbers = {name: getattr(self, name) for name in NUMBERS}
        for builder, cost in self.builders.items():
            numbers |= {f"builders.{builder}.{name}": value for name, value in asdict(cost).items()}
        for name, value in numbers.items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not is_number or not math.isfinite(value) or not 0 < value <= _LARGEST:
                raise CalibrationError(f"Calibration: {name} must be a number above 0 and up to 1e9, got {value!r}")
        if self.rotation_gain > 1:
            raise CalibrationError(f"Calibration: rotation_gain must be at most 1, got {self.rotation_gain!r}")

    def as_numbers(self) -> dict[str, Any]:
        """Returns the numbers as the native module takes them; the file holds these and its version."""
        return {
            **{name: getattr(self, name) for name in NUMBERS},
            "builders": {name: asdict(self.builders[name]) for name in BUILDERS},
        }

    def save(self, path: Path) -> None:
        """Writes the file atomically. Raises OSError."""
        text = json.dumps({"version": VERSION, "machine": self.machine, **self.as_numbers()}, indent=1) + "\n"
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.name)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            Path(name).replace(path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise

    @classmethod
    def load(cls, path: Path) -> Calibration:
        """Reads a file. Raises OSError, and `CalibrationError`, which says what is wrong with the file."""
        try:
            values = json.loads(path.read_text(encoding="utf-8"))
        except (UnicodeDecodeError, json.JSONDecodeError) as error:
            raise CalibrationError(f"{path} is not JSON ({error})") from error
        version = values.get("version") if isinstance(values, dict) else None
        if version != VERSION:
            raise CalibrationError(f"{path} has version {version!r}, but this engine reads version {VERSION}")
        try:
            builders = {name: BuilderCost(**cost) for name, cost in values["builders"].items()}
            return cls(
                **{name: values[name] for name in NUMBERS},
                builders=builders,
                machine=str(values.get("machine", "")),
            )
        except CalibrationError as error:
            raise CalibrationError(f"{path}: {error}") from error
        except (KeyError, TypeError, AttributeError) as error:
            raise CalibrationError(f"{path} has missing or unknown numbers ({error!r})") from error


def user_file() -> Path:
    """Returns the path of this user's calibration, whether it exists yet or not."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    if sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        folder = Path.home() / "Library" / "Caches"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return folder / "perfect_bvh" / "calibration.json"


def read_calibration() -> Calibration:
    """Returns the user's calibration, or the package's if there is none; warns if the user's is invalid."""
    try:
        path = user_file()
        return Calibration.load(path)
    except FileNotFoundError:
        pass
    except (OSError, RuntimeError, CalibrationError) as error:  # RuntimeError: the user has no home folder
        warnings.warn(
            f"the calibration is not used: {error}; `perfect-bvh calibrate` measures it again",
            RuntimeWarning,
            stacklevel=3,
        )
    return Calibration.load(DEFAULT_FILE)


@cache
def current_calibration() -> Calibration:
    """Returns the default calibration of scenes: read once a process, so decisions do not change while it runs."""
    return read_calibration()
