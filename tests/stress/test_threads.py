"""Threads trace snapshots while others edit, commit and cancel: every answer is right for the snapshot it came from.

And edits without end do not need ever more memory.
"""

from __future__ import annotations

import gc
import threading
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import perfect_bvh
from forks import needs_fork, run_in_child
from oracles import meshes
from process_memory import held_megabytes

SECONDS = 5.0
PATIENCE = 60.0  # for the scene to be committed in the end
KEPT = 6
RAYS = 60
ANSWER = ("t_hit", "instance_ids", "primitive_ids")


class EditedScene:
    """A scene that one thread edits without end, and its last few snapshots, which any thread may trace."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.scene = perfect_bvh.Scene()
        self.shapes = [meshes.sphere(8, 10, 0.7), meshes.soup(80, seed, 0.2), meshes.slivers(60, seed)]
        usages = ("deforming", "changing", "static")
        self.meshes = [
            self.scene.add_mesh(points.astype(np.float32), triangles, usage=usage)
            for (points, triangles), usage in zip(self.shapes, usages, strict=True)
        ]
        self.instances = self.scene.add_instances(self.random.choice(self.meshes, 12), self._places(12)).tolist()
        self.snapshots: deque[perfect_bvh.Snapshot] = deque(maxlen=KEPT)
        self.commits = 0
        self.rings = 100  # of a sphere whose build is slow enough to cancel a commit
        self.scene.commit()
        self.snapshots.append(self.scene.snapshot())

    def _places(self, count: int) -> np.ndarray:
        places = np.tile(np.eye(4), (count, 1, 1))
        places[:, :3, :3] += self.random.normal(0.0, 0.3, (count, 3, 3))
        places[:, :3, 3] = self.random.uniform(-2.0, 2.0, (count, 3))
        return places

    def edit(self) -> None:
        """One edit of each kind, at random, then a commit; now and then one is cancelled before."""
        row = int(self.random.integers(len(self.meshes)))
        points, triangles = self.shapes[row]
        if self.random.random() < 0.7:
            moved = points + self.random.normal(0.0, 0.1, points.shape)
            self.scene.update_mesh(self.meshes[row], moved.astype(np.float32))
        else:
            kept = triangles[self.random.random(len(triangles)) < 0.9]
            self.scene.replace_mesh(self.meshes[row], points.astype(np.float32), kept)
            self.shapes[row] = points, kept
        chosen = self.random.choice(self.instances, 4, replace=False)
        self.scene.set_transforms(chosen, self._places(4))
        self.scene.set_masks(chosen, self.random.integers(1, 4, 4))
        self.scene.remove_instances([self.instances.pop(0)])
        self.instances += self.scene.add_instances([self.meshes[row]], self._places(1)).tolist()
        self.commit()

    def commit(self) -> None:
        if self.commits % 10 == 1:
            self.cancel()
        self.scene.commit()
        self.commits += 1
        self.snapshots.append(self.scene.snapshot())

    def cancel(self) -> None:
        """A commit that is called off in the middle of a large mesh, which is then taken away again."""
        was_cancelled = False
        while not was_cancelled:
            build = perfect_bvh.BuildConfig(builder="spatial")
            mesh = self.scene.add_mesh(*meshes.sphere(self.rings, self.rings), build=build)
            instance = self.scene.add_instance(mesh, mask=0)
            try:
                self.scene.commit(progress=lambda done: False)
                self.rings *= 3  # this machine is quick
            except perfect_bvh.Cancelled:
                was_cancelled = True
            self.scene.remove_instances([instance])
            self.scene.remove_mesh(mesh)


class Witness:
    """Remembers the first answers of each snapshot, from any thread."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.answers: dict[tuple[int, int], bytes] = {}

    def hear(self, hits: perfect_bvh.Hits) -> None:
        said = b"".join(getattr(hits, name).tobytes() for name in ANSWER)
        with self.lock:
            before = self.answers.setdefault((hits.scene_id, hits.generation), said)
        assert before == said, f"generation {hits.generation} has changed its answer"


