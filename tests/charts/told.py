"""Sentences about the charts whose numbers come from the figures: make.py writes them into README.md.

They are between two marks next to each picture. The rest of the text there is written by hand.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable

import numpy as np
from charts.break_even import BUILT_AS, paid_for_choices
from charts.figures import FOLDER, Figures, count, load, named
from charts.predicted_cost import KIND, TREES, correlation, predict_each_without_its_mesh

README = FOLDER / "README.md"
SECTION = re.compile(r"(<!-- told: (\w+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def listed(words: Iterable[str]) -> str:
    """a, b and c; "none" for none."""
    *first, last = [*words] or ["none"]
    return f"{', '.join(first)} and {last}" if first else last


def percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def between(values: Iterable[float], form: str = ".1f") -> str:
    low, high = min(found := [*values]), max(found)
    return f"{low:{form}} to {high:{form}}"


def _ready(tree: Figures) -> float:
    return float(tree["ready_ms"]["1"]["median"])


def _speed(tree: Figures) -> float:
    return float(tree["rays"][KIND]["mrays_per_second"])


def build_and_speed(figures: Figures) -> str:
    trees = {mesh["name"]: named(mesh["trees"]) for mesh in figures["meshes"]}
    sooner = [name for name, each in trees.items() if _ready(each["auto"]) < _ready(each["embree_medium"])]
    faster = [name for name, each in trees.items() if _speed(each["auto"]) > _speed(each["embree_medium"])]
    low = [name for name, each in trees.items() if _speed(each["fast"]) > _speed(each["embree_low"])]
    early = [1.0 - _ready(each["embree_low"]) / _ready(each["fast"]) for each in trees.values()]
    early = [share for share in early if share > 0.0]
    late = [_ready(each["auto"]) / _ready(each["embree_medium"]) for name, each in trees.items() if name not in sooner]
    alike = [abs(_speed(each["auto"]) / _speed(each["binned"]) - 1.0) for each in trees.values()]
    dear = {
        name: ([_ready(t[name]) / _ready(t["auto"]) for t in trees.values()],
               [_speed(t[name]) / _speed(t["auto"]) - 1.0 for t in trees.values()])
        for name in ("sweep", "spatial")
    }  # fmt: skip
    return (
        f"Of {len(trees)} meshes four are drawn. `auto` is ready sooner than Embree's MEDIUM on {len(sooner)} "
        f"of them, and "
        f"its diffuse rays are faster on {len(faster)}; the rays of `fast` are faster than LOW's on {len(low)}. "
        f"**Unflattering:** on {listed(name for name in trees if name not in sooner)} `auto` is ready later than MEDIUM"
        f"{f', after {between(late)} times as long' if late else ''}; its rays are slower on "
        f"{listed(name for name in trees if name not in faster)}. LOW is ready sooner than `fast` on "
        f"{len(early)} meshes"
        f"{f', by {percent(min(early))} to {percent(max(early))} of its time' if early else ''}. `sweep` takes "
        f"{between(dear['sweep'][0])} times `auto`'s time for at most {percent(max(dear['sweep'][1]))} more speed, "
        f"`spatial` {between(dear['spatial'][0])} times for at most {percent(max(dear['spatial'][1]))}, and on "
        f"{sum(gain <= 0.0 for gain in dear['spatial'][1])} of them for none. `auto` and `binned`, whose trees differ "
        f"little, are up to {percent(max(alike))} apart: so far goes the noise. `median` is there for comparison only."
    )


def break_even(figures: Figures) -> str:
    parts, low_first = [], []
    for mesh in figures["meshes"]:
        trees = named(mesh["trees"])
        paid = paid_for_choices(mesh)
        rays, tree, share = max(paid, key=lambda each: each[2])
        name = next(name for name, built in BUILT_AS.items() if built == tree)
        parts.append((share, f"{share:.2f} on {mesh['name']} (`{name}` for {count(rays)} rays)"))
        ready = {name: _ready(each) for name, each in trees.items() if name in {*BUILT_AS.values(), "embree_low"}}
        low_first += [mesh["name"]] if min(ready, key=lambda each: ready[each]) == "embree_low" else []
    shares = [share for mesh in figures["meshes"] for _, _, share in paid_for_choices(mesh)]
    worst = [words for _, words in sorted(parts, reverse=True)[:4]]
    return (
        f"Over {len(figures['meshes'])} meshes and {len(shares)} numbers of rays the planner's choice costs "
        f"{np.mean(shares):.2f} times the best of ours in the mean. **Unflattering:** the most it costs is "
        f"{listed(worst)}. For few rays Embree's LOW is the soonest on {len(low_first)} of "
        f"{len(figures['meshes'])} meshes."
    )


def wrong_answers(figures: Figures) -> str:
    lost: dict[str, float] = {}
    for row in figures["sweeps"]["offset"]:
        for name, answers in row["surface"].items():
            if answers["missed_per_million"]:
                lost[name] = min(lost.get(name, row["value"]), row["value"])
    named_so = {"embree": "Embree's default", "embree_robust": "Embree ROBUST"}
    losers = listed(
        f"{named_so.get(name, name)} lost some from {away:,.0f} radii away on" for name, away in lost.items()
    )
    wrong = {
        name: [row["answers"][name]["wrong_per_million"] for row in figures["exact"]["distances"]]
        for name in figures["exact"]["distances"][0]["answers"]
    }
    ours_wrong = max(wrong.pop("perfect_bvh"))
    outlines = listed(f"{between(each, ',.0f')} by {named_so.get(name, name)}" for name, each in wrong.items())
    grounds = {way: {row["value"]: row["t"] for row in rows} for way, rows in figures["grounds"].items()}
    side = 1e5
    median = max(row["perfect_bvh"]["median"] for rows in grounds.values() for row in rows.values())
    ours = max((answers["perfect_bvh"] for rows in grounds.values() for answers in rows.values()), key=_off)
    speeds = {name: row["median"] for name, row in figures["speeds"].items() if row["from"] == "native"}
    peers = [answers["median"] for name, answers in grounds["aslant"][side].items() if name != "perfect_bvh"]
    flawless = listed(
        named_so.get(name, name)
        for name, answers in grounds["flat"][side].items()
        if name != "perfect_bvh" and not answers["off_per_million"]
    )
    return (
        f"Rays at vertices are the hardest there are, and rare in pictures: of rays at random points {losers}. Of a "
        "million rays from outside that meet a box's outlines exactly, or pass them by a float, "
        f"{ours_wrong:,.0f} are lost or made up by ours, {outlines}. On a "
        f"ground of {count(side)} units aslant the median error of t is {between(peers, '.0e')} of it with the others, "
        f"and with ours {median:.0e} on every ground, where {_told_off(ours)}. **Unflattering:** on a flat ground "
        f"{flawless} are right to the last digit, too, and the rays of the speeds shown go "
        f"{speeds['perfect_bvh'] / speeds['embree']:.2f} times as fast as by Embree's default."
    )


def _told_off(answers: Figures) -> str:
    if not _off(answers):
        return "none is off by more than a millionth"
    return (
        f"up to {_off(answers):,.0f} in a million are off by more than a millionth, by up to {answers['largest']:.0e}"
    )


def _off(answers: Figures) -> float:
    return float(answers["off_per_million"])


def predicted_cost(figures: Figures) -> str:
    rows = [(mesh["name"], tree) for mesh in figures["meshes"] for tree in mesh["trees"] if tree["name"] in TREES]
    names, built_by = (np.array(words) for words in zip(*((name, tree["name"]) for name, tree in rows), strict=True))
    time = np.array([1e3 / _speed(tree) for _, tree in rows])
    predicted = predict_each_without_its_mesh(np.array([[tree["sah"]] for _, tree in rows]), time, names)
    meshes = list(dict.fromkeys(names.tolist()))
    good = {name: correlation(predicted, time, (names == name) & (built_by != "median")) for name in meshes}
    least = min(good, key=lambda name: good[name])
    off = {name: float(np.median((time / predicted)[names == name])) for name in meshes}
    worst = max(off, key=lambda name: abs(np.log(off[name])))
    rest = [value for name, value in off.items() if name != worst]
    return (
        "**Unflattering:** that is most of what it tells. Without `median`'s trees the correlation falls to "
        f"{np.median(list(good.values())):.2f} in the median, and on {least} to {good[least]:.2f}; R² over all trees "
        f"is carried by {names[np.argmax(time)]}. A ray through {worst} takes {off[worst]:.1f} times what is predicted "
        f"(the median of its trees), through the other meshes {between(rest, '.2f')} times."
    )


def failure_zoo(figures: Figures) -> str:
    cases = figures["cases"] + figures["round_cases"]
    work = sorted((case for case in cases if case["unit"] == "times the work"), key=lambda case: -case["ours"])
    others = [case for case in cases if case["unit"] != "times the work" and case["ours"] > case["nothing"]]
    wrong = listed(f"{case['title'].lower()} ({case['ours']:,} {case['unit']})" for case in others)
    differ = f"Some answers differ from double precision's on: {wrong}." if others else "No answer is wrong."
    dear = listed(f"{case['title'].lower()} ({case['ours']:.1f})" for case in work if case["ours"] > 1.3)
    return (
        f"**Unflattering:** what the engine does by itself takes more than 1.3 times the least work on {dear}. "
        'Sticks and hair are cheap with `builder="spatial"`, which the engine takes where it is told that many rays '
        "will follow, or in the commit after them; after a long chain of small motions a commit that is told no "
        "number of rays restructures rather than rebuilds. "
        f"{differ}"
    )


def stability(figures: Figures) -> str:
    twist = min(figures["motions"]["twist"], key=lambda point: abs(point["amount"] - 6.28))["policies"]
    speeds = {name: twist[name]["speed"]["median"] for name in ("refit", "rotate", "rebuild_parts", "governed")}
    late = [point["left_behind"] for motion in figures["motions"].values() for point in motion]
    return (
        "Every knee is a method that fails: boxes that were made for the mesh at rest no longer fit, and rays "
        "take longer. "
        "Answers have no knee: through every tree that followed they are the new tree's, bit by bit, and "
        "without an update "
        f"{percent(min(late) / figures['rays'])} to {percent(max(late) / figures['rays'])} are another's. "
        f"**Unflattering:** "
        "at a twist of 2 pi the aim was 0.95 of a new tree's speed without building one; measured are "
        f"{speeds['refit']:.2f} by refits, {speeds['rotate']:.2f} with rotations, {speeds['rebuild_parts']:.2f} "
        f"with degraded "
        f"parts rebuilt, and {speeds['governed']:.2f} as the governor has it, which "
        f"{'rebuilds' if twist['governed']['action'] == 'rebuilt' else 'builds no new tree'}."
    )


TOLD: dict[str, tuple[Callable[[Figures], str], str]] = {
    "build_and_speed": (build_and_speed, "builders"),
    "break_even": (break_even, "builders"),
    "wrong_answers": (wrong_answers, "accuracy"),
    "predicted_cost": (predicted_cost, "builders"),
    "failure_zoo": (failure_zoo, "zoo"),
    "stability": (stability, "stability"),
}


def retold(text: str) -> str:
    """The README with these sentences as the kept figures have them."""

    def fill(found: re.Match[str]) -> str:
        tell, data = TOLD[found[2]]
        return (
            found[1]
            + textwrap.fill(tell(load(data)), 120, break_on_hyphens=False, break_long_words=False)
            + "\n"
            + found[4]
        )

    return SECTION.sub(fill, text)
