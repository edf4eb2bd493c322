"""How many threads the engine uses, and what ends their work from another one."""

from __future__ import annotations

from . import _core
from ._arrays import check_count
from ._core import StopFlag, make_stop_flag, shutdown_threads, thread_count

__all__ = ["StopFlag", "make_stop_flag", "set_thread_count", "shutdown_threads", "thread_count"]

_MOST_THREADS = 1024


def set_thread_count(count: int) -> None:
    """Sets how many threads long calls use from now on; 0, the default, for as many as the process may use.

    Changes no answer. Calls under way are finished. Raises ValueError for anything but an integer from 0 to 1024.
    """
    _core.set_thread_count(check_count("set_thread_count", "count", count, 0, _MOST_THREADS))
