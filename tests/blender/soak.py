"""Random edits of a scene. After each edit a proof shows that the synced scene equals Blender's.

A `Soak` edits a small scene that holds objects of every kind: plain, linked and modified meshes, text, curves, nodes,
collection instances, keyframes. `step()` edits, syncs, and compares the record with a reading that uses no cache, no
view and no bulk path. It compares every ray with a scene that is built from that reading alone. Now and then the file
is saved and opened, and the add-on's engine renders, is stopped and renders again. The same seed makes the same edits.
`soak_run.py` runs many steps of it.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from typing import Any, Literal

import bpy
import numpy as np
import perfect_bvh
import perfect_bvh_addon
from blender.builders import (
    SQUARE,
    camera_object,
    collection,
    collection_instance,
    in_render,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
    object_info,
)
from blender.hair_and_points import cloud_data, hair_data, upright
from blender.soak_edits import EDITS, NothingToEditError
from blender.soak_halves import Halves
from blender.soak_renders import find_different_passes
from blender.soak_round_edits import fur_of_nodes
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.geometry import instancer_survey
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.sync.lookup import SceneLookup
from perfect_bvh_addon.sync.plan import find_mismatches
from perfect_bvh_addon.sync.records import AttributeRequest, ObjectRecord, SceneRecord
from perfect_bvh_addon.sync.state import SceneState

ALL_ATTRIBUTES = AttributeRequest(corner_normals=True, corner_uvs=True, shading=True)
# Content of the scene: only objects; also instances that can be read from their geometry; also any other instances.
Kind = Literal["objects", "geometry", "mixed"]
KINDS: tuple[Kind, ...] = ("objects", "geometry", "mixed")
FIELDS = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals")


class DifferenceError(AssertionError):
    """The synced scene differs from Blender's."""


class Soak:
    """One scene, one sync of its viewport and one of its renders.

    watches: whether Blender's handlers log the evaluated data; without them each update reads everything.
    halves: the share of the steps in which a third sync is updated in two halves, with edits between them.
    The add-on must not be registered. A soak with handlers registers it until `close()`, others only while rendering.
    """

    def __init__(self, seed: int, *, watches: bool, kind: Kind = "mixed", halves: float = 0.15) -> None:
        self.seed = seed
        self.kind: Kind = kind
        self._watches = watches
        self.done: list[str] = []
        self.counts: Counter[str] = Counter()
        self._random = np.random.default_rng(seed)
        self._made = 0
        self._folder = tempfile.TemporaryDirectory()
        self.path = f"{self._folder.name}/soak.blend"
        bpy.ops.wm.read_factory_settings(use_empty=True)
        if watches:
            perfect_bvh_addon.register()
        _fill(kind)
        bpy.ops.ed.undo_push(message="start")
        self.sync = SceneSync(ALL_ATTRIBUTES, watch=watches)
        self.render_sync = SceneSync(ALL_ATTRIBUTES, watch=False)
        self._objects: dict[SceneSync, tuple[ObjectRecord, ...]] = {}  # the last reading of each sync
        self.rays = _rays(self._random)
        self._halves = Halves(self, ALL_ATTRIBUTES, halves)

    def close(self) -> None:
        self._halves.close()
        self.sync.close()
        self.render_sync.close()
        perfect_bvh_addon.unregister()
        self._folder.cleanup()

    def step(self) -> None:
        """Make one or a few edits, then check the syncs. Raises DifferenceError."""
        for _ in range(self._random.choice((1, 1, 1, 2, 4))):
            self._halves.meddle()
            self._edit()
            self._halves.note_edit()
        self._halves.meddle()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        self._check(self.sync, depsgraph)
        self._halves.prove()
        if self._random.random() < 0.04:
            self.counts["render"] += 1
            in_render(lambda made: self._check(self.render_sync, made))
            self._halves.note_edit()  # after a render Blender evaluates the frame again, which restores keyed values
        if self._random.random() < 0.02:
            self.counts["render of the engine"] += 1
            self._render()
            self._halves.note_edit()

    def _render(self) -> None:
        perfect_bvh_addon.register()
        try:
            self._raise_if(find_different_passes(is_stopped_first=self.number() > 0))
        finally:
            if not self._watches:
                perfect_bvh_addon.unregister()

    def _edit(self) -> None:
        name = str(self._random.choice(tuple(EDITS)))
        try:
            EDITS[name](self)
        except (NothingToEditError, RuntimeError):  # an operator needs another context
            return
        finally:
            if bpy.context.mode != "OBJECT":
                bpy.ops.object.mode_set(mode="OBJECT")
        self.done.append(name)
        self.counts[name] += 1
        if name not in {"undo", "redo"}:  # Blender crashes if undo passes edits that were not pushed
            bpy.ops.ed.undo_push(message=name)

    def _check(self, sync: SceneSync, depsgraph: Any) -> None:
        report = sync.update(depsgraph)
        objects = sync.record.objects
        self.counts["read again"] += objects is self._objects.get(sync)
        self._objects[sync] = objects
        self.counts["meshes passed over"] += sum(mesh.reason.startswith("Blender did not") for mesh in report.meshes)
        self.counts["meshes"] += len(report.meshes)
        self._count_ways_of_reading(depsgraph)
        self._raise_if(self.find_differences(sync, depsgraph))

    def find_differences(self, sync: SceneSync, depsgraph: Any) -> list[str]:
        """List where the data or the answers of a sync differ from Blender's."""
        certain = read_scene(depsgraph, ALL_ATTRIBUTES, reader=ArrayReader(use_views=False))
        found = find_mismatches(sync.record, certain)
        if any(mesh.rounding for mesh in certain.meshes):  # strands: Blender gives them as rounded world coordinates
            self.counts["strands"] += 1
            certain = read_scene(depsgraph, ALL_ATTRIBUTES)
            found += find_mismatches(sync.record, certain)
        return [*found, *_different_answers(sync, certain, self.rays)]

    def _raise_if(self, found: list[str]) -> None:
        if found:
            raise DifferenceError(f"seed {self.seed}, after {len(self.done)} edits: {found}; last: {self.done[-8:]}")

    def _count_ways_of_reading(self, depsgraph: Any) -> None:
        """Count the instances that are read without Blender's list, and the objects that still need it."""
        surveyed = instancer_survey.survey(depsgraph)
        for _, found in [] if surveyed is None else surveyed.objects:
            if isinstance(found, instancer_survey.Instancer) and found.points is not None:
                self.counts["instances read from geometry"] += len(found.points.points)
            self.counts["objects looked up in the list"] += found is instancer_survey.LISTED

    # Candidates for edits ---------------------------------------------------------------------------------------------

    def number(self, low: float = -3.0, high: float = 3.0) -> float:
        return float(self._random.uniform(low, high))

    def vector(self, low: float = -3.0, high: float = 3.0) -> tuple[float, float, float]:
        return self.number(low, high), self.number(low, high), self.number(low, high)

    def pick(self, things: Any) -> Any:
        things = list(things)
        if not things:
            raise NothingToEditError
        return things[self._random.integers(len(things))]

    def an_object(self, kind: str | None = None) -> Any:
        return self.pick(obj for obj in bpy.data.objects if obj.type != "CAMERA" and kind in (None, obj.type))

    def name(self, kind: str) -> str:
        self._made += 1
        return f"{kind} {self._made}"


