"""The advice from measurements of a user's scene: a sentence for each measured part. Does not depend on Blender."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ..statistics.words import number

Figures = dict[str, Any]
FIXED_POLICIES = ("refit", "rebuild")
ALL_POLICIES = (*FIXED_POLICIES, "governed")
# The governor's actions on trees other than refits.
RESTRUCTURED = ("rebuilt", "partly_rebuilt", "rotated")
NOTHING_MOVES = "Nothing moves in these frames: BVHs are built once and kept."
NOTICEABLE = 1.05  # a difference below that is not worth a change
# Of builders, as the panel Compare lists them.
LABELS = {
    "auto": "Automatic",
    "median": "Median Split",
    "sweep": "Full Sweep",
    "binned": "Binned",
    "spatial": "Spatial Splits",
    "fast": "Fast",
}
POLICY_LABELS = {"refit": "Always Refit", "rebuild": "Always Rebuild", "governed": "Automatic"}
FEWEST_ROUNDS = 3  # that tell a difference from the machine's whims
TOO_LITTLE = "Too few rounds to compare builders: let it run longer."


def advice(figures: Figures) -> dict[str, str]:
    """Returns the sentences by the part's name; one for each measured part."""
    makers: dict[str, tuple[str, Callable[[Figures], str]]] = {
        "builders": ("builders", _builder_advice),
        "total_time": ("builders", _time_advice),
        "answers": ("answers", _answer_advice),
        "frames": ("frames", _frame_advice),
        "decay": ("frames", _decay_advice),
    }
    found = {name: make for name, (part, make) in makers.items() if figures.get(part)}
    if not any(row["name"] == "auto" for row in figures.get("builders", ())):  # what others are compared with
        found = {name: make for name, make in found.items() if makers[name][0] != "builders"}
    return {name: make(figures) for name, make in found.items()}


def rays_per_second(figures: Figures, row: Figures, which: str = "typical") -> float:
    """Returns millions of rays per second. which: of the times: "typical", or their quartiles "low" and "high"."""
    return float(figures["rays"] / row["trace_ms"][which] / 1e3)


def total_ms(figures: Figures, row: Figures, rays: float, which: str = "typical") -> float:
    """Returns the milliseconds of a builder's trees and of this number of rays through them."""
    return float(row["build_ms"][which] + rays / figures["rays"] * row["trace_ms"][which])


def frame_ms(row: Figures, policy: str) -> float:
    """Milliseconds of a frame's update and of the rays after it."""
    return float(row["policies"][policy]["update_ms"] + row["policies"][policy]["trace_ms"])


def frame_visits(row: Figures, policy: str) -> float:
    """Nodes and primitives that a ray visits in a frame's trees, in the mean."""
    return float(row["policies"][policy]["visits"])


def better_builder(figures: Figures) -> str | None:
    """Whose trees make rays noticeably and reliably faster than those of "auto"; None if none's do."""
    rows = {row["name"]: row for row in figures.get("builders", ())}
    if "auto" not in rows or min(row["trace_ms"]["count"] for row in rows.values()) < FEWEST_ROUNDS:
        return None
    speeds = {name: rays_per_second(figures, row) for name, row in rows.items()}
    best = max(speeds, key=lambda name: speeds[name])
    # Two builders differ only where the slow rounds of the one are still faster than the fast ones of the other.
    is_reliable = rows[best]["trace_ms"]["high"] <= rows["auto"]["trace_ms"]["low"]
    return best if is_reliable and speeds[best] >= NOTICEABLE * speeds["auto"] else None


def _builder_advice(figures: Figures) -> str:
    rows = {row["name"]: row for row in figures["builders"]}
    if min(row["trace_ms"]["count"] for row in rows.values()) < FEWEST_ROUNDS:
        return TOO_LITTLE
    best = better_builder(figures)
    if best is None:
        return "Keep the builder Automatic: no other builder makes this scene's rays reliably faster."
    faster = rays_per_second(figures, rows[best]) / rays_per_second(figures, rows["auto"])
    dearer = rows[best]["build_ms"]["typical"] / rows["auto"]["build_ms"]["typical"]
    return (
        f"{LABELS[best]} makes rays {faster:.2f} times as fast and takes {dearer:.1f} times as long to build. "
        "The panel Compare shows both."
    )


