"""The number of threads of the engine, and flags that stop their work from another thread."""

from __future__ import annotations

from . import _core
from ._checks import check_count
from ._core import StopFlag, make_stop_flag, shutdown_threads, thread_count

__all__ = ["StopFlag", "make_stop_flag", "set_thread_count", "shutdown_threads", "thread_count"]

_MOST_THREADS = 1024


def set_thread_count(count: int) -> None:
    """Sets the number of threads of long calls from now on; 0, the default, for as many as the process may use.

    Changes no answer. Running calls finish first.

    Raises:
        ValueError: For anything but an integer from 0 to 1024.
    """
    _core.set_thread_count(check_count("set_thread_count", "count", count, 0, _MOST_THREADS))


# Isa -----------------------------------------------------------------------------------------------------------------
# The instruction set of the kernels. All of them give the same answers, bit for bit.


def available_isas() -> tuple[str, ...]:
    """The instruction sets in this build that this machine supports, the best last; "scalar" is always there."""
    return tuple(_core.available_isas())


def active_isa() -> str:
    """The instruction set of queries: the best, unless the variable PERFECT_BVH_ISA or `set_active_isa` says otherwise.

    Raises:
        ValueError: If PERFECT_BVH_ISA names none of `available_isas()`.
    """
    return _core.active_isa()


def set_active_isa(name: str | None) -> None:
    """Selects another instruction set from now on, in all threads; None returns to the default.

    For tests and benchmarks: it changes no answer.

    Raises:
        ValueError: For a name that is not available.
    """
    _core.set_active_isa("" if name is None else name)
