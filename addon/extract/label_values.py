"""Labels by name, read from Blender: custom properties, objects, instancers, materials and collections.

Only this module defines the label NAME of an instance, for point clouds and for label images. A custom property
is looked up in the object, then in its instancer, the outermost of several, in the object's data, in the
instancer's data, and last in the material that a ray hits. Four names are not properties: `object`,
`instancer`, `material`, and `collection`, the first by name of those that hold the object itself, else of those that
hold its instancer.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import bpy

from ..sync.lookup import MISSING, LabelTable, OwnerValues, SceneLabel
from ..sync.not_shown import NotShown
from ..sync.records import SceneRecord

OBJECT, INSTANCER, MATERIAL, COLLECTION = "object", "instancer", "material", "collection"
BUILT_IN = (OBJECT, INSTANCER, MATERIAL, COLLECTION)
# Objects that no ray can hit, with any modifiers.
_NEVER_MET = frozenset({"EMPTY", "CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER", "ARMATURE", "LATTICE"})
_NONE: dict[int, float] = {}


class LabelReader:
    """Reads labels each time a scene changes.

    Their tables come from the whole file in its current state, and not from the hits: the same names have the same rows
    in any part of a scan or frame. New texts are added at the end. Animated numbers are read
    at each time. The first reading decides the type of a label: texts, whole numbers, or floats.

    what: the caller, for errors. names: of custom properties, or of `BUILT_IN`. as_names: numbers become names as well.
    Raises ValueError for a name that nothing in the file has, and values that are no labels. An empty text is a text;
    numbers that are not finite count as none.
    """

    def __init__(self, what: str, names: Sequence[str], *, as_names: bool = False) -> None:
        _check_names(what, names)
        self._columns = {
            name: _BuiltIn(name) if name in BUILT_IN else _Property(what, name, as_names=as_names) for name in names
        }

    @property
    def tables(self) -> dict[str, LabelTable]:
        """The table of each name, with all texts read so far."""
        return {name: column.table for name, column in self._columns.items()}

    def read(self, depsgraph: Any) -> LabelReading:
        """Reads Blender's current values. depsgraph: evaluated, for animated ones. Main thread only."""
        return LabelReading({name: column.read(depsgraph) for name, column in self._columns.items()}, self.tables)


class LabelReading:
    """The labels at one time; does not read Blender."""

    def __init__(self, values: dict[str, OwnerValues], tables: dict[str, LabelTable]) -> None:
        self._values = values
        self._tables = tables

    def of(self, record: SceneRecord) -> dict[str, SceneLabel]:
        """Returns the labels by the rows of a record of that time."""
        return {name: values.of(record, self._tables[name]) for name, values in self._values.items()}


def collections_of_objects() -> dict[int, tuple[str, ...]]:
    """The names of all collections that hold an object itself, sorted, by the object's session uid."""
    found: dict[int, set[str]] = {}
    for holder in (*(scene.collection for scene in bpy.data.scenes), *bpy.data.collections):
        for obj in holder.objects:
            found.setdefault(obj.session_uid, set()).add(holder.name)
    return {uid: tuple(sorted(names)) for uid, names in found.items()}


# Columns -------------------------------------------------------------------------------------------------------------


class _Names:
    """A sorted table of names, to which others may be added."""

    def __init__(self, names: Iterable[str]) -> None:
        self._rows = {name: row for row, name in enumerate(sorted(set(names), key=_by_number))}

    def row_of(self, name: str) -> int:
        return self._rows.setdefault(name, len(self._rows))

    @property
    def table(self) -> LabelTable:
        return LabelTable(tuple(self._rows), MISSING)


class _BuiltIn:
    """One of `BUILT_IN`: the names of these owners."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._names = _Names(name for _, name in self._named())
        if name == COLLECTION:  # those that hold no object as well
            holders = (*(scene.collection for scene in bpy.data.scenes), *bpy.data.collections)
            self._names = _Names(holder.name for holder in holders)

    @property
    def table(self) -> LabelTable:
        return self._names.table

    def read(self, _: Any) -> OwnerValues:
        rows = {uid: self._names.row_of(name) for uid, name in self._named()}
        if self._name == MATERIAL:
            return OwnerValues(_NONE, _NONE, rows)
        return OwnerValues(rows, _NONE, _NONE, from_object=self._name != INSTANCER, from_instancer=self._name != OBJECT)

    def _named(self) -> Iterator[tuple[int, str]]:
        """Owners' session uids, and the names that rays find on them."""
        if self._name == COLLECTION:
            yield from ((uid, names[0]) for uid, names in collections_of_objects().items())
            return
        for block in bpy.data.materials if self._name == MATERIAL else bpy.data.objects:
            if self._name != OBJECT or block.type not in _NEVER_MET:
                yield block.session_uid, block.name


