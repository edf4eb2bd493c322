"""Random edits in any order, with few rays between commits: answers are those of a scene that is filled at once.

Meshes of every kind are added, moved, moved within the shutter, replaced, hidden, left at rest and removed. Between
commits rays reach a part of the scene, or nothing: no tree may depend on having been traced or refitted before. A fresh
scene judges bit by bit, and the audit goes through all triangles in double precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from engine.calibrations import MACHINE
from perfect_bvh import BuildConfig, Scene
from perfect_bvh._tuning import POLICIES, with_policy

KINDS = ("triangles", "curves", "ribbons", "points")
FIELDS = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals", "positions")
BUILDERS = ("auto", "auto", "auto", "sweep", "spatial", "fast")
SPANS = ((0.0, 1.0), (0.25, 0.75), (-1.0, 0.5), (-2.0, -1.0))
EXPECTED = (None, 0, 1_000, 10**6, 10**9)
EDITS, COMPARED, RAYS = 120, 12, 300  # edits in all, and from one comparison to the next
ALL = 0xFFFFFFFF


@dataclass
class Body:
    """A mesh as the scene should hold it: positions (S, N, 3) and radii (S, N) at each step of its motion."""

    kind: str
    positions: np.ndarray
    radii: np.ndarray
    division: np.ndarray  # triangles, or offsets of curves
    builder: str
    span: tuple[float, float] = (0.0, 1.0)

    def add(self, scene: Scene, usage: str) -> int:
        how = {"usage": usage, "build": "auto" if self.builder == "auto" else BuildConfig(builder=self.builder)}
        first, radii = self.positions[0], self.radii[0]
        if self.kind == "triangles":
            return scene.add_mesh(first, self.division, **how)
        if self.kind == "points":
            return scene.add_points(first, radii, **how)
        return scene.add_curves(first, radii, self.division, shape=self.shape, **how)

    def update(self, scene: Scene, mesh: int) -> None:
        """Brings the scene's mesh to the only step, which ends a motion."""
        first, radii = self.positions[0], self.radii[0]
        if self.kind == "triangles":
            scene.update_mesh(mesh, first)
        elif self.kind == "points":
            scene.update_points(mesh, first, radii)
        else:
            scene.update_curves(mesh, first, radii)

    def move(self, scene: Scene, mesh: int) -> None:
        """Brings the scene's mesh to all steps; a motion of one step does not move."""
        if self.kind == "triangles":
            scene.set_mesh_motion(mesh, self.positions, self.span)
        elif self.kind == "points":
            scene.set_points_motion(mesh, self.positions, self.radii, self.span)
        else:
            scene.set_curves_motion(mesh, self.positions, self.radii, self.span)

    def replace(self, scene: Scene, mesh: int) -> None:
        first, radii = self.positions[0], self.radii[0]
        if self.kind == "triangles":
            scene.replace_mesh(mesh, first, self.division)
        elif self.kind == "points":
            scene.replace_points(mesh, first, radii)
        else:
            scene.replace_curves(mesh, first, radii, self.division, shape=self.shape)

    @property
    def shape(self) -> str:
        return "ribbon" if self.kind == "ribbons" else "round"


@dataclass
class Placed:
    mesh: int
    transforms: np.ndarray  # (S, 4, 4)
    mask: int
    span: tuple[float, float] = (0.0, 1.0)


