"""Fingerprints of a file's answers are the same in two runs, and differ if a bit differs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bpy", reason="Blender's module is not installed")

from hit_table.blends import answers_of, digest_of, digests_of


@pytest.mark.long
@pytest.mark.usefixtures("registered")
def test_the_same_answers_have_the_same_fingerprints(repository: Path, tmp_path: Path) -> None:
    file = repository / "blend_scenes" / "gears.blend"
    first, second = (dict(digests_of(answers_of(file, tmp_path))) for _ in range(2))
    assert first == second
    assert len(set(first.values())) > len(first) / 4, "many items hold nothing"
    assert {name.partition("/")[0] for name in first} == {"sync", "lookups", "images", "scans", "render"}


def test_digests_tell_types_shapes_and_bits_apart() -> None:
    values = [np.zeros(4, np.float32), np.zeros(4, np.int32), np.zeros((2, 2), np.float32), -np.zeros(4, np.float32)]
    assert len({digest_of(value) for value in [*values, [0, 0, 0, 0]]}) == 5
    names = np.array(["a", "b"], object)
    assert digest_of(names) == digest_of(["a", "b"]) != digest_of(names[::-1])
