"""Particle hair is never old: each edit of it, of its emitter and of its settings equals a fresh reading."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from blender.builders import (
    collection,
    collection_instance,
    evaluated,
    instances_on_grid,
    made_cube,
    mesh_object,
)
from blender.particle_hair import CHILDREN, COUNT, add_hair, emitter, hair_of, kind_settings
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.sync.plan import find_mismatches

FIELDS = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals")


def rays(count: int = 500) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(4)
    origins = random.normal(size=(count, 3)) * 2.0 + (1.5, 1.5, 6.0)
    return origins, random.uniform((0, 0, 0), (3, 3, 1), (count, 3)) - origins


def assert_as_fresh(sync: SceneSync) -> int:
    """Compare hits and their materials with a fresh sync, bit by bit; return the number of rays that hit hair."""
    fresh = SceneSync(watch=False)
    try:
        fresh.update(evaluated())
        fields = (*FIELDS, "instance_ids", "mesh_ids")  # the last are each scene's own
        hits, expected = (one.scene.cast_rays(*rays(), fields=fields) for one in (sync, fresh))
        for field in FIELDS:
            assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field
        np.testing.assert_array_equal(sync.material_ids(hits), fresh.material_ids(expected))
        is_hair = np.array([mesh.kind == "curves" for mesh in fresh.record.meshes])
        ids = fresh.mesh_ids[is_hair]
        return int(np.isin(expected.mesh_ids, ids).sum())
    finally:
        fresh.close()


def actions(report: Any) -> dict[str, str]:
    return {mesh.kind: mesh.action for mesh in report.meshes}


def test_hair_is_kept_in_step(scene: Any) -> None:
    obj = emitter(**kind_settings("SIMPLE"))
    settings = obj.particle_systems[0].settings
    sync = SceneSync()
    assert actions(sync.update(evaluated())) == {"triangles": "added", "curves": "added"}
    assert assert_as_fresh(sync) > 20
    report = sync.update(evaluated())
    assert [mesh.reason for mesh in report.meshes] == ["Blender did not evaluate it again"] * 2

    settings.hair_length = 0.7
    assert actions(sync.update(evaluated())) == {"triangles": "kept", "curves": "deformed"}
    assert assert_as_fresh(sync) > 20
    settings.radius_scale = 0.2
    assert actions(sync.update(evaluated()))["curves"] == "deformed"
    assert assert_as_fresh(sync) > 20
    settings.child_percent = 6
    report = sync.update(evaluated())
    assert actions(report) == {"triangles": "kept", "curves": "replaced"}
    assert [mesh.triangle_count for mesh in report.meshes if mesh.kind == "curves"] == [6 * COUNT]
    assert assert_as_fresh(sync) > 20
    obj.data.vertices[5].co.z += 0.5
    obj.data.update_tag()
    assert actions(sync.update(evaluated())) == {"triangles": "deformed", "curves": "deformed"}
    assert assert_as_fresh(sync) > 20
    settings.display_step = 4
    assert actions(sync.update(evaluated()))["curves"] == "replaced"
    assert assert_as_fresh(sync) > 20
    obj.modifiers[0].show_viewport = False
    assert sorted(mesh.action for mesh in sync.update(evaluated()).meshes) == ["kept", "removed"]
    assert assert_as_fresh(sync) == 0
    sync.close()


def test_objects_that_move_take_their_hair_along(scene: Any) -> None:
    obj = emitter()
    sync = SceneSync()
    sync.update(evaluated())
    obj.location.z = 0.5
    report = sync.update(evaluated())
    assert report.moved_count == 2
    assert_as_fresh(sync)
    obj.show_instancer_for_viewport = False
    sync.update(evaluated())
    assert [mesh.kind for mesh in sync.record.meshes] == ["curves"]
    assert assert_as_fresh(sync) > 10
    sync.close()


def test_each_system_has_its_material(scene: Any) -> None:
    obj = emitter()
    other = add_hair(obj, hair_length=0.5)
    for name in ("Skin", "Hair"):
        obj.data.materials.append(bpy.data.materials.new(name))
    sync = SceneSync()
    for slot, expected in ((2, [0] * COUNT + [1] * COUNT), (1, [0] * 2 * COUNT), (2, [0] * COUNT + [1] * COUNT)):
        other.material = slot
        sync.update(evaluated())
        slots = hair_of(sync.record).material_slots
        assert slots is not None and slots.tolist() == expected
        assert assert_as_fresh(sync) > 20
        hits = sync.scene.cast_rays(*rays(), fields=(*FIELDS, "instance_ids", "mesh_ids"))
        is_hair = hits.mesh_ids == sync.mesh_ids[[mesh.kind == "curves" for mesh in sync.record.meshes]]
        assert is_hair.any()
        names = sync.material_names[sync.material_ids(hits)[is_hair]]
        assert names.tolist() == [("Skin", "Hair")[expected[curve]] for curve in hits.primitive_ids[is_hair]]
    sync.close()


def test_instances_share_the_strands(scene: Any) -> None:
    held = collection("Fur", linked=False)
    obj = emitter()
    scene.collection.objects.unlink(obj)
    held.objects.link(obj)
    for x in range(3):
        collection_instance(f"there {x}", held, location=(0.0, 4.0 * x, 0.0))
    record = read_scene(evaluated())
    assert len(record.meshes) == 2 and len(record.instances) == 6
    sync = SceneSync()
    sync.update(evaluated())
    assert assert_as_fresh(sync) > 10
    sync.close()


def test_hair_beside_instances_of_nodes(scene: Any) -> None:
    """Instances are read as arrays, objects with particles from Blender's list; the order is the same either way."""
    obj = emitter()
    instances_on_grid("grid", made_cube)
    mesh_object("z last")
    records = [read_scene(evaluated(), reader=ArrayReader(use_views)) for use_views in (True, False)]
    for record in records:
        assert sorted(mesh.kind for mesh in record.meshes) == ["curves", "triangles", "triangles", "triangles"]
        hair = record.meshes.index(hair_of(record))
        (row,) = np.flatnonzero(record.instances.mesh_indices == hair)
        assert record.objects[record.instances.object_indices[row]].name == obj.name
        assert record.instances.parent_indices[row] == -1
    assert find_mismatches(*records) == ()
    sync = SceneSync()
    sync.update(evaluated())
    obj.location.z = 0.3
    sync.update(evaluated())
    assert assert_as_fresh(sync) > 10
    sync.close()


