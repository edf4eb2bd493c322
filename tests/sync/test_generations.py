"""Hits can be looked up only while their ids mean the same as when cast: with the engine's own scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from perfect_bvh_addon.sync.lookup import SceneLookup
from perfect_bvh_addon.sync.records import SceneRecord
from perfect_bvh_addon.sync.state import SceneState
from sync.fakes import Shown, mesh, record


def two_meshes(second_triangles: int = 2, shift: float = 0.0, x: float = 10.0) -> SceneRecord:
    return record([mesh("a", 2), mesh("b", second_triangles, shift)], [Shown("a", 1), Shown("b", 2, x=x)])


def other_triangles() -> SceneRecord:
    """The same triangles in reversed order."""
    made = two_meshes()
    second = made.meshes[1]
    turned = replace(second, triangles=np.ascontiguousarray(second.triangles[::-1]))
    return replace(made, meshes=(made.meshes[0], turned))


def lookup_of(state: SceneState) -> SceneLookup:
    assert state.record is not None
    return SceneLookup(state.record, state.instance_ids, state.mesh_ids, state.scene.scene_id, state.mesh_generations)


def cast(state: SceneState, x: float) -> perfect_bvh.Hits:
    scene = state.scene
    assert isinstance(scene, perfect_bvh.Scene)
    found = scene.cast_rays([(x + 0.2, 0.2, 5.0)], (0.0, 0.0, -1.0))
    assert found.is_hit.all()
    return found


@pytest.mark.parametrize("change", [other_triangles, lambda: two_meshes(second_triangles=5)])
def test_only_hits_on_what_was_replaced_are_refused(change: Callable[[], SceneRecord]) -> None:
    state = SceneState(perfect_bvh.Scene)
    state.update(two_meshes())
    on_first, on_second = cast(state, 0.0), cast(state, 10.0)
    state.update(change())
    assert lookup_of(state).polygon_ids(on_first).tolist() == [0]
    with pytest.raises(ValueError, match=r"polygon_ids: hits must be from after .* got hits of generation 1 on mesh 1"):
        lookup_of(state).polygon_ids(on_second)
    assert lookup_of(state).polygon_ids(cast(state, 10.0)).shape == (1,)


@pytest.mark.parametrize("change", [two_meshes, lambda: two_meshes(shift=0.5), lambda: two_meshes(x=20.0)])
def test_hits_outlive_what_leaves_triangles_as_they_are(change: Callable[[], SceneRecord]) -> None:
    """Nothing, moved vertices, a moved instance: triangles still are the polygons they were."""
    state = SceneState(perfect_bvh.Scene)
    state.update(two_meshes())
    found = cast(state, 10.0)
    state.update(change())
    assert lookup_of(state).polygon_ids(found).tolist() == [0]


class Interrupted(perfect_bvh.Scene):
    """Its next commit fails if a test sets this."""

    fails = False

    def commit(self, *arguments: Any, **keywords: Any) -> perfect_bvh.CommitReport:
        if self.fails:
            raise perfect_bvh.Cancelled
        return super().commit(*arguments, **keywords)


def test_a_cancelled_commit_already_refuses_old_hits() -> None:
    state = SceneState(Interrupted)
    state.update(two_meshes())
    found = cast(state, 10.0)
    Interrupted.fails = True
    try:
        with pytest.raises(perfect_bvh.Cancelled):
            state.update(other_triangles())
    finally:
        Interrupted.fails = False
    with pytest.raises(ValueError, match="triangles were replaced since"):
        lookup_of(state).polygon_ids(found)
    state.update(other_triangles())
    assert lookup_of(state).polygon_ids(cast(state, 10.0)).tolist() == [1]


def test_hits_of_another_scene_are_refused() -> None:
    one, other = SceneState(perfect_bvh.Scene), SceneState(perfect_bvh.Scene)
    one.update(two_meshes())
    other.update(two_meshes())
    with pytest.raises(ValueError, match="got hits of another scene"):
        lookup_of(one).polygon_ids(cast(other, 0.0))


def test_closest_points_are_looked_up_like_hits() -> None:
    state = SceneState(perfect_bvh.Scene)
    state.update(two_meshes())
    scene = state.scene
    assert isinstance(scene, perfect_bvh.Scene)
    found = scene.compute_closest_points([(10.2, 0.2, 3.0), (np.nan, 0.0, 0.0)])
    assert lookup_of(state).polygon_ids(found).tolist() == [0, -1]
    assert lookup_of(state).describe(found.instance_ids).names.tolist() == ["object 2", ""]
