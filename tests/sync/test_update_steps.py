"""An update step by step, as a background commit does it: compare, apply, commit, finish."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from perfect_bvh_addon.sync.compare import ATTRIBUTES
from perfect_bvh_addon.sync.look_records import ImageRecord, LightRecords, MaterialRecord, WorldRecord
from perfect_bvh_addon.sync.not_shown import NotShown
from perfect_bvh_addon.sync.records import CameraRecord, InstanceMotions, SceneMotion, SceneRecord, UnseenMesh
from sync.fakes import FailureError, StaleError
from sync.targets import TARGETS, assert_ids_are_right, base, fresh, state


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_only_a_record_of_the_same_is_no_difference(target: str) -> None:
    made, _ = state()
    assert not made.compare(base()).is_none, "nothing is held yet"
    made.update(base())
    assert made.compare(base()).is_none
    same = fresh(TARGETS[target]()) == fresh(base())
    assert not made.compare(TARGETS[target]()).is_none or same


CHANGES: dict[str, Any] = {
    "name": "other",
    "frame": 2.0,
    "objects": tuple(replace(obj, name="renamed") for obj in base().objects),
    "materials": (MaterialRecord("m", 1, 0, (1.0, 0.0, 0.0, 1.0)),),
    "camera": CameraRecord(np.eye(4), (-1.0, 1.0, -1.0, 1.0), "perspective", 0.1, 100.0),
    "size": (3, 4),
    "film_transparent": True,
    "plain_reflectance": 0.5,
    "pass_alpha_threshold": 0.5,
    "images": (ImageRecord("i", 1, np.zeros((1, 1, 4), np.float32), "repeat"),),
    "lights": LightRecords(kinds=("point",)),
    "world": WorldRecord(),
    "instance_values": np.zeros((1, 1, 4), np.float32),
    "unseen": (UnseenMesh("a", "mesh", 2, "hidden", "A", 3),),
    "warnings": ("something",),
    "motion": SceneMotion((InstanceMotions(np.zeros(1, np.int32), np.zeros((2, 1, 3, 4), np.float32)),)),
    "not_shown": (NotShown("material", "Wall", 7, "Noise Texture is unsupported; its flat colour is used"),),
}


def test_every_field_of_a_record_is_compared() -> None:
    """One that is forgotten here would let a view wait for trees that were built for another scene."""
    assert {field.name for field in fields(SceneRecord)} == {*CHANGES, "meshes", "instances"}


@pytest.mark.parametrize("name", sorted(CHANGES))
def test_what_no_ray_could_tell_is_a_difference_too(name: str) -> None:
    made, _ = state()
    made.update(base())
    assert not made.compare(replace(base(), **{name: CHANGES[name]})).is_none


@pytest.mark.parametrize("name", ["name", *ATTRIBUTES])
def test_what_no_tree_could_tell_of_a_mesh_is_a_difference_too(name: str) -> None:
    made, _ = state()
    made.update(base())
    first, second = base().meshes
    value: Any = "other" if name == "name" else np.full((2, 3), 7, np.int32)
    assert not made.compare(replace(base(), meshes=(replace(first, **{name: value}), second))).is_none


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_comparing_changes_nothing_and_uses_no_scene(target: str) -> None:
    made, scene = state()
    made.update(base())
    scene.calls.clear()
    made.compare(TARGETS[target]())
    assert scene.calls == []
    assert scene.answer() == fresh(base())


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_edits_of_a_commit_that_never_came_are_part_of_the_next(target: str) -> None:
    made, scene = state()
    made.update(base())
    made.apply(made.compare(TARGETS[target]()))
    with pytest.raises(StaleError):
        scene.answer()
    report = made.update(base())
    assert report.finishes_earlier_update and report.has_changes
    assert scene.answer() == fresh(base())
    assert_ids_are_right(made, base())


def test_a_failed_commit_is_tried_again_with_the_same_edits() -> None:
    made, scene = state()
    applied = made.apply(made.compare(base()))
    scene.fail_at = "commit"
    with pytest.raises(FailureError):
        made.commit()
    assert made.mesh_generations.min() > 10**9, "no hit may be looked up yet"
    report = made.finish(applied, made.commit())
    assert not report.finishes_earlier_update
    assert made.mesh_generations.tolist() == [1, 1]
    assert scene.answer() == fresh(base())


def test_a_comparison_outlives_the_end_of_the_commit_before() -> None:
    """Changes found during a commit are applied when the commit has ended, with or without an error."""
    made, scene = state()
    first = made.apply(made.compare(base()))
    commit = made.commit()
    target = TARGETS["deformed"]()
    difference = made.compare(target)
    made.finish(first, commit)
    report = made.finish(made.apply(difference), made.commit())
    assert not report.finishes_earlier_update
    assert scene.answer() == fresh(target)
