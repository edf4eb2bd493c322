"""The engine's scene after any series of updates equals one that was filled afresh; nothing more is edited."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sync.fakes import Shown, record
from sync.targets import (
    CALLS,
    MESHES,
    TARGETS,
    assert_ids_are_right,
    base,
    deformed,
    fresh,
    masked,
    mesh_removed,
    more_triangles,
    moved,
    object_removed,
    state,
)


@pytest.mark.parametrize("name", CALLS)
def test_only_the_difference_is_edited(name: str) -> None:
    made, scene = state()
    made.update(base())
    scene.calls.clear()
    made.update(TARGETS[name]())
    assert scene.calls == [*CALLS[name], "commit"]


@pytest.mark.parametrize("first", TARGETS)
@pytest.mark.parametrize("second", TARGETS)
def test_a_synced_scene_equals_a_fresh_one(first: str, second: str) -> None:
    """Content and tie-breaking orders alike, from each state to each other."""
    made, scene = state()
    made.update(TARGETS[first]())
    made.update(TARGETS[second]())
    assert scene.answer() == fresh(TARGETS[second]())
    assert_ids_are_right(made, TARGETS[second]())


def test_a_long_series_of_updates_ends_right(rng: np.random.Generator) -> None:
    made, scene = state()
    names = list(TARGETS)
    for index in rng.integers(0, len(names), 300):
        target = TARGETS[names[index]]()
        made.update(target)
        assert scene.answer() == fresh(target)
    assert_ids_are_right(made, target)


def test_ids_last_while_the_instance_does() -> None:
    made, _ = state()
    made.update(base())
    before = made.instance_ids.copy()
    for change in (moved, deformed, more_triangles, masked, base):
        made.update(change())
        np.testing.assert_array_equal(made.instance_ids, before)
    made.update(object_removed())
    np.testing.assert_array_equal(made.instance_ids, before[1:])
    made.update(base())
    assert made.instance_ids[0] not in before
    np.testing.assert_array_equal(made.instance_ids[1:], before[1:])


def test_a_mesh_counts_as_deforming_once_it_was_seen_to() -> None:
    made, scene = state()
    made.update(base())
    made.update(deformed())
    made.update(mesh_removed())
    made.update(base())
    usages = {key: scene.meshes[int(made.mesh_ids[row])].usage for row, key in enumerate(("a", "b"))}
    assert usages == {"a": "deforming", "b": "static"}


def test_the_records_guess_is_the_first_hint() -> None:
    made, scene = state()
    made.update(record([replace(MESHES[0], usage="changing")], [Shown("a", 1)]))
    assert next(iter(scene.meshes.values())).usage == "changing"


def test_what_the_commit_is_told() -> None:
    made, scene = state()
    made.update(base())
    assert scene.commit_keywords == {}

    def progress(share: float) -> bool:
        return True

    made.update(base(), expected_rays=1000, progress=progress)
    assert scene.commit_keywords == {"expected_rays": 1000, "progress": progress}
