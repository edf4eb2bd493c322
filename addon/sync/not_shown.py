"""Parts of Blender's scene that an image lacks or shows differently: a record each, and a line of counts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Kind = Literal["library", "dark", "object", "scan", "shape", "material", "image", "light", "world", "setting"]

# In order of importance to users: singular, plural, and what happened to it.
_COUNTED: dict[Kind, tuple[str, str, str]] = {
    "library": ("library", "libraries", "missing"),
    "material": ("material", "materials", "simplified"),
    "object": ("object", "objects", "not shown"),
    "scan": ("scan", "scans", "shown in viewports only"),
    "shape": ("object", "objects", "simplified"),
    "image": ("image", "images", "not found"),
    "light": ("light", "lights", "simplified"),
    "world": ("world", "worlds", "simplified"),
    "setting": ("setting", "settings", "ignored"),
}

# What users can do about it, a sentence each.
_WHAT_TO_DO: dict[Kind, str] = {
    "library": "Relocate the library in the Outliner's Blender File view, and reload it",
    "dark": "Add a light, or give the world a color",
    "object": "Convert it to a mesh to have it shown",
    "scan": "Instance a mesh on its points with Geometry Nodes to have them rendered",
    "shape": "Use other modifiers to make the missing detail",
    "material": "Bake the unsupported nodes into an image texture, or ignore this message",
    "image": "Search for it with File > External Data > Find Missing Files",
    "light": "Remove the setting or node, or ignore this message",
    "world": "Bake the unsupported nodes into an environment texture, or ignore this message",
    "setting": "Turn it off, or ignore this message",
}

# The kinds by which objects can be found, and how objects are related to them.
SELECTABLE: dict[Kind, str] = {
    "object": "is it",
    "scan": "is it",
    "shape": "has this shape",
    "material": "has this material",
    "light": "has this light or is it",
    "library": "comes from this library",
}


@dataclass(frozen=True, slots=True)
class NotShown:
    """A part of the scene that is not shown, or shown differently.

    kind: the kind of data that the name belongs to. "dark" is a scene without light, "scan" an object whose points are
    drawn over viewports, "shape" an object's shape, "light" a light or an object that emits light. session_uid: of the
    object, material, image, light or world, 0 for others. text: a sentence without its subject: what is not shown, and
    what is shown instead. advice: what the user can do, if it differs from the advice for the kind.
    """

    kind: Kind
    name: str
    session_uid: int
    text: str
    advice: str = ""

    @property
    def what_to_do(self) -> str:
        """A sentence."""
        return self.advice or _WHAT_TO_DO[self.kind]

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"


def is_of_looks(row: NotShown) -> bool:
    """Whether it counts only where materials, lights and the world are shown."""
    return row.kind not in {"library", "object", "scan", "shape", "setting"}


def without_looks(not_shown: Iterable[NotShown]) -> tuple[NotShown, ...]:
    """Returns the rows that matter if materials, lights and the world are not shown at all."""
    return tuple([row for row in not_shown if not is_of_looks(row)])


def without_scans(warnings: Iterable[str], not_shown: Iterable[NotShown]) -> tuple[str, ...]:
    """Returns the warnings for what casts rays at scenes to measure them, which the points of scans are no part of."""
    of_scans = {str(row) for row in not_shown if row.kind == "scan"}
    return tuple([warning for warning in warnings if warning not in of_scans])


def summarize(not_shown: Iterable[NotShown]) -> str:
    """Summarises in one line, such as "3 materials simplified, 1 object not shown"; empty without rows."""
    found: dict[Kind, set[tuple[int, str]]] = {}
    for row in not_shown:
        # A setting has no number: each counts for itself.
        found.setdefault(row.kind, set()).add((row.session_uid, "" if row.session_uid else row.text))
    parts = [
        f"{len(found[kind])} {many if len(found[kind]) > 1 else one} {what}"
        for kind, (one, many, what) in _COUNTED.items()
        if kind in found
    ]
    return ", ".join([*(["No light"] if "dark" in found else []), *parts])