def _fill(kind: Kind) -> None:
    camera_object().location.z = 20.0
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 4
    mesh_object("box")
    shared = mesh_data("shared", *SQUARE)
    mesh_object("left", shared, location=(-3, 0, 0))
    mesh_object("right", shared, location=(3, 0, 0))
    mesh_object("smooth", location=(0, 3, 0)).modifiers.new("subsurf", "SUBSURF")
    if kind != "objects":
        instances_on_grid("field", made_cube, 3).location = (0, -8, 0)
        instances_on_grid("herd", object_info(bpy.data.objects["box"]), 3).location = (0, 8, 1)
    inner = collection("inner", linked=kind != "mixed")
    mesh_object("leaf", collection=inner)
    if kind == "mixed":
        collection_instance("tree", inner, location=(6, 6, 0))
    mesh_object("hair", hair_data("hair", upright(4)), location=(4, -3, 0))
    mesh_object("cloud", cloud_data("cloud", upright(3).reshape(-1, 3) * 2.0, 0.3), location=(-4, -5, 0))
    if kind == "mixed":
        mesh_object("mane", hair_data("mane", upright(3)), inner, (0, 1, 0))
        fur_of_nodes("fur").location = (-8, 0, 0)
    for kept in (inner, collection("drawer"), bpy.data.materials.new("red")):
        kept.use_fake_user = True  # edits look for them in saved files, too
    moving = mesh_object("moving", location=(-6, 5, 0))
    for frame, x in ((1, -6.0), (20, 6.0)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    shaped = mesh_object("shaped", location=(-6, -3, 0))
    shaped.shape_key_add(name="Basis")
    shaped.shape_key_add(name="tall").data[3].co.z = 3.0
    for frame, value in ((1, 0.0), (20, 1.0)):
        key = shaped.data.shape_keys.key_blocks["tall"]
        key.value = value
        key.keyframe_insert("value", frame=frame)


# Proof ---------------------------------------------------------------------------------------------------------------


def _rays(random: np.random.Generator, count: int = 1200) -> tuple[np.ndarray, np.ndarray]:
    """Return rays from above on a grid, and random rays in all directions."""
    x, y = np.meshgrid(np.linspace(-13, 13, 40), np.linspace(-13, 13, 40))
    above = np.stack([x.ravel(), y.ravel(), np.full(x.size, 30.0)], axis=1)
    around = random.uniform((-13, -13, -4), (13, 13, 8), (count, 3))
    directions = np.concatenate([np.broadcast_to([0.0, 0.0, -1.0], above.shape), random.normal(size=(count, 3))])
    return np.concatenate([above, around]), directions


def _different_answers(sync: SceneSync, certain: SceneRecord, rays: tuple[np.ndarray, np.ndarray]) -> list[str]:
    """Name the answers that differ from those of a new scene filled only from the certain record."""
    fresh = SceneState(perfect_bvh.Scene)
    fresh.update(certain)
    lookup = SceneLookup(certain, fresh.instance_ids, fresh.mesh_ids, fresh.scene.scene_id, fresh.mesh_generations)
    one, other = (scene.cast_rays(*rays, fields=FIELDS) for scene in (sync.scene, fresh.scene))
    names = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals")
    found = [name for name in names if not np.array_equal(getattr(one, name), getattr(other, name))]
    mine, theirs = sync.describe(one.instance_ids), lookup.describe(other.instance_ids)
    found += [name for name in mine._fields if not np.array_equal(getattr(mine, name), getattr(theirs, name))]
    if not np.array_equal(sync.polygon_ids(one), lookup.polygon_ids(other)):
        found.append("polygon_ids")
    seen, expected = (scene.cast_rays(*rays, mask=1) for scene in (sync.scene, fresh.scene))
    return found + ([] if np.array_equal(seen.t_hit, expected.t_hit) else ["t_hit of camera rays"])
