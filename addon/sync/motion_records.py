"""What moves while a shutter is open, as plain records: numpy arrays, no Blender type.

Times are those of the engine: 0 where the shutter opens, 1 where it closes. What has S steps is known at S of them, at
equal intervals from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .records import CameraRecord, InstanceRecords, MeshRecord, ObjectRecord

Int32Array = npt.NDArray[np.int32]
Float32Array = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class InstanceMotions:
    """Instances with as many steps. rows: (K,) int32, ascending, of the scene's. transforms: (S, K, 3, 4) float32."""

    rows: Int32Array
    transforms: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class MeshMotion:
    """A mesh that deforms. row: of the scene's. positions: (S, V, 3) float32. radii: (S, V), None for triangles."""

    row: int
    positions: Float32Array
    radii: Float32Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SceneMotion:
    """All that moves within the shutter. instances: one for each number of steps. camera: at each step, or empty."""

    instances: tuple[InstanceMotions, ...] = ()
    meshes: tuple[MeshMotion, ...] = ()
    camera: tuple[CameraRecord, ...] = ()

    @property
    def count(self) -> int:
        """Of instances and meshes that have a motion."""
        return sum(len(motions.rows) for motions in self.instances) + len(self.meshes)


@dataclass(frozen=True, slots=True, eq=False)
class MomentRecord:
    """The scene at one moment of the shutter: where everything is, and nothing of what it looks like.

    The fields are those of a `SceneRecord`. complaint: why there is no camera, as a sentence.
    """

    meshes: tuple[MeshRecord, ...]
    objects: tuple[ObjectRecord, ...]
    instances: InstanceRecords
    camera: CameraRecord | None = None
    complaint: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MotionSettings:
    """What users ask of the motion of each of a scene's objects, and of its camera.

    steps: (O,) int32, at how many moments an object is to be known, 0 if it is to stand still. deforms: (O,) bool,
    whether its shape may change meanwhile. camera_steps: as steps. camera_name, camera_uid: of the object, if any.
    """

    steps: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    deforms: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    camera_steps: int = 0
    camera_name: str = ""
    camera_uid: int = 0

    @property
    def times(self) -> list[Fraction]:
        """All moments at which something is to be known, in order: a union of grids."""
        counts = {int(count) for count in self.steps} | {self.camera_steps}
        return sorted({time for count in counts if count for time in times_of(count)})

    def limited_to(self, times: Container[Fraction]) -> MotionSettings:
        """The same, but for what asks for others than these moments: it stands still."""
        steps = self.steps.copy()
        for count in np.unique(steps[steps > 0]).tolist():
            if not all(time in times for time in times_of(count)):
                steps[steps == count] = 0
        return replace(self, steps=steps)


def times_of(steps: int) -> list[Fraction]:
    """So many, 2 or more, at equal intervals."""
    return [Fraction(step, steps - 1) for step in range(steps)]
