"""Any bytes as a call from Python: an answer of the right shape, or a ValueError that names the function."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import perfect_bvh

from .arguments import INTEGERS, anything, array, cull, mask, number
from .bytes import Bytes, Features, kind_of


@cache
def scene() -> perfect_bvh.Scene:
    """A mesh in three instances: untransformed, sheared and mirrored, and flattened."""
    made = perfect_bvh.Scene()
    corners = np.random.default_rng(1).normal(size=(30, 3)).astype(np.float32)
    mesh = made.add_mesh(corners, np.arange(30).reshape(-1, 3), build=perfect_bvh.BuildConfig(builder="spatial"))
    shear = np.array([[1.0, 0.5, 0, 0], [0, -2.0, 0, 1], [0, 0, 0.1, 0]])
    for transform in (None, shear, np.diag([1.0, 1.0, 0.0, 1.0])):
        made.add_instance(mesh, transform)
    made.commit()
    return made


class Caller:
    """Calls, and remembers the kinds of refusals."""

    def __init__(self) -> None:
        self.features: Features = set()

    def ask(self, call: Callable[..., Any], name: str, *arguments: Any, **keywords: Any) -> Any:
        """The answer, or None after an error that says where it happened."""
        try:
            return call(*arguments, **keywords)
        except ValueError as error:
            message = str(error)
        assert message.startswith(f"{name}: "), message
        self.features.add(("refused", kind_of(message)))
        return None


def cast_rays(data: bytes) -> Features:
    """Every query by rays, of the same rays: all answer or none does, and they agree."""
    source, caller = Bytes(data), Caller()
    made = scene()
    arguments = anything(source), anything(source)
    names = ("t_min", number), ("t_max", number), ("mask", mask), ("cull", cull)
    limits = {name: make(source) for name, make in names}
    hits = caller.ask(made.cast_rays, "cast_rays", *arguments, **limits)
    occluded = caller.ask(made.test_occlusions, "test_occlusions", *arguments, **limits)
    counts = caller.ask(made.count_intersections, "count_intersections", *arguments, **limits)
    found = caller.ask(made.list_intersections, "list_intersections", *arguments, **limits, max_hits=2)
    assert (hits is None) == (occluded is None) == (counts is None) == (found is None)
    if hits is None:
        return caller.features
    shape = np.broadcast_shapes(np.shape(arguments[0]), np.shape(arguments[1]))[:-1]
    assert hits.t_hit.shape == occluded.shape == counts.shape == shape
    assert np.array_equal(hits.is_hit, occluded)
    assert np.array_equal(hits.is_hit, counts > 0)
    assert not np.isnan(hits.t_hit).any()
    assert not np.isnan(found.hits.t_hit).any()
    assert np.array_equal(np.diff(found.ray_splits), np.minimum(counts.reshape(-1), 2))
    assert found.hits.invalid_count == hits.invalid_count <= occluded.size
    seen = ("cast", str(hits.is_hit.any()), str(hits.invalid_count > 0), str(occluded.size > 1), str(len(shape)))
    return caller.features | {seen}


def compute_closest_points(data: bytes) -> Features:
    """Distances that are numbers, and infinite where nothing was found."""
    source, caller = Bytes(data), Caller()
    points, max_distance, bits = anything(source), number(source), mask(source)
    found = caller.ask(
        scene().compute_closest_points, "compute_closest_points", points, max_distance=max_distance, mask=bits
    )
    if found is None:
        return caller.features
    assert found.distances.shape == np.shape(points)[:-1]
    assert not np.isnan(found.distances).any()
    assert np.isfinite(found.points).all()
    assert np.array_equal(np.isfinite(found.distances), found.is_found)
    seen = ("found", str(found.is_found.any()), str(found.is_found.all()), str(found.distances.ndim))
    return caller.features | {seen}


def fill_scenes(data: bytes) -> Features:
    """Meshes and instances of any kind, then other positions, triangles and transforms for them."""
    source, caller = Bytes(data), Caller()
    made = perfect_bvh.Scene()
    mesh = caller.ask(made.add_mesh, "add_mesh", anything(source), _triangles(source))
    transform = None if source.take(4) == 0 else anything(source, 4, 3)
    # One instance is added as one of many.
    instance = None if mesh is None else caller.ask(made.add_instance, "add_instances", mesh, transform)
    if instance is not None:
        _trace(made)
        if source.take(2):
            caller.ask(made.update_mesh, "update_mesh", mesh, anything(source))
        else:
            caller.ask(made.replace_mesh, "replace_mesh", mesh, anything(source), _triangles(source))
        caller.ask(made.set_transforms, "set_transforms", _ids(source, instance), anything(source, 4, 3))
        caller.ask(made.set_masks, "set_masks", _ids(source, instance), mask(source))
        _trace(made)
        caller.ask(made.remove_instances, "remove_instances", _ids(source, instance))
        _trace(made)
    assert made.mesh_count == (mesh is not None)
    return caller.features | {("filled", str(made.mesh_count), str(made.instance_count))}


def _triangles(source: Bytes) -> Any:
    return anything(source) if source.take(4) == 0 else array(source, (3,), INTEGERS)


def _ids(source: Bytes, instance: int) -> Any:
    return [instance] if source.take(4) else array(source, (None,), INTEGERS)


def _trace(made: perfect_bvh.Scene) -> None:
    made.commit()
    hits = made.cast_rays(np.zeros((4, 3)), np.eye(4)[:, :3], audit=1.0)
    assert hits.audit is not None
    assert hits.audit.wrong_rows.size == 0, str(hits.audit)
