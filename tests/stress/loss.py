"""A pair of numbers: what a usual method loses, what this engine loses."""

from __future__ import annotations

from dataclasses import dataclass

PER_MILLION = "wrong per million"
WORK = "times the work"


@dataclass(frozen=True)
class Loss:
    """naive, ours: what each loses, in `unit`; `nothing` is the number that means no loss.

    other: what this engine loses in the same unit if it is asked to work otherwise, and what was asked.
    """

    unit: str
    naive: float
    ours: float
    nothing: float = 0.0
    other: tuple[str, float] | None = None

    def shown(self, value: float) -> str:
        """The number as the table has it."""
        return f"{value:.2f}" if self.unit == WORK else f"{value:,.0f}"
