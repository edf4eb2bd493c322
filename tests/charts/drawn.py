"""Finds the figures that charts and the sentences about them read from a file; data/ keeps only those."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from typing import Any

from charts import told
from charts.figures import Figures
from charts.make import CHARTS, fingerprint
from stress import zoo_table


class Watched(Mapping[str, Any]):
    """An object of figures that records which of its values are read."""

    __slots__ = ("_asked", "_values")

    def __init__(self, values: Figures) -> None:
        self._values = {key: _watch(value) for key, value in values.items()}
        self._asked: set[str] = set()

    def __getitem__(self, key: str) -> Any:
        value = self._values[key]
        self._asked.add(key)
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def asked(self) -> Figures:
        """The values that were read, as plain objects."""
        return {key: _asked(value) for key, value in self._values.items() if key in self._asked}


def drawn(name: str, figures: Figures) -> Figures:
    """The part of data/NAME.json that a chart, a sentence or the zoo's table shows; the machine is kept whole."""
    watched = Watched(figures)
    for module in (importlib.import_module(f"charts.{chart}") for chart in CHARTS):
        if name == module.DATA:
            fingerprint(module.chart(watched))
    for tell, data in told.TOLD.values():
        if data == name:
            tell(watched)  # type: ignore[arg-type]
    if name == zoo_table.DATA:
        zoo_table.table(watched)  # type: ignore[arg-type]
    return {"machine": figures["machine"], **{key: value for key, value in watched.asked().items() if key != "machine"}}


def _watch(value: Any) -> Any:
    if isinstance(value, dict):
        return Watched(value)
    return [_watch(part) for part in value] if isinstance(value, list) else value


def _asked(value: Any) -> Any:
    if isinstance(value, Watched):
        return value.asked()
    return [_asked(part) for part in value] if isinstance(value, list) else value
