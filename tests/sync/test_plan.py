"""Classes of meshes: predicted from their objects, corrected by their observed changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from perfect_bvh_addon.sync.plan import MEMORY, UsageTracker
from perfect_bvh_addon.sync.records import MeshRecord


def mesh(usage: Any = "static", key: str = "a") -> MeshRecord:
    nothing = np.empty((0, 3), np.int32)
    return MeshRecord(key, key, np.empty((0, 3), np.float32), nothing, nothing[:, 0], usage=usage, usage_reason="told")


def watch(tracker: UsageTracker, did: Any) -> None:
    """One update."""
    tracker.begin_update()
    tracker.observe("a", did)


@pytest.mark.parametrize("usage", ["static", "rigid", "deforming", "changing"])
def test_before_anything_was_seen_the_guess_counts(usage: Any) -> None:
    expected = UsageTracker().expect(mesh(usage))
    assert (expected.usage, expected.reason) == (usage, "told")


@pytest.mark.parametrize(("did", "word"), [("rigid", "move"), ("deforming", "vertices"), ("changing", "triangles")])
def test_what_was_seen_counts_for_more(did: Any, word: str) -> None:
    tracker = UsageTracker()
    watch(tracker, did)
    expected = tracker.expect(mesh())
    assert expected.usage == did
    assert word in expected.reason
    assert tracker.expect(mesh(key="b")).usage == "static"


def test_a_guess_that_nothing_bears_out_is_dropped() -> None:
    tracker = UsageTracker()
    for _ in range(MEMORY):
        watch(tracker, "static")
        assert tracker.expect(mesh("changing")).usage == "changing"
    watch(tracker, "static")
    expected = tracker.expect(mesh("changing"))
    assert expected.usage == "static"
    assert str(MEMORY) in expected.reason


def test_classes_change_slowly() -> None:
    tracker = UsageTracker()
    changes = []
    last = None
    for number in range(10 * MEMORY):
        watch(tracker, "deforming" if number % 5 == 0 and number < 5 * MEMORY else "static")
        usage = tracker.expect(mesh()).usage
        changes += [usage] if usage != last else []
        last = usage
    assert changes == ["deforming", "static"]


def test_the_most_that_it_did_lately_counts() -> None:
    tracker = UsageTracker()
    watch(tracker, "changing")
    for _ in range(MEMORY - 1):
        watch(tracker, "deforming")
        assert tracker.expect(mesh()).usage == "changing"
    watch(tracker, "deforming")
    assert tracker.expect(mesh()).usage == "deforming"


def test_what_is_gone_is_forgotten_in_the_end() -> None:
    tracker = UsageTracker()
    tracker.begin_update()
    for number in range(100):
        tracker.observe(number, "deforming")
    tracker.forget_all_but([3], limit=100)
    assert tracker.expect(mesh(key=5)).usage == "deforming"  # type: ignore[arg-type]
    tracker.forget_all_but([3], limit=50)
    assert tracker.expect(mesh(key=5)).usage == "static"  # type: ignore[arg-type]
    assert tracker.expect(mesh(key=3)).usage == "deforming"  # type: ignore[arg-type]


def test_what_is_expected_holds_for_as_long_as_it_is_said_to() -> None:
    """Of a mesh that does nothing more: no caller has to ask again before."""
    for guess in ("static", "rigid", "changing"):
        for did in ("static", "rigid", "deforming"):
            tracker = UsageTracker()
            watch(tracker, did)
            answers = []
            for _ in range(3 * MEMORY):
                answers.append(tracker.expect(mesh(guess)))
                tracker.begin_update()
            for now, answer in enumerate(answers, start=1):
                for later, other in enumerate(answers[now:], start=now + 1):
                    if later < answer.until:
                        assert (other.usage, other.reason) == (answer.usage, answer.reason)
            assert answers[-1].until == float("inf")
