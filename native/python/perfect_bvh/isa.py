"""Which instruction set the kernels use. Every one of them gives the same answers, bit for bit."""

from __future__ import annotations

from . import _core


def available_isas() -> tuple[str, ...]:
    """The instruction sets that this build holds and this machine runs, the best last; "scalar" is always there."""
    return tuple(_core.available_isas())


def active_isa() -> str:
    """The one that queries use: the best, unless the variable PERFECT_BVH_ISA or `set_active_isa` says else.

    Raises ValueError if PERFECT_BVH_ISA names none of `available_isas()`.
    """
    return _core.active_isa()


def set_active_isa(name: str | None) -> None:
    """Uses another instruction set from now on, in all threads; None goes back to the default.

    For tests and benchmarks: it changes no answer. Raises ValueError for a name that is not available.
    """
    _core.set_active_isa("" if name is None else name)
