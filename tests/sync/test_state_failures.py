"""After an edit or a commit that failed the next update is right."""

from __future__ import annotations

import pytest
from perfect_bvh_addon.sync.records import SceneRecord
from sync.fakes import FailureError, FakeScene, Shown, StaleError, mesh, record
from sync.targets import (
    CALLS,
    TARGETS,
    assert_ids_are_right,
    base,
    everything_at_once,
    fresh,
    state,
)

FAILING_CALLS = sorted({call for calls in CALLS.values() for call in calls})


@pytest.mark.parametrize("after", [False, True], ids=["before its work", "after its work"])
@pytest.mark.parametrize("call", FAILING_CALLS)
@pytest.mark.parametrize("target", TARGETS)
def test_after_a_failed_edit_the_next_update_is_right(call: str, after: bool, target: str) -> None:
    made, scene = state()
    made.update(base())
    scene.fail_at, scene.fail_after = call, after
    try:
        made.update(everything_or(call))
    except FailureError:
        with pytest.raises(StaleError):
            scene.answer()
        assert made.scene is not scene
        assert made.record is None
    else:
        pytest.fail(f"{call} was not called")
    made.update(TARGETS[target]())
    assert isinstance(made.scene, FakeScene)
    assert made.scene.answer() == fresh(TARGETS[target]())
    assert_ids_are_right(made, TARGETS[target]())
    with pytest.raises(StaleError):
        scene.answer()


def test_a_scene_that_was_made_since_is_told_of_the_rays_again() -> None:
    made, scene = state()
    made.update(base(), expected_rays=1000)
    made.update(base())
    assert scene.commit_keywords == {}, "it knows"
    scene.fail_at = "add_instances"
    with pytest.raises(FailureError):
        made.update(everything_or("add_instances"))
    assert isinstance(made.scene, FakeScene) and made.scene is not scene
    made.scene.fail_at = "commit"
    with pytest.raises(FailureError):
        made.update(base())
    made.update(base(), expected_rays=0)
    assert made.scene.commit_keywords == {"expected_rays": 0}
    for expected in ({"expected_rays": 1000}, {}):
        made.update(base())
        assert made.scene.commit_keywords == expected, "0 is no number to count on"


def everything_or(call: str) -> SceneRecord:
    """A change of base() that makes the call."""
    name = next(name for name, calls in CALLS.items() if call in calls)
    return TARGETS[name]()


@pytest.mark.parametrize("target", TARGETS)
def test_after_a_cancelled_commit_the_next_update_is_right_and_builds_on_it(target: str) -> None:
    made, scene = state()
    made.update(base())
    scene.fail_at = "commit"
    with pytest.raises(FailureError):
        made.update(everything_at_once())
    with pytest.raises(StaleError, match="did not succeed"):
        scene.answer()
    report = made.update(TARGETS[target]())
    assert made.scene is scene
    assert scene.answer() == fresh(TARGETS[target]())
    assert report.finishes_earlier_update
    assert report.has_changes
    assert not made.update(TARGETS[target]()).finishes_earlier_update


def test_a_bad_record_changes_nothing() -> None:
    made, scene = state()
    made.update(base())
    scene.calls.clear()
    with pytest.raises(ValueError, match="same key"):
        made.update(record([mesh("a"), mesh("a", 3)], [Shown("a", 1)]))
    assert scene.calls == []
    made.update(base())
    assert scene.answer() == fresh(base())
