"""Twelve scenes, each hard for one part of the engine, about the origin or about another centre."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hit_table import shapes
from hit_table.hashing import Doubles, between, integers
from perfect_bvh import BuildConfig, Scene


@dataclass(frozen=True)
class Made:
    """scene: committed. centre: (3,) float64, the centre of the rays."""

    scene: Scene
    centre: Doubles


def _of_meshes(*parts: shapes.Mesh, builder: str = "auto") -> Made:
    """Each mesh once, where it is."""
    scene = Scene()
    for positions, triangles in parts:
        config = BuildConfig(builder=builder)
        scene.add_instance(scene.add_mesh(positions.astype(np.float32), triangles, config))
    scene.commit()
    return Made(scene, np.zeros(3))


def soup() -> Made:
    return _of_meshes(shapes.soup(3000, 1))


def terrain() -> Made:
    return _of_meshes(shapes.terrain(48, 2))


def balls() -> Made:
    return _of_meshes(shapes.ball(4), shapes.ball(3, 0.5), shapes.ball(1, 1.5))


def slivers() -> Made:
    return _of_meshes(shapes.slivers(1500, 3), builder="spatial")


def walls() -> Made:
    """Rays run in planes and along edges."""
    return _of_meshes(shapes.boxes(200, 4))


def fan() -> Made:
    return _of_meshes(shapes.fan(400))


def matryoshka() -> Made:
    return _of_meshes(shapes.matryoshka(1500, 5))


def degenerate() -> Made:
    return _of_meshes(shapes.with_degenerate(shapes.ball(3)), shapes.with_degenerate(shapes.terrain(8, 6, 0.0)))


def coincident() -> Made:
    """Hits at equal t, within a mesh, between meshes and between instances; the order of one instance decides."""
    flat, finer = shapes.terrain(12, 7, 0.0), shapes.terrain(6, 7, 0.0)
    twice = flat[0], np.concatenate([flat[1], flat[1][::-1]])
    made = _of_meshes(twice, finer, shapes.ball(2, 0.5), shapes.ball(2, 0.5))
    made.scene.add_instance(0, order=-1)
    made.scene.commit()
    return made


def instances() -> Made:
    """Mirrored, sheared, flattened, masked; some of them on top of one another."""
    scene = Scene()
    parts = (shapes.ball(2), shapes.soup(200, 8), shapes.boxes(12, 9))
    ids = [scene.add_mesh(at.astype(np.float32), rows) for at, rows in parts]
    transforms = between(-1, 1, (80, 3, 4), 10)
    transforms[:, :, :3] /= 4.0
    transforms[:10, :, :3] = np.eye(3) * np.where(integers(2, 30, 11).reshape(10, 3, 1) == 1, 0.25, -0.25)
    transforms[10:14, 2, :3] = 0.0  # no inverse
    transforms[14, :, :3] = 0.0
    transforms[20:24] = transforms[24:28]
    scene.add_instances(np.resize(ids, 80), transforms, 1 + integers(7, 80, 12), integers(1000, 80, 13))
    scene.commit()
    return Made(scene, np.zeros(3))


def far_away() -> Made:
    """A scene in double, where a float has a resolution of half a unit."""
    centre = np.array([8.0e6, -3.0e6, 5.0e5])
    scene = Scene()
    for positions, triangles in (shapes.ball(3, 0.75), shapes.boxes(40, 14)):
        scene.add_instance(scene.add_mesh(positions + centre, triangles))
    scene.commit()
    return Made(scene, centre)


def moved() -> Made:
    """After three commits of edits: vertices, places, masks and a mesh replaced."""
    scene = Scene()
    positions, triangles = shapes.ball(3)
    ball, cloud = scene.add_mesh(positions, triangles), scene.add_mesh(*shapes.soup(600, 15))
    places = np.repeat(np.diag((0.5, 0.5, 0.5, 1.0))[None], 5, axis=0)
    places[:, :3, 3] = between(-1, 1, (5, 3), 16)
    ids = scene.add_instances([ball, ball, cloud, cloud, ball], places)
    scene.commit(100_000)
    for step in range(1, 4):
        scene.update_mesh(ball, positions + between(-1, 1, positions.shape, 17 + step) / 16.0)
        scene.update_mesh(cloud, shapes.soup(600, 15)[0] * (1.0 + step / 4.0))
        places[step, :3, 3] += 0.375
        scene.set_transforms(ids[step : step + 1], places[step : step + 1])
        scene.set_masks(ids[:1], [step])
        if step == 2:
            scene.remove_instances(ids[4:])
            scene.replace_mesh(cloud, *shapes.soup(600, 30))
        scene.commit(1000)
    return Made(scene, np.zeros(3))


SCENES: dict[str, Callable[[], Made]] = {
    make.__name__: make
    for make in (
        soup, terrain, balls, slivers, walls, fan, matryoshka, degenerate, coincident, instances, far_away, moved,
    )
}  # fmt: skip
