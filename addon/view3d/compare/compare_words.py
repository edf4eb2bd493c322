"""What is written under two trees that are compared: rows of a name, a value and a ratio. Knows no Blender."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...statistics.words import count_of, duration

if TYPE_CHECKING:
    from ..sample_rays import RayCost
    from .compare_trees import Comparison, Side

SAME = 0.005  # ratios as near to 1 as that are told to be 1


@dataclass(frozen=True, slots=True)
class Row:
    """ratio: to the other side's value, None where there is none to compare with; below 1 is better."""

    name: str
    value: str
    ratio: float | None = None

    @property
    def ratio_text(self) -> str:
        """Such as "0.76 x"."""
        if self.ratio is None:
            return ""
        return f"{self.ratio:.2f} x" if self.ratio < 9.995 else f"{self.ratio:,.0f} x"

    @property
    def is_better(self) -> bool:
        """Noticeably."""
        return self.ratio is not None and self.ratio < 1.0 - SAME

    @property
    def is_worse(self) -> bool:
        """Noticeably."""
        return self.ratio is not None and self.ratio > 1.0 + SAME


def rows_of(side: Side, other: Side | None = None) -> list[Row]:
    """Of one side; other: what it is compared with."""
    ratio = _ratio if other is not None else _no_ratio
    built = f" (built: {side.built_sah:,.1f})" if side.is_refitted else ""
    rows = [Row("SAH", f"{side.sah:,.1f}{built}", ratio(side.sah, other and other.sah))]
    if side.epo is not None:
        rows.append(Row("End-Point Overlap", f"{side.epo:,.2f}", ratio(side.epo, other and other.epo)))
    rows.append(Row("Nodes", f"{side.nodes:,}"))
    rows.append(Row("Leaves", f"{side.leaves:,}"))
    name = "Refit" if side.is_refitted else "Build"
    rows.append(Row(name, duration(side.milliseconds), ratio(side.milliseconds, other and other.milliseconds)))
    rows.append(_of_rays("Primary Ray", side.primary, other and other.primary))
    if side.diffuse is not None:
        rows.append(_of_rays("Diffuse Ray", side.diffuse, other and other.diffuse))
    return rows


def heading_of(comparison: Comparison) -> str:
    """What is compared."""
    triangles = count_of(len(comparison.shown.mesh.triangles), "triangle")
    return f"{comparison.shown.name}, frame {comparison.frame}: {triangles}"


def level_line(level: int, depth: int, count: int) -> str:
    """Which boxes of a side are drawn."""
    return f"Level {min(level, depth)} of {depth}: {count_of(count, 'box', 'boxes')}"


def _of_rays(name: str, cost: RayCost, other: RayCost | None) -> Row:
    value = f"{cost.nodes:.1f} nodes, {cost.triangles:.1f} triangles"
    if other is None:
        return Row(name, value)
    return Row(name, value, _ratio(cost.nodes + cost.triangles, other.nodes + other.triangles))


def _ratio(value: float, other: float | None) -> float | None:
    return value / other if other else None


def _no_ratio(value: float, other: float | None) -> float | None:
    return None
