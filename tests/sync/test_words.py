"""Numbers in words: as a person would say them, and no longer because of rounding."""

from __future__ import annotations

import pytest
from perfect_bvh_addon.statistics import words


@pytest.mark.parametrize(
    ("milliseconds", "text"),
    [
        (0.0, "0 ms"),
        (0.004, "under 0.01 ms"),
        (0.005, "0.01 ms"),
        (0.283, "0.28 ms"),
        (0.996, "1.0 ms"),
        (9.94, "9.9 ms"),
        (9.96, "10 ms"),
        (99.4, "99 ms"),
        (99.6, "0.10 s"),
        (280.0, "0.28 s"),
        (3140.0, "3.1 s"),
        (121_073.5, "121 s"),
        (599_400.0, "599 s"),
        (599_600.0, "10 min"),
        (119 * 60e3, "119 min"),
        (200 * 60e3, "3 h 20 min"),
    ],
)
def test_durations(milliseconds: float, text: str) -> None:
    assert words.duration(milliseconds) == text


def test_durations_that_are_compared_have_a_digit_more() -> None:
    said = [words.duration(value, 3) for value in (0.1234, 12.34, 99.4, 280.0, 12_345.6)]
    assert said == ["0.12 ms", "12.3 ms", "99.4 ms", "0.28 s", "12.3 s"]


@pytest.mark.parametrize(
    ("rays", "text"),
    [
        (0.0, "0 rays/s"),
        (950.4, "950 rays/s"),
        (999.6, "1.0 k rays/s"),
        (24_300.0, "24 k rays/s"),
        (999_400.0, "999 k rays/s"),
        (999_600.0, "1.0 M rays/s"),
        (3_140_000.0, "3.1 M rays/s"),
        (1_234_000_000.0, "1,234 M rays/s"),
    ],
)
def test_rates(rays: float, text: str) -> None:
    assert words.rate(rays) == text


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0 B"), (1023, "1023 B"), (1536, "1.5 KiB"), (5 << 20, "5.0 MiB"), (3 << 30, "3.00 GiB")]
)
def test_bytes_are_readable(count: int, text: str) -> None:
    assert words.memory(count) == text


def test_shares_counts_and_sentences() -> None:
    assert [words.share(part) for part in (0.0, 0.004, 0.01, 0.456, 1.0)] == ["0%", "<1%", "1%", "46%", "100%"]
    assert [words.count_of(count, "triangle") for count in (0, 1, 1200)] == [
        "0 triangles",
        "1 triangle",
        "1,200 triangles",
    ]
    assert words.count_of(2, "mesh", "meshes") == "2 meshes"
    assert [words.primitives(count, kind) for count, kind in ((3200, "curves"), (1, "points"), (2, "triangles"))] == [
        "3,200 segments",
        "1 point",
        "2 triangles",
    ]
    assert [words.sum_of(*counts) for counts in ((0, 0, 0), (0, 5, 0), (1200, 3200, 1))] == [
        "0 triangles",
        "5 segments",
        "1,200 triangles, 3,200 segments, 1 point",
    ]
    assert [words.sentence(text) for text in ("", "no light", "Éa")] == ["", "No light", "Éa"]
