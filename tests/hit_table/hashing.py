"""Numbers that are the same bits on every system: integers are mixed, then scaled by powers of two.

No sine, logarithm or generator of a library is used: only sums, products, quotients and square roots, one after the
other, which every processor rounds in the same way.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]


def mixed(count: int, seed: int) -> npt.NDArray[np.uint32]:
    """`count` 32-bit numbers without a pattern (the finalizer of MurmurHash3, applied twice)."""
    with np.errstate(over="ignore"):
        values = np.arange(count, dtype=np.uint32) * np.uint32(0x9E3779B9) + np.uint32(seed) * np.uint32(0x85EBCA77)
        for _ in range(2):
            values ^= values >> np.uint32(16)
            values *= np.uint32(0x85EBCA6B)
            values ^= values >> np.uint32(13)
            values *= np.uint32(0xC2B2AE35)
            values ^= values >> np.uint32(16)
    return values


def between(low: int, high: int, shape: tuple[int, ...], seed: int, bits: int = 16) -> Doubles:
    """Multiples of (high - low) / 2**bits from `low` to below `high`, which are integers."""
    steps = mixed(int(np.prod(shape)), seed) >> np.uint32(32 - bits)
    return (low + steps.astype(np.float64) * ((high - low) / 2.0**bits)).reshape(shape)


def integers(below: int, count: int, seed: int) -> npt.NDArray[np.int64]:
    """Whole numbers from 0 to below `below`."""
    return (mixed(count, seed) >> np.uint32(8)).astype(np.int64) % below
