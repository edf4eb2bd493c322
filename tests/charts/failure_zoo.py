"""The failure zoo: losses of usual methods and of this engine on scenes made to break usual methods."""

from __future__ import annotations

from charts.chart import OURS, Axis, Chart, Key, Panel, Series
from charts.figures import Figures, footer, load

DATA = "zoo"
WORK = "times the work"
ASKED = "green"  # the engine with other settings
USUAL = "black"
_RAYS = Axis("rays per million", log=True, has_zero=True, low=100.0, powers=True)


def chart(figures: Figures | None = None) -> Chart:
    """The picture's description; figures: of tests/stress/zoo.py."""
    figures = figures or load(DATA)
    rounds, times = figures["round_cases"], figures["time_cases"]
    cases = figures["cases"] + rounds + times
    work = _worst_first(case for case in cases if case["unit"] == WORK)
    answers = _worst_first(case for case in cases if case["unit"].endswith("per million"))
    others = [case for case in cases if case not in work and case not in answers]
    lossless = sum(case["ours"] == case["nothing"] for case in answers)
    dearer = [case for case in work if case["ours"] > 1.1]
    dearest = max(dearer, key=lambda case: float(case["ours"]))
    return Chart(
        f"Answers: none lost in {lossless} of {len(answers)} cases. Work: up to {dearest['ours']:.1f} times the least",
        f"{len(cases)} small scenes on which a usual method fails, {len(rounds)} of them curves and points and "
        f"{len(times)} of what moves within the shutter; counted, not timed. Work: boxes and primitives that the same "
        "rays test, over those in the best tree known; after edits, in a fresh tree of the same kind. Answers: rays "
        "that an audit in double precision finds wrong, lost or different. Blue is what the engine does by itself; "
        "green what it does when asked, "
        f"and for what. By itself it takes more than 1.1 times the least work in {len(dearer)} cases of "
        f"{len(work)}. Last, rays that meet another curve or point, or none, if tubes of six sides or octahedra "
        f"stand for them. Not drawn: {_told(others)}.",
        [
            _panel("Work", work, Axis("times the work", log=True, low=0.9)),
            _panel("Answers", answers, _RAYS),
            _panel("Curves and points as triangles", _as_triangles(rounds), _RAYS),
        ],
        footer(figures),
        columns=1,
        panel_height=70 + 19 * max(len(work), len(answers)),
        legend=(
            Key("the usual method", USUAL, "diamond"),
            Key("Perfect BVH", OURS),
            Key("Perfect BVH, when asked", ASKED, "triangle"),
        ),
    )


def _worst_first(cases: object) -> list[Figures]:
    return sorted(cases, key=lambda case: -float(case["naive"]))  # type: ignore[call-overload, no-any-return]


def _as_triangles(rounds: list[Figures]) -> list[Figures]:
    """The losses where triangles replace curves and points; ours are the true surfaces, as the audit has found."""
    return _worst_first({**case, "naive": case["as_triangles"], "ours": 0, "other": None} for case in rounds)


def _told(cases: list[Figures]) -> str:
    return "; ".join(f"{case['title'].lower()} ({case['naive']:,} {case['unit']})" for case in cases)


def _panel(title: str, cases: list[Figures], x: Axis) -> Panel:
    rows = range(len(cases))
    asked = [
        (row, case["other"])
        for row, case in zip(rows, cases, strict=True)
        if case["other"] is not None and case["other"][1] != case["ours"]
    ]
    joined = [
        Series("", [case["ours"], case["naive"]], [row, row], "pale", "", line=True, width=2.0)
        for row, case in zip(rows, cases, strict=True)
    ]
    return Panel(
        title,
        x,
        Axis("the worst for the usual method first", names=[case["title"] for case in cases]),
        [
            *joined,
            Series("the usual method", [case["naive"] for case in cases], rows, USUAL, "diamond"),
            Series(
                "Perfect BVH, when asked",
                [value for _, (_, value) in asked],
                [row for row, _ in asked],
                ASKED,
                "triangle",
                labels="points",
                names=[name.replace("=", " ").replace('"', "") for _, (name, _) in asked],
            ),
            Series("Perfect BVH", [case["ours"] for case in cases], rows, OURS, "circle"),
        ],
    )
