"""Shared helpers for tests of a ray's walk: a heap of spheres, and rays down into it."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import perfect_bvh
from oracles import meshes
from perfect_bvh_addon.view3d.walk.walk_picture import SceneState, ShownWalk, WalkedRay
from perfect_bvh_addon.view3d.walk.walk_steps import WalkWords, steps_of

DOWN = np.array([0.0, 0.0, -1.0])


def heap() -> perfect_bvh.Snapshot:
    """A heap of spheres, seen from above in `walk_down`."""
    engine = perfect_bvh.Scene()
    mesh = engine.add_mesh(*meshes.sphere(12, 16, 1.0))
    engine.add_instances(np.full(60, mesh), meshes.scattered(60, 2.0, 2))
    engine.commit()
    return engine.snapshot()


def names_in(walk: perfect_bvh.RayWalk) -> dict[int, str]:
    return {int(ident): f"Ball.{ident:03}" for ident in walk.instance_ids if ident >= 0}


def words_of(walk: perfect_bvh.RayWalk) -> WalkWords:
    return WalkWords(walk, names_in(walk), "{:.4g}".format)


def shown(ray: WalkedRay, steps: list[Any]) -> ShownWalk:
    return ShownWalk(ray, words_of(ray.walk), steps, SceneState.of(bpy.context.scene), 7, 8)


def walk_down(snapshot: perfect_bvh.Snapshot, x: float = 0.3, y: float = 0.2) -> tuple[WalkedRay, list[Any]]:
    origin = np.array([x, y, 9.0])
    walk = snapshot.walk_ray(origin, DOWN)
    return WalkedRay.of(walk, origin, DOWN, 0.0), steps_of(words_of(walk))
