"""The trees that are compared: every builder, and the lecture's three ways to be fast apart from one another."""

from __future__ import annotations

from typing import Any

from perfect_bvh import BuildConfig

# The engine's choice; then no heuristic at all, fewer axes, a number of planes that does not grow with the triangles. A
# user gets the fast builder by name for a static mesh, or by declaring that the mesh changes.
TREES: dict[str, dict[str, Any]] = {
    "auto": {},
    "median": {"builder": "median"},
    "sweep": {"builder": "sweep"},
    "binned": {"builder": "binned"},
    "binned, 1 axis": {"builder": "binned", "axes": 1},
    "binned, 4 bins": {"builder": "binned", "bins": 4},
    "binned, 8 bins": {"builder": "binned", "bins": 8},
    "binned, 32 bins": {"builder": "binned", "bins": 32},
    "binned+optimize": {"builder": "binned", "optimize": 5},
    "spatial": {"builder": "spatial"},
    "fast": {"builder": "fast"},
    "changing": {"usage": "changing"},
}


def config_of(name: str) -> BuildConfig:
    """The settings of a tree of this table, without the declared use of its mesh."""
    return BuildConfig(**{key: value for key, value in TREES[name].items() if key != "usage"})


def usage_of(name: str) -> str:
    """The declared use of the tree's mesh."""
    return str(TREES[name].get("usage", "static"))


def as_argument(name: str) -> str:
    """The same for the native program: NAME:BUILDER,SETTING=VALUE."""
    settings = dict(TREES[name])
    parts = [settings.pop("builder", "auto"), *(f"{key}={value}" for key, value in settings.items())]
    return f"{name}:{','.join(parts)}"