@dataclass
class Play:
    """A scene under edits, and its expected content."""

    policy: str
    seed: int
    bodies: dict[int, Body] = field(default_factory=dict)
    placed: dict[int, Placed] = field(default_factory=dict)
    actions: set[str] = field(default_factory=set)
    hit_count: int = 0

    def __post_init__(self) -> None:
        self.random = np.random.default_rng([self.seed, POLICIES.index(self.policy)])
        self.scene = with_policy(Scene(calibration=MACHINE), self.policy)

    def run(self) -> None:
        edits: tuple[Callable[[], Any], ...] = (
            *(self.add, self.place, self.remove, self.change, self.carry, self.hide),
            *(self.move, self.move, self.move, self.replace, self.replace_and_move),
        )
        for kind in KINDS:
            self.add(kind)
        for number in range(EDITS):
            self.pick(edits)()
            if self.random.random() < 0.5:
                self.commit()
            if number % COMPARED == COMPARED - 1:
                self.commit()
                self.compare()

    # Choices

    def pick(self, values: Any) -> Any:
        return values[self.random.integers(len(values))]

    def pick_mesh(self) -> int:
        """The newest one more often than others: little has happened to it."""
        meshes = list(self.bodies)
        return int(self.pick((*meshes, *meshes[-1:] * len(meshes))))

    def transforms(self, steps: int) -> np.ndarray:
        matrices = np.tile(np.eye(4), (steps, 1, 1))
        matrices[:, :3, :3] += self.random.normal(0.0, 0.15, (3, 3))
        matrices[:, :3, 3] = self.random.normal(0.0, 0.7, (steps, 3))
        if self.random.random() < 0.2:
            matrices[:, :3, 0] *= -1.0
        if steps == 1 and self.random.random() < 0.1:
            matrices[:, 2, :3] = 0.0  # flat
        return matrices

    def body(self, kind: str, builder: str, dtype: Any) -> Body:
        count = int(self.pick((0, 1, 3, 30, 30, 120)))
        if kind == "triangles":
            corners = self.random.uniform(-1.0, 1.0, (count, 1, 3)) + self.random.normal(0.0, 0.3, (count, 3, 3))
            positions, division = corners.reshape(1, -1, 3), np.arange(3 * count).reshape(-1, 3)
        elif kind == "points":
            positions, division = self.random.uniform(-1.0, 1.0, (1, count, 3)), np.empty(0, np.int64)
        else:
            steps = np.cumsum(self.random.normal(0.0, 0.25, (count, 5, 3)), axis=1)
            positions = (self.random.uniform(-1.0, 1.0, (count, 1, 3)) + steps).reshape(1, -1, 3)
            division = np.arange(0, 5 * count + 1, 5)
        radii = self.random.uniform(0.02, 0.1, positions.shape[:2])
        radii[:, ::7] = 0.0
        return Body(kind, positions.astype(dtype), radii.astype(dtype), division, builder)

    # Edits

    def add(self, kind: str = "") -> None:
        body = self.body(kind or self.pick(KINDS), self.pick(BUILDERS), self.pick((np.float32, np.float64)))
        mesh = body.add(self.scene, self.pick(("static", "deforming", "changing")))
        self.bodies[mesh] = body
        for _ in range(self.random.integers(1, 4)):
            self.place(mesh)

    def place(self, mesh: int | None = None) -> None:
        placed = Placed(self.pick_mesh() if mesh is None else mesh, self.transforms(1), self.pick((1, 2, ALL, ALL)))
        self.placed[self.scene.add_instance(placed.mesh, placed.transforms[0], placed.mask)] = placed

    def remove(self) -> None:
        """An instance, or a mesh with all its instances."""
        if len(self.placed) <= 6:
            return
        if self.random.random() < 0.7:
            ids = [self.pick(list(self.placed))]
            self.scene.remove_instances(ids)
        else:
            mesh = self.pick_mesh()
            ids = [number for number, placed in self.placed.items() if placed.mesh == mesh]
            self.scene.remove_instances(ids)
            self.scene.remove_mesh(mesh)
            del self.bodies[mesh]
        for number in ids:
            del self.placed[number]

    def change(self) -> None:
        self.scene.set_usage(self.pick_mesh(), self.pick(("static", "deforming", "changing")))

    def hide(self) -> None:
        """Hides an instance from some rays or from all, or shows it again."""
        number = self.pick(list(self.placed))
        self.placed[number].mask = self.pick((0, 1, 2, ALL))
        self.scene.set_masks([number], [self.placed[number].mask])

    def carry(self) -> None:
        """Another transform, or a motion."""
        number = self.pick(list(self.placed))
        placed = self.placed[number]
        placed.transforms, placed.span = self.transforms(int(self.pick((1, 2, 3)))), self.pick(SPANS)
        self.scene.set_instance_motion([number], placed.transforms[:, None], placed.span)

    def move(self) -> None:
        """Positions, and at times radii: of one step, or of a motion; a little, or far enough to spoil a tree."""
        mesh = self.pick_mesh()
        body = self.bodies[mesh]
        steps = 1 if body.builder == "spatial" else int(self.pick((1, 1, 2, 3)))
        drift = self.random.normal(0.0, self.pick((0.0, 0.02, 0.6)), (steps, *body.positions.shape[1:]))
        dtype, radii = body.positions.dtype, body.radii[:1]
        if self.random.random() < 0.3:
            radii = np.where(self.random.random(radii.shape) < 0.1, 0.0, self.random.uniform(0.02, 0.1, radii.shape))
        body.positions = (body.positions[:1] + np.cumsum(drift, axis=0)).astype(dtype)
        body.radii, body.span = np.tile(radii, (steps, 1)).astype(dtype), self.pick(SPANS)
        if body.builder == "spatial" or (steps == 1 and self.random.random() < 0.5):
            body.update(self.scene, mesh)
        else:
            body.move(self.scene, mesh)

    def replace(self) -> int:
        mesh = self.pick_mesh()
        body = self.bodies[mesh]
        self.bodies[mesh] = self.body(body.kind, body.builder, body.positions.dtype)
        self.bodies[mesh].replace(self.scene, mesh)
        return mesh

    def replace_and_move(self) -> None:
        """A motion of a mesh that never had a tree."""
        mesh = self.replace()
        body = self.bodies[mesh]
        if body.builder != "spatial":
            body.positions = np.concatenate([body.positions, body.positions + np.float32(0.5)])
            body.radii = np.tile(body.radii, (2, 1))
            body.move(self.scene, mesh)

    # Commits

    def commit(self) -> None:
        """Once, or again while all rest; then some rays at a corner of the scene or at some instances, or none."""
        for _ in range(self.pick((1, 1, 3))):
            report = self.scene.commit(self.pick(EXPECTED))
            self.actions.update(row.action for row in report.meshes)
            self.actions.update("rebuilt at rest" for row in report.meshes if " rest, and" in row.reason)
        if self.random.random() < 0.4:
            corner, directions = self.random.uniform(-1.0, 1.0, 3), self.random.normal(0.0, 0.1, (20, 3))
            self.scene.cast_rays(corner, directions, times=self.random.random(20), mask=self.pick((1, ALL)))

    def filled(self) -> tuple[Scene, dict[int, int]]:
        """A scene that holds the same and was never edited, and the ids of its instances."""
        scene = Scene(calibration=MACHINE)
        meshes = {}
        for number, body in self.bodies.items():
            meshes[number] = body.add(scene, "static")
            if len(body.positions) > 1:
                body.move(scene, meshes[number])
        ids = {}
        for number, placed in self.placed.items():
            ids[number] = scene.add_instance(meshes[placed.mesh], placed.transforms[0], placed.mask)
            if len(placed.transforms) > 1:
                scene.set_instance_motion([ids[number]], placed.transforms[:, None], placed.span)
        scene.commit()
        return scene, ids

    def compare(self) -> None:
        """Closest hits, all hits, their number and closest points, bit by bit."""
        fresh, ids = self.filled()
        back = np.full(max(ids.values()) + 2, -1, np.int32)
        back[list(ids.values())] = list(ids)
        origins = self.random.normal(0.0, 1.5, (RAYS, 3))
        directions = self.random.normal(0.0, 0.7, (RAYS, 3)) - origins
        times = np.float32(self.random.choice([0.0, 1.0, *self.random.random(6)], RAYS))
        rays = {"times": times, "mask": np.uint32(self.random.choice([1, 2, ALL], RAYS))}
        hits = self.scene.cast_rays(origins, directions, audit=1.0, fields=(*FIELDS, "instance_ids"), **rays)
        expected = fresh.cast_rays(origins, directions, fields=(*FIELDS, "instance_ids"), **rays)
        assert hits.audit is not None and hits.audit.wrong_rows.size == 0, str(hits.audit)
        assert_same(hits, expected, back)
        assert np.array_equal(self.scene.test_occlusions(origins, directions, **rays), expected.is_hit)
        listed, expected_list = (scene.list_intersections(origins, directions, **rays) for scene in (self.scene, fresh))
        assert np.array_equal(listed.ray_splits, expected_list.ray_splits)
        assert listed.hits.t_hit.tobytes() == expected_list.hits.t_hit.tobytes()
        near = {name: values[::8] for name, values in rays.items()}
        found, nearest = (scene.compute_closest_points(origins[::8], **near) for scene in (self.scene, fresh))
        assert found.distances.tobytes() == nearest.distances.tobytes()
        assert np.array_equal(found.instance_ids, back[nearest.instance_ids])
        self.hit_count += int(expected.is_hit.sum())


def assert_same(hits: perfect_bvh.Hits, expected: perfect_bvh.Hits, back: np.ndarray) -> None:
    for name in FIELDS:
        assert getattr(hits, name).tobytes() == getattr(expected, name).tobytes(), name
    assert np.array_equal(hits.instance_ids, back[expected.instance_ids])


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("policy", POLICIES)
def test_edits_in_any_order_give_the_answers_of_a_fresh_scene(policy: str, seed: int) -> None:
    play = Play(policy, seed)
    play.run()
    assert play.hit_count > EDITS / COMPARED * RAYS / 5
    followed = {
        "governed": {"refitted", "rebuilt at rest"},
        "refit": {"refitted"},
        "rotate": {"rotated"},
        "rebuild_parts": {"partly_rebuilt"},
        "rebuild": set(),
    }
    assert play.actions >= {"built", "rebuilt", *followed[policy]}