def trace(edited: list[EditedScene], witness: Witness, until: float, seed: int) -> None:
    """Any kept snapshot of any scene, again and again, and of each at least once; each answer is audited."""
    random, rays, asked = np.random.default_rng(seed), meshes.random_rays(RAYS, 3, 3.0), 0
    while time.monotonic() < until or asked < len(edited):
        row = asked if asked < len(edited) else random.integers(len(edited))
        snapshots = edited[row].snapshots
        snapshot = snapshots[int(random.integers(len(snapshots)))]
        hits = snapshot.cast_rays(*rays, fields=ANSWER, threads=int(random.integers(0, 3)), audit=1.0)
        assert hits.audit.wrong_rows.size == 0, f"generation {hits.generation}: {hits.audit}"
        assert (hits.generation, hits.scene_id) == (snapshot.generation, snapshot.scene_id)
        assert np.array_equal(snapshot.test_occlusions(*rays), hits.is_hit)
        witness.hear(hits)
        asked += 1


def ask_the_scene(edited: EditedScene, witness: Witness, until: float) -> None:
    """The scene itself: the answer of some committed state, or a refusal; at least one answer."""
    rays, answered = meshes.random_rays(RAYS, 3, 3.0), 0
    while time.monotonic() < until + (0.0 if answered else PATIENCE):
        try:
            witness.hear(edited.scene.cast_rays(*rays, fields=ANSWER))
            answered += 1
        except perfect_bvh.StaleSceneError:
            continue
    assert answered


def edit(edited: EditedScene, until: float) -> None:
    """Edits at least until a commit was cancelled; the second one is."""
    while time.monotonic() < until or edited.commits < 3:
        edited.edit()


def test_answers_are_those_of_their_snapshot_whatever_is_edited_meanwhile() -> None:
    edited, witness = [EditedScene(1), EditedScene(2)], Witness()
    until = time.monotonic() + SECONDS
    with ThreadPoolExecutor(max_workers=6) as pool:
        editors = [pool.submit(edit, scene, until) for scene in edited]
        tracers = [pool.submit(trace, edited, witness, until, seed) for seed in range(3)]
        asker = pool.submit(ask_the_scene, edited[0], witness, until)
        for task in (*editors, *tracers, asker):
            task.result()
    assert {scene for scene, _ in witness.answers} == {scene.scene.scene_id for scene in edited}


@needs_fork
def test_a_forked_process_traces_and_edits_what_it_inherited() -> None:
    edited, rays = EditedScene(6), meshes.random_rays(RAYS, 3, 3.0)
    expected = edited.snapshots[0].cast_rays(*rays, threads=2)

    def work() -> bool:
        same = np.array_equal(edited.snapshots[0].cast_rays(*rays, threads=2).t_hit, expected.t_hit)
        edited.edit()
        audit = edited.snapshots[-1].cast_rays(*rays, threads=2, audit=1.0).audit
        return same and audit.wrong_rows.size == 0

    assert run_in_child(work) == 0
    assert np.array_equal(edited.snapshots[0].cast_rays(*rays, threads=2).t_hit, expected.t_hit)


def test_memory_is_flat_over_edits_and_snapshots() -> None:
    edited, rays = EditedScene(5), meshes.random_rays(RAYS, 3, 3.0)
    laps: list[tuple[int, float]] = []

    def is_flat() -> bool:
        """Over three laps. Of the first laps buffers and thread pools are left, of each larger sphere larger ones."""
        return len(laps) > 5 and laps[-1][0] == laps[-4][0] and laps[-1][1] < laps[-4][1] + 0.25

    # A leak grows over any three laps; allocations by other threads of the process only over some.
    while not is_flat() and len(laps) < 30:
        for _ in range(60):
            edited.edit()
            edited.snapshots[0].cast_rays(*rays, threads=1)
        gc.collect()
        laps.append((edited.rings, held_megabytes()))
    assert is_flat(), laps
