"""Maps values to positions along an axis, and places its ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .chart import Axis

ZERO_SHARE = 0.09  # of a logarithmic axis that has a zero: the share between zero and the first power
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
UNITS = ((1e9, "G"), (1e6, "M"), (1e3, "k"))


@dataclass(frozen=True, slots=True)
class Scale:
    """low, high: the values at its ends (the lower one without the zero's share)."""

    axis: Axis
    low: float
    high: float

    @classmethod
    def over(cls, axis: Axis, values: Iterable[float]) -> Scale:
        """Wide enough for the values, with a little air."""
        if axis.names:
            return cls(axis, len(axis.names) - 0.4, -0.6)
        finite = [value for value in values if math.isfinite(value) and (value > 0.0 or not axis.log)]
        low, high = (min(finite), max(finite)) if finite else (1.0, 10.0)
        if axis.log:
            low, high = low / 1.25, high * 1.25
            if axis.has_zero:
                low = 10.0 ** math.floor(math.log10(low) + 1e-9)
        else:
            low, high = min(low, 0.0), high + 0.06 * (high - min(low, 0.0) or 1.0)
        low, high = low if axis.low is None else axis.low, high if axis.high is None else axis.high
        return cls(axis, low, high if high > low else low * 10.0 if axis.log else low + 1.0)

    def place(self, value: float) -> float:
        """0 at the lower end, 1 at the upper; values beyond are clamped. nan for nan."""
        if math.isnan(value):
            return math.nan
        if not self.axis.log:
            return min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)
        share = ZERO_SHARE if self.axis.has_zero else 0.0
        if value <= 0.0:
            return 0.25 * share
        along = math.log(value / self.low) / math.log(self.high / self.low)
        return min(max(share + (1.0 - share) * along, share if self.axis.has_zero else 0.0), 1.0)

    def ticks(self, room: float) -> list[tuple[float, str]]:
        """Values and their labels; room: pixels along the axis."""
        if self.axis.names:
            return [(float(row), name) for row, name in enumerate(self.axis.names)]
        found = self._log_ticks(room) if self.axis.log else self._linear_ticks(room)
        return ([(0.0, "0")] if self.axis.log and self.axis.has_zero else []) + found

    def _log_ticks(self, room: float) -> list[tuple[float, str]]:
        decades = math.log10(self.high / self.low)
        step = max(1, math.ceil(decades * 34.0 / room))
        first = math.ceil(math.log10(self.low) - 1e-9)
        powers = range(first, math.floor(math.log10(self.high) + 1e-9) + 1)
        values = [10.0**power for power in powers if (power - first) % step == 0]
        if decades < 2.2 and not self.axis.powers:
            factors: Sequence[float] = (1.0, 2.0, 5.0) if decades > 0.8 else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
            every = (10.0**power * factor for power in range(first - 1, first + 4) for factor in factors)
            values = [value for value in every if self.low <= value * 1.0001 and value <= self.high * 1.0001]
        return [(value, power_of_ten(value) if self.axis.powers else short(value)) for value in values]

    def _linear_ticks(self, room: float) -> list[tuple[float, str]]:
        rough = (self.high - self.low) / max(2.0, room / 45.0)
        power = 10.0 ** math.floor(math.log10(rough))
        step = next(power * factor for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if power * factor >= rough * 0.999)
        first = math.ceil(self.low / step - 1e-9)
        count = math.floor(self.high / step + 1e-9) - first + 1
        return [((first + i) * step, short((first + i) * step)) for i in range(count)]


def short(value: float) -> str:
    """0.05, 2, 1.5k, 3M."""
    for unit, name in UNITS:
        if abs(value) >= unit * 0.9999:
            return f"{value / unit:.3g}{name}"
    return f"{value:.3g}"


def power_of_ten(value: float) -> str:
    """Formats as 10⁻⁶; 1 and 10 without an exponent."""
    power = round(math.log10(value))
    return short(value) if 0 <= power <= 1 else "10" + str(power).translate(SUPERSCRIPTS)
