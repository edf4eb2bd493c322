"""Shared helpers for tests of the tree overlay: scenes in step with Blender, and lines that are kept, not drawn."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.live import pending_commit
from perfect_bvh_addon.live.sync_cache import sync_of
from perfect_bvh_addon.view3d.tree_overlay import tree_lines


def keep_lines(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Collect the lines that would be drawn from now on, so that no graphics card is needed to follow a scene."""
    made: list[Any] = []

    def keep(lines: Any) -> object:
        made.append(lines)
        return object()

    monkeypatch.setattr(tree_lines, "_make_batch", keep)
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 60.0)  # however slow this machine is
    return made


def synced() -> SceneSync:
    """Bring the scene's shared sync up to date and return it."""
    sync = sync_of(bpy.context.evaluated_depsgraph_get())
    sync.update(bpy.context.evaluated_depsgraph_get())
    return sync
