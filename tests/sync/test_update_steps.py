"""An update step by step, as whoever commits in the background does it: compare, apply, commit, finish."""

from __future__ import annotations

from dataclasses import replace

import pytest
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


@pytest.mark.parametrize(
    "change", [{"frame": 2.0}, {"name": "other"}, {"warnings": ("something",)}, {"size": (3, 4)}, {"materials": ("m",)}]
)
def test_what_no_ray_could_tell_is_a_difference_too(change: dict[str, object]) -> None:
    made, _ = state()
    made.update(base())
    assert not made.compare(replace(base(), **change)).is_none
    renamed = replace(base(), meshes=(replace(base().meshes[0], name="other"), base().meshes[1]))
    assert not made.compare(renamed).is_none


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
    """Whoever compares while a commit is under way applies that when it has ended, one way or the other."""
    made, scene = state()
    first = made.apply(made.compare(base()))
    commit = made.commit()
    target = TARGETS["deformed"]()
    difference = made.compare(target)
    made.finish(first, commit)
    report = made.finish(made.apply(difference), made.commit())
    assert not report.finishes_earlier_update
    assert scene.answer() == fresh(target)