def test_verified_updates_find_nothing(scene: Any) -> None:
    """This holds for both ways of reading strands."""
    obj = emitter(**kind_settings("INTERPOLATED"))
    obj.location, obj.rotation_euler = (300.0, 20.0, 0.0), (0.3, 0.2, 0.1)
    sync = SceneSync()
    assert sync.update(evaluated(), verify=True).mismatches == ()
    sync.close()


def test_verify_finds_other_radii_far_away(scene: Any) -> None:
    """Positions are known only to a hundredth there."""
    obj = emitter(**kind_settings("INTERPOLATED"))
    obj.location = (1000.0, 20.0, 0.0)
    record = read_scene(evaluated())
    assert hair_of(record).rounding > 0.01
    assert find_mismatches(record, read_scene(evaluated(), reader=ArrayReader(use_views=False))) == ()
    obj.particle_systems[0].settings.radius_scale *= 1.1
    assert find_mismatches(record, read_scene(evaluated())) == ("mesh Emitter: radii differ",)


def test_frames_are_followed(scene: Any) -> None:
    """The surface below the hair waves, or the settings are animated."""
    obj = emitter(**kind_settings("SIMPLE"))
    wave = obj.modifiers.new("wave", "WAVE")
    wave.height, wave.start_position_x = 0.4, 1.5
    obj.modifiers.move(1, 0)
    settings = obj.particle_systems[0].settings
    settings.keyframe_insert("brownian_factor", frame=4)
    settings.brownian_factor = 0.6
    settings.keyframe_insert("brownian_factor", frame=8)
    sync = SceneSync()
    sync.update(evaluated())
    for frame, moves in ((2, True), (3, True), (6, True), (8, True), (8, False)):
        scene.frame_set(frame)
        report = sync.update(evaluated())
        assert (actions(report)["curves"] == "deformed") == moves, frame
        assert assert_as_fresh(sync) > 20
    sync.close()


class Edits:
    """Random edits of particle hair, its emitter and its materials."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._obj = emitter(**kind_settings("SIMPLE"))
        for name in ("Skin", "Hair"):
            self._obj.data.materials.append(bpy.data.materials.new(name))
        self._all = (
            self.number,
            self.comb,
            self.radius,
            self.kind,
            self.bend,
            self.turn,
            self.hide,
            self.show,
            self.slot,
        )

    def make(self) -> None:
        for edit in self._random.choice(np.array(self._all, object), self._random.integers(1, 3)):
            edit()

    @property
    def _settings(self) -> Any:
        return self._obj.particle_systems[0].settings

    def number(self) -> None:
        if self._random.random() < 0.5:
            self._settings.count = int(self._random.integers(1, 40))
        else:
            self._settings.child_percent = int(self._random.integers(0, 6))

    def comb(self) -> None:
        self._settings.brownian_factor = self._random.uniform(0.0, 0.3)
        self._obj.particle_systems[0].seed = int(self._random.integers(0, 9))

    def radius(self) -> None:
        self._settings.root_radius, self._settings.shape = (
            self._random.uniform(0.2, 1.0),
            self._random.uniform(-0.9, 0.9),
        )
        self._settings.use_close_tip = bool(self._random.integers(0, 2))

    def kind(self) -> None:
        self._settings.child_type = str(self._random.choice(list(CHILDREN)))

    def bend(self) -> None:
        self._obj.data.vertices[int(self._random.integers(0, 16))].co.z = self._random.uniform(-0.5, 0.5)
        self._obj.data.update_tag()

    def turn(self) -> None:
        self._obj.rotation_euler, self._obj.location = self._random.uniform(-0.3, 0.3, (2, 3)).tolist()

    def hide(self) -> None:
        modifier = self._obj.modifiers[0]
        modifier.show_viewport = not modifier.show_viewport

    def show(self) -> None:
        self._obj.show_instancer_for_viewport = not self._obj.show_instancer_for_viewport

    def slot(self) -> None:
        self._settings.material = int(self._random.integers(1, 3))


def test_random_edits(scene: Any) -> None:
    """Each synced scene equals a fresh one."""
    edits = Edits(np.random.default_rng(8))
    mesh_object("Mesh", location=(0.0, 0.0, -2.0))
    sync = SceneSync()
    sync.update(evaluated())
    hit = 0
    for _ in range(30):
        edits.make()
        sync.update(evaluated())
        hit += assert_as_fresh(sync)
    assert hit > 400
    sync.close()
