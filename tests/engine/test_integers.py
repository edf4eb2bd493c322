"""Ids and counts: an integer of any kind is taken, anything else refused by name before it changes anything."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from perfect_bvh import Scene

TRIANGLE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]
RAY = [[0.2, 0.2, 1.0]], [[0.0, 0.0, -1.0]]
NOT_INTEGERS = [0.7, 0.0, True, False, np.True_, "1", float("nan"), None, [0]]
TOO_LARGE = [10**400, -(10**400), 2**70]


def one_triangle() -> Scene:
    scene = Scene()
    scene.add_instance(scene.add_mesh(*TRIANGLE))
    scene.commit()
    return scene


IDS: dict[str, tuple[str, Callable[[Scene, Any], object]]] = {
    "update_mesh": ("mesh", lambda scene, value: scene.update_mesh(value, TRIANGLE[0])),
    "replace_mesh": ("mesh", lambda scene, value: scene.replace_mesh(value, *TRIANGLE)),
    "set_usage": ("mesh", lambda scene, value: scene.set_usage(value, "static")),
    "remove_mesh": ("mesh", lambda scene, value: scene.remove_mesh(value)),
}
COUNTS: dict[str, tuple[str, Callable[[Scene, Any], object]]] = {
    "cast_rays": ("threads", lambda scene, value: scene.cast_rays(*RAY, threads=value)),
    "test_occlusions": ("threads", lambda scene, value: scene.test_occlusions(*RAY, threads=value)),
    "compute_closest_points": ("threads", lambda scene, value: scene.compute_closest_points(RAY[0], threads=value)),
    "list_intersections": ("max_hits", lambda scene, value: scene.list_intersections(*RAY, max_hits=value)),
    "tree_boxes": ("first_level", lambda scene, value: scene.snapshot().tree_boxes(first_level=value)),
    "set_thread_count": ("count", lambda scene, value: perfect_bvh.set_thread_count(value)),
    "Lens": ("blades", lambda scene, value: perfect_bvh.Lens(0.1, 1.0, blades=value)),
    "render": (
        "samples",
        lambda scene, value: perfect_bvh.render(scene, perfect_bvh.Camera(), mode="normal", size=(2, 2), samples=value),
    ),
}
OPTIONAL = {"list_intersections"}  # None has a meaning there


REFUSED = [
    (function, value)
    for function in (*IDS, *COUNTS)
    for value in (*NOT_INTEGERS, *TOO_LARGE)
    if value is not None or function not in OPTIONAL
]


@pytest.mark.parametrize(("function", "value"), REFUSED, ids=lambda value: repr(value)[:24])
def test_what_is_no_integer_is_refused(function: str, value: object) -> None:
    name, call = {**IDS, **COUNTS}[function]
    scene = one_triangle()
    with pytest.raises(ValueError, match=rf"^{function}: {name} must be an integer from -?\d+ to \d+, got "):
        call(scene, value)
    assert scene.is_current, "nothing was changed"
    assert (scene.mesh_count, scene.instance_count) == (1, 1)


@pytest.mark.parametrize("kind", [int, np.int32, np.uint8, np.int64])
def test_integers_of_any_kind_are_taken(kind: type) -> None:
    scene = one_triangle()
    scene.update_mesh(kind(0), TRIANGLE[0])
    scene.set_usage(kind(0), "deforming")
    scene.replace_mesh(kind(0), *TRIANGLE)
    scene.commit(kind(100))
    assert scene.cast_rays(*RAY, threads=kind(1)).is_hit.all()
    assert len(scene.list_intersections(*RAY, max_hits=kind(5)).hits.t_hit) == 1
    assert len(scene.snapshot().tree_boxes(kind(0), first_level=kind(0), last_level=kind(3))) == 1
    assert perfect_bvh.Lens(0.1, 1.0, blades=kind(6)).blades == 6


@pytest.mark.parametrize("rays", [float("nan"), float("inf"), -1, -0.5, True, "9", [9], 10**400])
def test_expected_rays_are_a_number_of_at_least_none(rays: object) -> None:
    """An estimate, which may well be 1e6."""
    scene = one_triangle()
    with pytest.raises(ValueError, match=r"^commit: expected_rays must be a number from 0 to 1e\+18, got "):
        scene.commit(rays)  # type: ignore[arg-type]
    assert scene.is_current
    scene.commit(1e6)


@pytest.mark.parametrize("mesh", [0.7, True, "0", 10**400])
def test_boxes_of_a_mesh_want_its_id(mesh: object) -> None:
    with pytest.raises(ValueError, match=r"^tree_boxes: mesh must be "):
        one_triangle().snapshot().tree_boxes(mesh)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^tree_sah: mesh must be "):
        one_triangle().snapshot().tree_sah(mesh)  # type: ignore[arg-type]


MAKE_WITHOUT_INIT = """
import copy
import perfect_bvh
from perfect_bvh import _core
scene = perfect_bvh.Scene()
scene.commit()
natives = [value for value in vars(_core).values() if isinstance(value, type) and not issubclass(value, Exception)]
assert {"Scene", "Snapshot", "BrightSky"} <= {native.__name__ for native in natives}, natives
def refused(make):
    try:
        made = make()
    except TypeError:
        return
    raise AssertionError(f"{made!r} was made")
for native in natives:
    derived = type("Derived", (native,), {"__init__": lambda self: None})
    refused(native)
    refused(derived)
    for parent in (*native.__mro__, derived):
        refused(lambda: parent.__new__(native))
        refused(lambda: parent.__new__(derived))
for whole in (scene._scene, scene._scene.snapshot()):
    refused(lambda: copy.copy(whole))
    refused(lambda: copy.deepcopy(whole))
print("refused", len(natives))
"""


def test_native_objects_without_a_value_cannot_be_made() -> None:
    """In a separate process: their first method used to crash it."""
    done = subprocess.run([sys.executable, "-c", MAKE_WITHOUT_INIT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("refused")
