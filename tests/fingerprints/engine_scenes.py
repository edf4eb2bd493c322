"""Twelve small scenes from seeds, each with something that is hard for one part of the engine.

Everything lies about the origin within 2 units, apart from `far_away`, which lies about its own centre.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import perfect_bvh
from oracles import meshes
from perfect_bvh import BuildConfig, Scene

Points = npt.NDArray[np.float64]


@dataclass(frozen=True)
class EngineScene:
    """scene: committed. centre: (3,) float64, what queries are about. reports: of each commit, the first one first."""

    scene: Scene
    reports: tuple[perfect_bvh.CommitReport, ...]
    centre: Points


def _of_meshes(*parts: meshes.Mesh, builder: str = "auto", **settings: object) -> EngineScene:
    """Each mesh once, where it is."""
    scene = Scene()
    for positions, triangles in parts:
        config = BuildConfig(builder=builder, **settings)
        scene.add_instance(scene.add_mesh(positions.astype(np.float32), triangles, config))
    return EngineScene(scene, (scene.commit(),), np.zeros(3))


def boxes(count: int, seed: int) -> meshes.Mesh:
    """A hall: a floor of two triangles, and axis-parallel boxes from pebbles to walls on it."""
    random = np.random.default_rng(seed)
    corner = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    sizes = 10.0 ** random.uniform(-2.0, 0.0, (count, 3))
    places = np.append(random.uniform(-1.0, 0.8, (count, 2)), np.full((count, 1), -1.0), axis=1)
    positions = (places[:, None] + corner * sizes[:, None]).reshape(-1, 3)
    triangles = (8 * np.arange(count)[:, None, None] + faces).reshape(-1, 3)
    floor = np.array([(-2.0, -2.0, -1.0), (2.0, -2.0, -1.0), (2.0, 2.0, -1.0), (-2.0, 2.0, -1.0)])
    ground = len(positions) + np.array([(0, 1, 2), (0, 2, 3)])
    return np.concatenate([positions, floor]), np.concatenate([triangles, ground]).astype(np.int32)


def soup() -> EngineScene:
    return _of_meshes(meshes.soup(2500, 1, 0.1))


def sphere() -> EngineScene:
    return _of_meshes(meshes.sphere(32, 48))


def hall() -> EngineScene:
    return _of_meshes(boxes(150, 2))


def slivers() -> EngineScene:
    return _of_meshes(meshes.slivers(1500, 3))


def coincident() -> EngineScene:
    """Hits at equal t, within a mesh, between meshes and between instances."""
    positions, triangles = meshes.grid(12)
    twice = positions, np.concatenate([triangles, triangles[::-1]])
    made = _of_meshes(twice, meshes.grid(7), meshes.sphere(8, 12, 0.5), meshes.sphere(8, 12, 0.5))
    made.scene.add_instance(0, order=-1)
    return EngineScene(made.scene, (*made.reports, made.scene.commit()), made.centre)


def instances() -> EngineScene:
    """Mirrored, sheared, singular, masked; a few of them on top of one another."""
    random, scene = np.random.default_rng(4), Scene()
    parts = (meshes.sphere(10, 16), meshes.soup(200, 5, 0.2), boxes(12, 6))
    ids = [scene.add_mesh(at.astype(np.float32), rows) for at, rows in parts]
    transforms = np.zeros((80, 3, 4))
    transforms[:, :, :3] = random.normal(0.0, 0.15, (80, 3, 3))
    transforms[:, :, 3] = random.uniform(-1.0, 1.0, (80, 3))
    transforms[:10, :, :3] = np.eye(3) * random.uniform(0.1, 0.4, (10, 1, 1)) * random.choice((-1.0, 1.0), (10, 3, 1))
    transforms[10:14, 2, :3] = 0.0  # flattened: no inverse
    transforms[14, :, :3] = 0.0
    transforms[20:24] = transforms[24:28]
    masks = random.integers(1, 8, 80)
    scene.add_instances(np.resize(ids, 80), transforms, masks, random.permutation(80))
    return EngineScene(scene, (scene.commit(),), np.zeros(3))


def moved() -> EngineScene:
    """Meshes refitted, restructured or rebuilt, transforms, masks, meshes and instances changed, over four commits."""
    random, scene = np.random.default_rng(7), Scene()
    positions, triangles = meshes.sphere(24, 32)
    ball, cloud = scene.add_mesh(positions, triangles), scene.add_mesh(*meshes.soup(600, 8, 0.05))
    other = scene.add_mesh(*meshes.grid(9))
    placed = np.repeat(np.diag((0.5, 0.5, 0.5, 1.0))[None], 6, axis=0)
    placed[:, :3, 3] = random.uniform(-1.0, 1.0, (6, 3))
    ids = scene.add_instances([ball, ball, cloud, cloud, other, other], placed)
    reports = [scene.commit(100_000)]
    for step in range(1, 4):
        waves = 1.0 + 0.2 * step * np.sin(5.0 * positions[:, [2]] + step)
        scene.update_mesh(ball, positions * waves)
        scene.update_mesh(cloud, meshes.soup(600, 8 + 10 * (step == 3), 0.05)[0] + 0.3 * step)
        placed[step, :3, 3] += 0.4
        scene.set_transforms(ids[step : step + 1], placed[step : step + 1])
        scene.set_masks(ids[:1], [step])
        if step == 2:
            scene.remove_instances(ids[5:])
            scene.replace_mesh(other, *meshes.grid(5, 1.5))
        reports.append(scene.commit(10_000_000 if step == 3 else 1000))
    return EngineScene(scene, tuple(reports), np.zeros(3))


def refitted() -> EngineScene:
    """A tree that follows its vertices for four commits and is never rebuilt."""
    scene = Scene(policy="refit")
    positions, triangles = meshes.soup(1500, 9, 0.05)
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    reports = [scene.commit()]
    for step in range(1, 5):
        scene.update_mesh(mesh, positions * (1.0 + 0.15 * step * np.sin(7.0 * positions[:, [1, 2, 0]])))
        reports.append(scene.commit())
    return EngineScene(scene, tuple(reports), np.zeros(3))


def far_away() -> EngineScene:
    """In double, where a float has a resolution of half a unit."""
    centre = np.array([8.0e6, -3.0e6, 5.0e5])
    scene = Scene()
    for positions, triangles in (meshes.sphere(20, 24, 0.7), boxes(40, 10)):
        scene.add_instance(scene.add_mesh(positions + centre, triangles))
    near, place = scene.add_mesh(*meshes.soup(150, 11, 0.1)), np.eye(4)
    place[:3, 3] = centre
    scene.add_instance(near, place)
    return EngineScene(scene, (scene.commit(),), centre)


def spatial() -> EngineScene:
    parts = (meshes.slivers(400, 18), boxes(40, 19))
    return _of_meshes(*parts, builder="spatial", duplication_budget=0.5)


def quick() -> EngineScene:
    """The builder for meshes of a changing topology, through one change of it; one mesh improved by reinsertion."""
    made = _of_meshes(meshes.soup(1200, 20, 0.1), boxes(30, 21), builder="fast", optimize=3)
    scene = made.scene
    scene.add_instance(scene.add_mesh(*meshes.soup(700, 22, 0.1), BuildConfig(max_leaf_size=4), usage="changing"))
    scene.replace_mesh(0, *meshes.soup(900, 23, 0.1))
    return EngineScene(scene, (*made.reports, scene.commit()), made.centre)


SCENES: dict[str, Callable[[], EngineScene]] = {
    make.__name__: make
    for make in (
        soup, sphere, hall, slivers, coincident, instances, moved, refitted, far_away, spatial, quick,
    )
}  # fmt: skip
