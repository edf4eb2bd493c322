"""The rules for single values that callers pass, each in one place. Messages name function, argument, expected, got."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

LARGEST_COUNT = 2**31 - 1

T = TypeVar("T")


def check_count(function: str, name: str, value: object, least: int, most: int = LARGEST_COUNT) -> int:
    """Returns an integer, least to most. numpy's integers are accepted; floats and bools are not, even whole ones."""
    try:
        count = None if isinstance(value, (bool, np.bool_)) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        count = None
    if count is None or not least <= count <= most:
        # Python refuses to write out integers of thousands of digits.
        is_long = count is not None and abs(count) >= 10**40
        got = f"one of {count.bit_length()} bits" if is_long else repr(value)  # type: ignore[union-attr]
        raise ValueError(f"{function}: {name} must be an integer from {least} to {most}, got {got}")
    return count


def check_id(function: str, name: str, value: object) -> int:
    """An integer that can be an id; whether there is such a mesh or instance is for the engine to say."""
    return check_count(function, name, value, -(2**31), LARGEST_COUNT)


def check_number(
    function: str,
    name: str,
    value: Any,
    least: float = -math.inf,
    most: float = math.inf,
    *,
    above: bool = False,
    below: bool = False,
) -> float:
    """A finite number, least to most. above, below: those two themselves are not allowed."""
    try:
        number = math.nan if isinstance(value, (bool, np.bool_, str)) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    is_within = least <= number <= most and not (above and number == least) and not (below and number == most)
    if not (is_within and math.isfinite(number)):
        if math.isinf(most):
            wanted = "a finite number"
            wanted += "" if math.isinf(least) else f" {'above' if above else 'of at least'} {least:g}"
        else:
            upper = f"{'below' if below else 'up to'} {most:g}" if above else f"{'below ' if below else ''}{most:g}"
            wanted = f"a number above {least:g} and {upper}" if above else f"a number from {least:g} to {upper}"
        raise ValueError(f"{function}: {name} must be {wanted}, got {value!r}")
    return number


def check_choice(function: str, name: str, value: object, choices: Sequence[str]) -> str:
    """One of a few names."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{function}: {name} must be one of {', '.join(choices)}; got {value!r}")
    return value


def check_kind(function: str, name: str, value: object, kind: type[T]) -> T:
    """An object of one of the package's own classes."""
    if not isinstance(value, kind):
        raise ValueError(f"{function}: {name} must be a perfect_bvh.{kind.__name__}, got {type(value).__name__}")
    return value


def check_column(
    function: str, name: str, value: npt.ArrayLike, dtype: type[np.generic], row: tuple[int, ...]
) -> npt.NDArray[Any]:
    """(N, *row); copied only where the dtype or the layout differs."""
    array = np.asarray(value)
    expected = "(N" + "".join(f", {length}" for length in row) + ("," if not row else "") + ")"
    if array.ndim != 1 + len(row) or array.shape[1:] != row:
        raise ValueError(f"{function}: {name} must have shape {expected}, got {array.shape}")
    if array.dtype != dtype and not np.can_cast(array.dtype, dtype, casting="same_kind"):
        raise ValueError(f"{function}: {name} must be {np.dtype(dtype).name}, got {array.dtype}")
    return np.ascontiguousarray(array, dtype=dtype)
