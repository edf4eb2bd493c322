"""Twelve scenes are hit everywhere alike: by all systems, processors, instruction sets and strategies."""

from __future__ import annotations

import pytest
from hit_table import table
from hit_table.scenes import SCENES, Made


@pytest.mark.parametrize("name", SCENES)
def test_it_is_hit_as_recorded(name: str) -> None:
    recorded = table.load_record()[name]
    assert recorded["hits"] > 500
    for row, hashes in table.rows_of(name):
        assert hashes == recorded, row


def test_no_two_scenes_are_hit_alike() -> None:
    recorded = table.load_record()
    assert list(recorded) == list(SCENES)
    assert len({table.digest_of(hashes) for hashes in recorded.values()}) == len(SCENES) == 12


def test_rays_from_elsewhere_hash_otherwise() -> None:
    made = SCENES["soup"]()
    beside = Made(made.scene, made.centre + 0.0625)
    assert table.hashes_of(made, "auto") == table.load_record()["soup"] != table.hashes_of(beside, "auto")


def test_the_script_says_what_differs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    recorded = table.load_record()
    recorded["walls"] = recorded["walls"] | {"hits": 1}
    monkeypatch.setattr(table, "SCENES", {name: SCENES[name] for name in ("walls", "fan")})
    monkeypatch.setattr(table, "load_record", lambda: recorded)
    assert table.main([]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[-1] for line in lines if line.startswith("walls")} == {"DIFFERS"}
    assert {line.split()[-1] for line in lines if line.startswith("fan")} == {"same"}
    assert lines[-1].endswith("rows differ from the record")
