"""Any bytes as a series of edits of a scene, played on the engine and on a plain model of the scene's expected content.

After each commit the answers are audited, and compared bit by bit with those of a new scene filled from the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import perfect_bvh
from makers.zoo import CASES, Body
from makers.zoo.case import finite, rays_around
from makers.zoo.shapes import Mesh, loose
from perfect_bvh.build_config import BUILDERS

from .bytes import Bytes, Features, kind_of

RAYS = 40
LARGEST_MESH = 900
USAGES = ("static", "deforming", "changing")
BITS = ("t_hit", "primitive_ids", "primitive_uvs")

Deformation = Callable[[np.ndarray, np.random.Generator], np.ndarray]
DEFORMATIONS: tuple[Deformation, ...] = (
    lambda points, random: points + random.normal(0.0, 0.05, points.shape),
    lambda points, random: points[random.permutation(len(points))],
    lambda points, random: np.zeros_like(points),
    lambda points, random: points * (1.0, 1.0, 0.0),
    lambda points, random: points * 1e6,
    lambda points, random: points + 1e6,
    lambda points, random: points,
    lambda points, random: np.where(random.random(points.shape) < 0.1, np.nan, points),
    lambda points, random: points[:-1],
)
MATRICES = (
    np.eye(3),
    np.diag([-1.0, 1.0, 1.0]),
    np.diag([1.0, 1.0, 0.0]),
    np.array([[1.0, 0.8, 0.0], [0.0, 0.3, 0.1], [0.4, 0.0, 2.0]]),
    np.diag([1e-6, 1e-6, 1e-6]),
    np.diag([1e4, 1.0, 1.0]),
)


@cache
def shapes() -> tuple[Mesh, ...]:
    """The small meshes of all failure cases."""
    bodies = [part for case in CASES for state in case.states() for part in finite(state)]
    return tuple((part.positions, part.triangles) for part in bodies if len(part.triangles) <= LARGEST_MESH)


@dataclass
class Placed:
    mesh: int
    transform: np.ndarray
    mask: int
    order: int


@dataclass
class Play:
    """One scene and the model of it. features: the observed behaviour, for the search for new inputs."""

    data: bytes
    source: Bytes = field(init=False)
    scene: perfect_bvh.Scene = field(default_factory=perfect_bvh.Scene)
    meshes: dict[int, Mesh] = field(default_factory=dict)
    instances: dict[int, Placed] = field(default_factory=dict)
    features: Features = field(default_factory=set)

    def __post_init__(self) -> None:
        self.source = Bytes(self.data)
        self.random = np.random.default_rng(list(self.data))

    def run(self) -> Features:
        """All edits, and a last commit. Returns the features."""
        while not self.source.is_over:
            self.source.pick(EDITS)(self)
        self.commit()
        return self.features

    def take(self, count: int) -> int:
        return self.source.take(count)

    def pick(self, ids: dict[int, object]) -> int | None:
        return list(ids)[self.take(len(ids))] if ids else None

    # Edits -----------------------------------------------------------------------------------------------------------

    def add_mesh(self) -> None:
        mesh = shapes()[self.take(len(shapes()))]
        config = perfect_bvh.BuildConfig(builder=BUILDERS[self.take(len(BUILDERS))], optimize=self.take(8) // 7)
        ident = self.scene.add_mesh(*mesh, build=config, usage=USAGES[self.take(3)])
        self.meshes[ident] = mesh
        self.place(ident)

    def add_instance(self) -> None:
        mesh = self.pick(self.meshes)
        if mesh is not None:
            self.place(mesh)

    def place(self, mesh: int) -> None:
        transform, mask, order = self.matrix(), 1 + self.take(3), self.take(4)
        ident = self.scene.add_instance(mesh, transform, mask, order)
        self.instances[ident] = Placed(mesh, transform, mask, order)

    def matrix(self) -> np.ndarray:
        transform = np.eye(4)
        transform[:3, :3] = MATRICES[self.take(len(MATRICES))]
        transform[:3, 3] = self.random.normal(size=3) * self.take(3)
        return transform

    def deform(self) -> None:
        mesh = self.pick(self.meshes)
        if mesh is None:
            return
        points, triangles = self.meshes[mesh]
        with np.errstate(over="ignore"):
            moved = np.float32(DEFORMATIONS[self.take(len(DEFORMATIONS))](points.astype(np.float64), self.random))
        if np.abs(np.nan_to_num(moved)).max(initial=0.0) > 1e12:
            return
        if self.is_taken(lambda: self.scene.update_mesh(mesh, moved)):
            self.meshes[mesh] = moved, triangles

    def replace(self) -> None:
        mesh = self.pick(self.meshes)
        if mesh is not None:
            self.meshes[mesh] = shapes()[self.take(len(shapes()))]
            self.scene.replace_mesh(mesh, *self.meshes[mesh])

    def move(self) -> None:
        ident = self.pick(self.instances)
        if ident is not None:
            self.instances[ident].transform = self.matrix()
            self.scene.set_transforms([ident], [self.instances[ident].transform])

    def mask(self) -> None:
        ident = self.pick(self.instances)
        if ident is not None:
            self.instances[ident].mask = self.take(4)
            self.scene.set_masks([ident], [self.instances[ident].mask])

    def remove_instance(self) -> None:
        ident = self.pick(self.instances)
        if ident is not None:
            del self.instances[ident]
            self.scene.remove_instances([ident])

    def remove_mesh(self) -> None:
        mesh = self.pick(self.meshes)
        if mesh is not None and self.is_taken(lambda: self.scene.remove_mesh(mesh)):
            del self.meshes[mesh]
            assert all(item.mesh != mesh for item in self.instances.values()), "removed although it is shown"

    def cancel(self) -> None:
        try:
            self.scene.commit(progress=lambda done: False)
            self.features.add(("too quick to cancel",))
        except perfect_bvh.Cancelled:
            self.features.add(("cancelled",))

    def is_taken(self, edit: Callable[[], None]) -> bool:
        """Whether the engine takes it; a refusal must name the function."""
        try:
            edit()
        except ValueError as refusal:
            self.features.add(("refused", kind_of(str(refusal))))
            return False
        return True

    # Checking --------------------------------------------------------------------------------------------------------

    def commit(self) -> None:
        report = self.scene.commit()
        for mesh in report.meshes:
            self.features.add((mesh.action, mesh.builder, kind_of(mesh.reason)))
        top = report.top_level
        self.features.add(("top", top.builder, kind_of(top.reason), str(report.baked_count > 0)))
        assert (self.scene.mesh_count, self.scene.instance_count) == (len(self.meshes), len(self.instances))
        self.check()

    def check(self) -> None:
        fresh, rows = self.fresh()
        rays = self.rays()
        mask = self.random.integers(1, 4, RAYS)
        hits = self.scene.cast_rays(*rays, mask=mask, audit=1.0)
        assert hits.audit.wrong_rows.size == 0, str(hits.audit)
        expected = fresh.cast_rays(*rays, mask=mask)
        for name in BITS:
            assert getattr(hits, name).tobytes() == getattr(expected, name).tobytes(), name
        assert np.array_equal(_renamed(hits.instance_ids, rows), expected.instance_ids)
        assert np.array_equal(self.scene.test_occlusions(*rays, mask=mask), hits.is_hit)
        self.features.add(("hit", str(bool(hits.is_hit.any()))))

    def fresh(self) -> tuple[perfect_bvh.Scene, dict[int, int]]:
        """A scene filled from the model alone, and its instance ids by those of the edited scene."""
        scene, rows = perfect_bvh.Scene(), {}
        meshes = {ident: scene.add_mesh(*mesh) for ident, mesh in self.meshes.items()}
        for ident, item in self.instances.items():
            rows[ident] = scene.add_instance(meshes[item.mesh], item.transform, item.mask, item.order)
        scene.commit()
        return scene, rows

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Towards one of the instances: they differ in size by more than any ray could take in."""
        shown = [item for item in self.instances.values() if len(self.meshes[item.mesh][1])]
        if not shown:
            return np.zeros((RAYS, 3)), np.ones((RAYS, 3))
        item = shown[int(self.random.integers(len(shown)))]
        mesh = self.meshes[item.mesh]
        corners = mesh[0].astype(np.float64)[mesh[1]] @ item.transform[:3, :3].T + item.transform[:3, 3]
        points, triangles = loose(corners)
        return rays_around((Body("World", points, triangles),), RAYS, int(self.random.integers(1 << 30)))


def _renamed(ids: np.ndarray, rows: dict[int, int]) -> np.ndarray:
    return np.array([rows.get(ident, -1) for ident in ids.tolist()], np.int32)


EDITS: tuple[Callable[[Play], None], ...] = (
    Play.add_mesh,
    Play.commit,
    Play.deform,
    Play.replace,
    Play.add_instance,
    Play.move,
    Play.mask,
    Play.remove_instance,
    Play.remove_mesh,
    Play.cancel,
    Play.commit,
    Play.deform,
)


def edit_scenes(data: bytes) -> Features:
    """Edits and queries one scene. Returns the observed behaviour."""
    return Play(data).run()
