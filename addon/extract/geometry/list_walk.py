"""Blender's list of instances, of which only those of some objects are looked at."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...sync.records import Float32Array, Int32Array
from .listing import GroupFinder

_LEVELS = 8  # of a persistent id


@dataclass(slots=True)
class ListedPart:
    """An object's own entry and those of what it shows. matrices: (4, 4) each, in rows."""

    group_ids: list[int] = field(default_factory=list)
    matrices: list[Any] = field(default_factory=list)
    persistent_ids: list[Any] = field(default_factory=list)

    @property
    def columns(self) -> tuple[Float32Array, Int32Array, Int32Array]:
        """(N, 4, 4) float32 matrices in columns, (N,) int32 group ids and (N, 8) int32 persistent ids."""
        count = len(self.group_ids)
        matrices = np.array(self.matrices, np.float32).reshape(count, 4, 4)
        persistent_ids = np.array(self.persistent_ids, np.int32).reshape(count, _LEVELS)
        return np.ascontiguousarray(matrices.transpose(0, 2, 1)), np.array(self.group_ids, np.int32), persistent_ids


class ListWalk:
    """Goes through the list once. Objects must be asked for in the order in which the depsgraph has them."""

    def __init__(self, depsgraph: Any, finder: GroupFinder, numbering: int) -> None:
        self._items = iter(depsgraph.object_instances)
        self._item = next(self._items, None)
        self._finder = finder
        self._numbering = numbering

    def read(self, obj: Any) -> ListedPart:
        """What belongs to an evaluated object; what stands before it is passed over."""
        while self._item is not None and (self._item.is_instance or self._item.object != obj):
            self._item = next(self._items, None)
        if self._item is None:
            raise RuntimeError(f"{obj.name}: not in the depsgraph's list of instances, or in another place than it")
        part = ListedPart()
        while self._item is not None and (not part.group_ids or self._belongs_to(obj)):
            part.group_ids.append(self._finder.find(self._item, self._numbering))
            # Copies: an entry is overwritten by the next one.
            part.matrices.append(np.array(self._item.matrix_world, np.float32))
            part.persistent_ids.append(tuple(self._item.persistent_id))
            self._item = next(self._items, None)
        return part

    def _belongs_to(self, obj: Any) -> bool:
        return self._item.is_instance and self._item.parent == obj
