"""Fingerprints are the same twice, and a changed item is found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from fingerprints.digests import Items, Recorder, check_equal, digest
from fingerprints.engine_answers import record_engine
from fingerprints.engine_scenes import SCENES
from fingerprints.record import main


def record(name: str) -> Items:
    recorder = Recorder()
    record_engine(recorder.within("engine"), (name,), ray_count=60)
    return recorder.items


@pytest.mark.parametrize("name", ["moved", "spatial"])
def test_the_same_answers_have_the_same_fingerprints(name: str) -> None:
    first = record(name)
    assert first == record(name)
    assert len(set(first.values())) > len(first) / 4, "many items hold nothing"


def test_every_scene_has_something_to_hit() -> None:
    for name, make in SCENES.items():
        made = make()
        hits = made.scene.cast_rays(
            made.centre + (0.02, 0.03, 2.0), [(0.0, 0.01 * row, -1.0) for row in range(-99, 99)]
        )
        assert hits.is_hit.any(), name


def test_compare_names_what_differs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    items = {"kept": digest(1), "touched": digest(np.zeros(3)), "dropped": digest("a")}
    old.write_text(json.dumps(items), encoding="utf-8")
    new.write_text(json.dumps({"kept": digest(1), "touched": digest(np.array([0.0, -0.0, 0.0])), "fresh": digest("b")}))
    assert main(["--compare", str(old), str(old)]) == 0
    assert capsys.readouterr().out == "0 of 3 items differ\n"
    assert main(["--compare", str(old), str(new)]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "gone: dropped",
        "new: fresh",
        "changed: touched",
        "3 of 4 items differ",
    ]


def test_digests_tell_types_shapes_and_bits_apart() -> None:
    values = [np.zeros(4, np.float32), np.zeros(4, np.int32), np.zeros((2, 2), np.float32), -np.zeros(4, np.float32)]
    assert len({digest(value) for value in [*values, [0, 0, 0, 0]]}) == 5
    names = np.array(["a", "b"], object)
    assert digest(names) == digest(["a", "b"]) != digest(names[::-1])


def test_what_must_agree_is_checked() -> None:
    recorder = Recorder()
    recorder.add("once", 1)
    with pytest.raises(ValueError, match="'once' is recorded twice"):
        recorder.add("once", 2)
    check_equal("threads", {"t": np.ones(2)}, {"t": np.ones(2)}, ("t",))
    with pytest.raises(AssertionError, match="threads: t differs"):
        check_equal("threads", {"t": np.ones(2)}, {"t": np.zeros(2)}, ("t",))
