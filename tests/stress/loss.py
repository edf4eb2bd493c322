"""A pair of numbers: the losses of a usual method and of this engine."""

from __future__ import annotations

from dataclasses import dataclass

PER_MILLION = "wrong per million"
WORK = "times the work"


@dataclass(frozen=True)
class Loss:
    """naive, ours: the losses, in `unit`; `nothing` is the number that means no loss.

    other: this engine's loss in the same unit with other settings, and these settings.
    """

    unit: str
    naive: float
    ours: float
    nothing: float = 0.0
    other: tuple[str, float] | None = None

    def as_json(self) -> dict[str, object]:
        """Counts as whole numbers, shares of work to three places."""
        other = None if self.other is None else [self.other[0], self._rounded(self.other[1])]
        numbers = {name: self._rounded(getattr(self, name)) for name in ("naive", "ours", "nothing")}
        return {"unit": self.unit, **numbers, "other": other}

    def _rounded(self, value: float) -> float:
        return round(value, 3) if self.unit == WORK else round(value)