class _Property:
    """A custom property: texts if any value is one or `as_names`; else numbers, whole if all are and none is -1."""

    def __init__(self, what: str, name: str, *, as_names: bool) -> None:
        self._what, self._name = what, name
        values = [self._value(owner) for owner in _owners()]
        found = [value for value in values if value is not None]
        if not found:
            raise ValueError(f"{what}: {_unknown(name)}")
        self._names: _Names | None = None
        if as_names or any(isinstance(value, str) for value in found):
            self._names = _Names(map(str, found))
            self._numbers = LabelTable(None, MISSING)
        elif all(isinstance(value, int) for value in found):
            self._numbers = LabelTable(None, math.nan if MISSING in found else MISSING)
        else:
            self._numbers = LabelTable(None, math.nan)

    @property
    def table(self) -> LabelTable:
        return self._numbers if self._names is None else self._names.table

    def read(self, depsgraph: Any) -> OwnerValues:
        objects, data = {}, {}
        of_data: dict[int, float | None] = {}
        for obj in bpy.data.objects:
            number = self._number(obj, depsgraph)
            if number is not None:
                objects[obj.session_uid] = number
            owner = obj.data
            if owner is None:
                continue
            uid = owner.session_uid
            if uid not in of_data:
                of_data[uid] = self._number(owner, depsgraph)
            number = of_data[uid]
            if number is not None:
                data[obj.session_uid] = number
        materials = {material.session_uid: self._number(material, depsgraph) for material in bpy.data.materials}
        return OwnerValues(objects, data, {uid: value for uid, value in materials.items() if value is not None})

    def _number(self, owner: Any, depsgraph: Any) -> float | None:
        value = self._value(owner)
        if value is not None and depsgraph.mode == "RENDER" and owner.animation_data is not None:
            value = self._value(owner.evaluated_get(depsgraph))  # a render does not write back animated values
        if value is None:
            return None
        if self._names is not None:
            return self._names.row_of(str(value))
        is_whole = self._numbers.is_whole
        if isinstance(value, str) or (is_whole and (value == MISSING or not isinstance(value, int))):
            kind = f"whole numbers other than {MISSING}" if is_whole else "numbers"
            raise ValueError(
                f"{self._what}: label {self._name!r} held {kind} alone at first, and now has {value!r} on "
                f"{owner.name!r}; give one of its owners {'a fraction' if not isinstance(value, str) else 'a text'} "
                "from the beginning"
            )
        return float(value)

    def _value(self, owner: Any) -> int | float | str | None:
        value = owner.get(self._name)
        if value is None or isinstance(value, str):
            return value
        if isinstance(value, (bool, int)):
            return int(value)
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        if isinstance(value, bpy.types.ID):
            return value.name
        raise ValueError(
            f"{self._what}: label {self._name!r} must be a number, a text or a data-block, got "
            f"{type(value).__name__} on {owner.name!r}"
        )


def _owners() -> Iterator[Any]:
    """Yields all data-blocks that may have a label."""
    seen = set()
    for obj in bpy.data.objects:
        yield obj
        if obj.data is not None and obj.data.session_uid not in seen:
            seen.add(obj.data.session_uid)
            yield obj.data
    yield from bpy.data.materials


def _check_names(what: str, names: Sequence[str]) -> None:
    if isinstance(names, str):
        raise ValueError(f"{what}: labels must be a sequence of names, got one text; ({names!r},) is one of one name")
    for name in names:
        if not isinstance(name, str) or not name:
            raise ValueError(f"{what}: labels must be names, got {name!r}")
    twice = next((name for place, name in enumerate(names) if name in names[:place]), None)
    if twice is not None:
        raise ValueError(f"{what}: labels must differ, got {twice!r} twice")


def _unknown(name: str) -> str:
    known = sorted({key for owner in _owners() for key in owner.keys()} | set(BUILT_IN))  # noqa: SIM118 - no dict
    if name in known:
        return (
            f"label {name!r} has no finite number: all its values are NaN or infinite; give one of its owners another"
        )
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f" (is it {near[0]!r}?)" if near else ""
    return (
        f"no object, data or material of this file has a custom property {name!r} that could be a label{hint}; "
        f"{', '.join(BUILT_IN)} can be labels without one"
    )


def _by_number(text: str) -> tuple[int, float, str]:
    """Numbers by their size, before all other names."""
    try:
        number = float(text)
    except ValueError:
        return 1, 0.0, text
    return (1, 0.0, text) if math.isnan(number) else (0, number, text)


# Libraries -----------------------------------------------------------------------------------------------------------
# Linked libraries that Blender did not find: their objects become empties without data.


def find_missing_libraries() -> list[NotShown]:
    """Returns a row for each missing library of the open file."""
    return [
        NotShown("library", library.name, library.session_uid, f"the linked library {path_of(library)} is missing")
        for library in bpy.data.libraries
        if library.is_missing
    ]


def find_missing_blocks() -> list[NotShown]:
    """Returns rows for data-blocks that libraries no longer contain. It checks every data-block: once a file."""
    return [
        NotShown("library", block.name, block.session_uid, f"it is not in the linked library {path_of(library)}")
        for library in bpy.data.libraries
        if not library.is_missing
        for block in library.users_id
        if block.is_missing
    ]


def path_of(library: Any) -> str:
    """Returns a library's path in the file system."""
    return str(bpy.path.abspath(library.filepath, library=library.parent))


# Scans ---------------------------------------------------------------------------------------------------------------
# Objects that are the result of a scan, and how they are known.


OBJECT_NAMES = "object_names"  # a custom property of the data
# Cycles finds no attribute that is called "color" on points.
COLOR, RADIUS = "Color", "radius"


def has_points(obj: Any) -> bool:
    """Whether an object is a scan that still has its colours and radii."""
    if obj.type not in {"POINTCLOUD", "MESH"}:
        return False
    data: Any = obj.data
    return (
        OBJECT_NAMES in data
        and {COLOR, RADIUS}.issubset(data.attributes.keys())
        and len(data.attributes[COLOR].data) > 0
    )
