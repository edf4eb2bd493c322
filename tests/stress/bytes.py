"""Any bytes, read as decisions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

Choice = TypeVar("Choice")
Features = set[tuple[str, ...]]
"""What was seen to happen while some bytes were played: a search keeps those that show what no others do."""


@dataclass
class Bytes:
    """Where the reading of some bytes has come to; behind their end are zeros."""

    data: bytes
    at: int = 0

    @property
    def is_over(self) -> bool:
        return self.at >= len(self.data)

    def take(self, count: int) -> int:
        """A number below count, from the next byte."""
        value = 0 if self.is_over else self.data[self.at]
        self.at += 1
        return value % count

    def pick(self, choices: Sequence[Choice]) -> Choice:
        """One of them, from the next byte."""
        return choices[self.take(len(choices))]


def kind_of(sentence: str) -> str:
    """The kind of a sentence, ignoring the numbers in it."""
    return re.sub(r"\(.*?\)|-?\d[-\d.,e]*", "#", sentence)
