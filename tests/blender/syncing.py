"""Shared helpers for tests of `SceneSync`: one ray down and its answer, edits, and reports of edits."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from perfect_bvh import StaleSceneError
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.events import changes
from perfect_bvh_addon.sync.report import SyncReport

DOWN = (0.0, 0.0, -1.0)
PASSED_OVER = "Blender did not evaluate it again"


def cast_down(sync: SceneSync, x: float = 0.2, y: float = 0.2) -> Any:
    return sync.scene.cast_rays([(x, y, 10.0)], [DOWN])


def height(sync: SceneSync, x: float = 0.2, y: float = 0.2) -> float:
    return 10.0 - float(cast_down(sync, x, y).t_hit[0])


def depsgraph() -> Any:
    """Return the viewport's depsgraph, for both halves of an update."""
    return bpy.context.evaluated_depsgraph_get()


def move(obj: Any, z: float) -> None:
    obj.location.z = z
    bpy.context.view_layer.update()


def installed() -> int:
    """Count the add-on's functions that Blender would call."""
    return sum(handler in getattr(bpy.app.handlers, name) for name, handler in changes._HANDLERS)


def assert_stale(sync: SceneSync, message: str) -> None:
    with pytest.raises(StaleSceneError, match=message):
        cast_down(sync)
    with pytest.raises(StaleSceneError, match=message):
        sync.scene.test_occlusions([(0, 0, 1)], [DOWN])


def reasons(report: SyncReport) -> dict[str, str]:
    """Return why each mesh was read or passed over, by its name."""
    return {mesh.name: mesh.reason for mesh in report.meshes}


def deform(name: str, factor: float = 2.0, *, data: Any = None) -> None:
    """Move the vertices of an object's mesh, or of `data`, by a factor."""
    data = data or bpy.data.objects[name].data
    points = np.empty(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_get("co", points)
    data.vertices.foreach_set("co", points * np.float32(factor))
    data.update()
