"""The compiled engine. C-contiguous arrays of exactly these dtypes; use the package's classes instead.

Origins and directions of rays: (rows, 3), float32 or float64 each, rows at any distance; a single row is every ray's.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

__version__: str

_Float = npt.NDArray[np.float32]
_Double = npt.NDArray[np.float64]
_Int = npt.NDArray[np.int32]
_Long = npt.NDArray[np.int64]
_Byte = npt.NDArray[np.uint8]
_Mask = npt.NDArray[np.uint32]
_Real = TypeVar("_Real", _Float, _Double)
_Progress = Callable[[float], object] | None

def thread_count() -> int: ...
def set_thread_count(count: int) -> None: ...
def shutdown_threads() -> None: ...
def make_stop_flag() -> StopFlag: ...
def available_isas() -> list[str]: ...
def active_isa() -> str: ...
def set_active_isa(name: str) -> None: ...
def place_instances(parent: _Float | None, local: _Float, placed: _Float, largest: float) -> _Int: ...
def find_moved(old_transforms: _Float, new_transforms: _Float, rows: _Int | None = None) -> npt.NDArray[np.bool_]: ...
def are_equal(first: npt.NDArray[Any], second: npt.NDArray[Any]) -> bool: ...
def copy_within(source: _Float, target: _Float, largest: float) -> bool: ...
def are_triangles(corner_verts: _Int, corner_triangles: _Int, triangles: _Int) -> bool: ...
def measure(snapshot: Snapshot, detailed: bool, progress: _Progress) -> dict[str, Any]: ...
def tree_boxes(
    snapshot: Snapshot, mesh_id: int | None, first_level: int, last_level: int, with_leaves_above: bool
) -> dict[str, Any]: ...
def tree_sah(snapshot: Snapshot, mesh_id: int) -> float: ...
def cost_colors(costs: _Float) -> _Float: ...
def render(
    snapshot: Snapshot,
    camera: dict[str, Any],
    appearance: dict[str, Any],
    settings: dict[str, Any],
    targets: dict[str, npt.NDArray[Any]],
    progress: _Progress,
) -> dict[str, npt.NDArray[Any]]: ...

NODE_SHAPES: list[tuple[str, str, int, int, str]]

def evaluate_nodes(
    codes: _Int, numbers: _Float, images: list[Any], given: list[_Float], channels: _Int, count: int
) -> _Float: ...
def materials_at(
    snapshot: Snapshot, appearance: dict[str, Any], instance_ids: _Int, primitive_ids: _Int, uvs: _Float
) -> _Float: ...
def joint_filter(
    color: _Float, albedo: _Float | None, normal: _Float | None, out: _Float, threads: int, progress: _Progress
) -> None: ...

class StopFlag:
    @property
    def is_set(self) -> bool: ...
    def set(self) -> None: ...
    def __call__(self, share: float) -> bool: ...

class BrightSky: ...

def make_bright_sky(image: dict[str, Any], threads: int) -> BrightSky: ...

class Snapshot:
    @property
    def generation(self) -> int: ...
    @property
    def scene_id(self) -> int: ...
    def cast_rays(
        self,
        origins: npt.NDArray[Any],
        directions: npt.NDArray[Any],
        t_min: _Float,
        t_max: _Float,
        masks: _Mask,
        times: _Float,
        cull: str,
        strategy: str,
        outputs: dict[str, npt.NDArray[Any]],
        threads: int,
        progress: _Progress,
    ) -> tuple[int, int]: ...
    def test_occlusions(
        self,
        origins: npt.NDArray[Any],
        directions: npt.NDArray[Any],
        t_min: _Float,
        t_max: _Float,
        masks: _Mask,
        times: _Float,
        cull: str,
        strategy: str,
        occluded: npt.NDArray[np.bool_],
        threads: int,
        progress: _Progress,
    ) -> int: ...
    def audit_answers(
        self,
        origins: npt.NDArray[Any],
        directions: npt.NDArray[Any],
        t_min: _Float,
        t_max: _Float,
        masks: _Mask,
        times: _Float,
        t_hit: _Float,
        instance_ids: _Int,
        primitive_ids: _Int,
        cull: str,
        threads: int,
        progress: _Progress,
    ) -> npt.NDArray[np.uint8]: ...
    def count_intersections(
        self,
        origins: npt.NDArray[Any],
        directions: npt.NDArray[Any],
        t_min: _Float,
        t_max: _Float,
        masks: _Mask,
        times: _Float,
        cull: str,
        counts: _Int,
        threads: int,
        progress: _Progress,
    ) -> int: ...
    def list_intersections(
        self,
        origins: npt.NDArray[Any],
        directions: npt.NDArray[Any],
        t_min: _Float,
        t_max: _Float,
        masks: _Mask,
        times: _Float,
        cull: str,
        ray_splits: _Long,
        outputs: dict[str, npt.NDArray[Any]],
        threads: int,
        progress: _Progress,
    ) -> int: ...
    def compute_closest_points(
        self,
        points: _Double,
        max_distances: _Double,
        masks: _Mask,
        times: _Float,
        outputs: dict[str, npt.NDArray[Any]],
        threads: int,
        progress: _Progress,
    ) -> int: ...
    def walk_ray(
        self,
        origins: npt.NDArray[Any],
        directions: npt.NDArray[Any],
        t_min: _Float,
        t_max: _Float,
        masks: _Mask,
        times: _Float,
        cull: str,
        progress: _Progress,
    ) -> dict[str, npt.NDArray[Any]]: ...

def divide_curves(
    points: _Real,
    radii: _Real,
    curve_offsets: _Long,
    cyclic: _Byte,
    kind: str,
    tolerance: float,
    piece_count: int,
    function: str,
) -> Subdivision: ...

class Subdivision:
    @property
    def offsets(self) -> _Long: ...
    def is_as_fine_as(self, other: Subdivision) -> bool: ...
    def finer(self, other: Subdivision) -> Subdivision: ...
    def balls(
        self, points: _Real, radii: _Real, curve_offsets: _Long, cyclic: _Byte, kind: str, function: str
    ) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...

def make_scene() -> Scene: ...

class Scene:
    def add_mesh(self, positions: _Real, triangles: _Int, settings: dict[str, Any], usage: str) -> int: ...
    def update_mesh(self, mesh_id: int, positions: _Real) -> None: ...
    def set_mesh_motion(self, mesh_id: int, positions: _Real, steps: int, time_range: tuple[float, float]) -> None: ...
    def replace_mesh(self, mesh_id: int, positions: _Real, triangles: _Int) -> None: ...
    def add_points(self, centers: _Real, radii: _Real, settings: dict[str, Any], usage: str) -> int: ...
    def add_curves(
        self,
        points: _Real,
        radii: _Real,
        curve_offsets: _Long,
        cyclic: _Byte,
        is_ribbon: bool,
        settings: dict[str, Any],
        usage: str,
    ) -> int: ...
    def update_points(self, mesh_id: int, centers: _Real, radii: _Real) -> None: ...
    def update_curves(self, mesh_id: int, points: _Real, radii: _Real) -> None: ...
    def set_chains(self, mesh_id: int, centers: _Real, radii: _Real, offsets: _Long) -> None: ...
    def replace_points(self, mesh_id: int, centers: _Real, radii: _Real) -> None: ...
    def replace_curves(
        self, mesh_id: int, points: _Real, radii: _Real, curve_offsets: _Long, cyclic: _Byte, is_ribbon: bool
    ) -> None: ...
    def set_usage(self, mesh_id: int, usage: str) -> None: ...
    def remove_mesh(self, mesh_id: int) -> None: ...
    def add_instances(self, meshes: _Int, transforms: _Real, masks: _Mask, orders: _Long | None = None) -> int: ...
    def set_transforms(self, ids: _Int, transforms: _Real) -> None: ...
    def set_points_motion(
        self, mesh_id: int, centers: _Real, radii: _Real, offsets: _Long, steps: int, time_range: tuple[float, float]
    ) -> None: ...
    def set_curves_motion(
        self, mesh_id: int, points: _Real, radii: _Real, offsets: _Long, steps: int, time_range: tuple[float, float]
    ) -> None: ...
    def set_instance_motion(
        self, ids: _Int, transforms: _Real, steps: int, time_range: tuple[float, float]
    ) -> None: ...
    def set_masks(self, ids: _Int, masks: _Mask) -> None: ...
    def remove_instances(self, ids: _Int) -> None: ...
    def commit(
        self, policy: str, expected_rays: float | None, calibration: dict[str, Any], progress: _Progress = None
    ) -> dict[str, Any]: ...
    def mark_stale(self, why: str) -> None: ...
    def is_current(self) -> bool: ...
    def snapshot(self) -> Snapshot: ...
    def scene_id(self) -> int: ...
    def rays_cast(self) -> int: ...
    def mesh_count(self) -> int: ...
    def instance_count(self) -> int: ...