def _time_advice(figures: Figures) -> str:
    rows = {row["name"]: row for row in figures["builders"]}
    if min(row["trace_ms"]["count"] for row in rows.values()) < FEWEST_ROUNDS:
        return TOO_LITTLE
    few, many = (_reliably_best(figures, rows, rays) for rays in (1e5, 1e9))
    if few == many == "auto":
        return "Keep the builder Automatic for any number of rays: no other takes noticeably less time in all."
    if few == many:
        return f"{LABELS[few]} takes the least time in all here, for any number of rays."
    step = 10.0**0.02
    rays = 1e5
    while rays < 1e9 and total_ms(figures, rows[many], rays) > total_ms(figures, rows[few], rays):
        rays *= step
    return (
        f"{LABELS[few]} takes the least time in all up to about {_rays(rays)} rays, {LABELS[many]} beyond. "
        "Renders and scans choose by their number of rays."
    )


def _reliably_best(figures: Figures, rows: dict[str, Figures], rays: float) -> str:
    """Returns the builder with the least work, unless the default's is not noticeably and reliably more."""
    best = min(rows, key=lambda name: total_ms(figures, rows[name], rays))
    is_noticeable = total_ms(figures, rows["auto"], rays) > NOTICEABLE * total_ms(figures, rows[best], rays)
    is_reliable = total_ms(figures, rows["auto"], rays, "low") > total_ms(figures, rows[best], rays, "high")
    return best if is_noticeable and is_reliable else "auto"


def _answer_advice(figures: Figures) -> str:
    answers = figures["answers"]
    if not answers["checked"] and answers["not_judged"]:
        return "No results were checked: all rays pass near curves or points, which cannot be judged."
    if not answers["checked"]:
        return "The scene is too large to check a result in this time. On the command line, raise --seconds."
    if answers["wrong"]:
        return f"{answers['wrong']} of {answers['checked']:,} checked results are wrong: please report this scene."
    return (
        f"None of {answers['checked']:,} checked results is wrong: fewer than "
        f"{answers['interval'][1]:,.0f} per million are, at 95 % confidence."
    )


def _frame_advice(figures: Figures) -> str:
    rows = figures["frames"]
    sums = {policy: sum(frame_ms(row, policy) for row in rows) for policy in ALL_POLICIES}
    better = min(FIXED_POLICIES, key=lambda policy: sums[policy])
    ratio = sums["governed"] / sums[better]
    if not _moves(rows):
        return NOTHING_MOVES
    if ratio <= NOTICEABLE:
        return "Keep the automatic updates: in these frames neither refitting nor rebuilding always is faster."
    share = 100.0 * (ratio - 1.0)
    return f"Over these frames, to {better} always would take {share:.0f} % less time than the automatic updates."


def _decay_advice(figures: Figures) -> str:
    """Returns the cost of rays in the last frame, where trees were worst, and the governor's actions."""
    rows = figures["frames"]
    if not _moves(rows):
        return NOTHING_MOVES
    refit, rebuild, governed = (number(frame_visits(rows[-1], policy), 3) for policy in ALL_POLICIES)
    shares = [frame_visits(row, "refit") / frame_visits(row, "rebuild") for row in rows]
    worst = max(range(len(rows)), key=lambda place: shares[place])
    if shares[worst] < NOTICEABLE:
        decay = "Refitted BVHs stay as good as new ones."
    else:
        decay = (
            f"Refitted BVHs are slowest in frame {rows[worst]['frame']}: {shares[worst]:.2f} times what new ones cost."
        )
    frames = [row["frame"] for row in rows[1:] if set(RESTRUCTURED) & set(row["policies"]["governed"]["actions"])]
    if frames:
        count = f"{len(frames)} of {len(rows) - 1} frames"
        done = f"Automatic updates improved or rebuilt BVHs in {count}, first in {frames[0]}."
    else:
        done = "Automatic updates rebuilt none."
    return (
        f"In frame {rows[-1]['frame']} a ray visits {refit} nodes and primitives in BVHs that are only refitted, "
        f"{governed} with automatic updates, {rebuild} in new ones. {decay} {done}"
    )


def _moves(rows: list[Figures]) -> bool:
    governed = [row["policies"]["governed"] for row in rows[1:]]
    return any(row["actions"] or row["moved"] for row in governed)


def _rays(count: float) -> str:
    """Formats to two digits."""
    unit = 10.0 ** math.floor(math.log10(count) - 1.0)
    rounded = round(count / unit) * unit
    return f"{rounded / 1e6:,.3g} million" if rounded >= 1e6 else f"{rounded:,.0f}"
