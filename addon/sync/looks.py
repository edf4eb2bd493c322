"""Where two records of a scene look different although their geometry may be the same."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from .records import ImageRecord, MaterialVariants, SceneRecord

_OF_THE_FILM = ("film_transparent", "plain_reflectance", "pass_alpha_threshold")


def find_look_differences(old: SceneRecord, new: SceneRecord) -> tuple[str, ...]:
    """What differs, in words: "materials", "objects", "film", "world", "lights", "variants", "images"."""
    found = [name for name in ("materials", "objects", "world") if getattr(old, name) != getattr(new, name)]
    if any(getattr(old, name) != getattr(new, name) for name in _OF_THE_FILM):
        found.append("film")
    if _differ(old.lights, new.lights):
        found.append("lights")
    if _are_other_variants(old.variants, new.variants):
        found.append("variants")
    if len(old.images) != len(new.images) or any(map(_are_unlike, old.images, new.images)):
        found.append("images")
    return tuple(found)


def _are_other_variants(old: MaterialVariants | None, new: MaterialVariants | None) -> bool:
    if old is None or new is None:
        return old is not new
    if [*old.columns] != [*new.columns] or _differ(old, new, "columns"):
        return True
    return any(not np.array_equal(column, new.columns[name]) for name, column in old.columns.items())


def _are_unlike(old: ImageRecord, new: ImageRecord) -> bool:
    if old is new:
        return False
    if [*old.tiles] != [*new.tiles] or _differ(old, new, "tiles"):
        return True
    pairs = [(pixels, new.tiles[number]) for number, pixels in old.tiles.items()]
    return any(first is not second and not np.array_equal(first, second) for first, second in pairs)


def _differ(old: Any, new: Any, *left_out: str) -> bool:
    names = [field.name for field in fields(old) if field.name not in left_out]
    columns = [(getattr(old, name), getattr(new, name)) for name in names]
    return any(first is not second and not np.array_equal(first, second) for first, second in columns)
