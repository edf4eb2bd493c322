"""Old particle hair of a scene as curves: what is read, what rays meet, and that it is never old."""

from __future__ import annotations

from typing import Any

import bmesh
import bpy
import numpy as np
import pytest
from blender.builders import collection, collection_instance, evaluated, in_render, mesh_object
from blender.particle_hair import COUNT, add_hair, emitter, expected_strands
from oracles.cycles import preserved, render_cycles, render_passes
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import read_scene, strand_cache
from perfect_bvh_addon.extract.geometry.particle_hair import ParticleHair, particle_hair_of, read_particle_hair
from perfect_bvh_addon.extract.geometry.particle_roots import Roots, find_roots
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.extract.strand_cache import VERDICT, read_strands
from perfect_bvh_addon.sync.records import LayerRequest, MeshRecord, SceneRecord

CHILDREN = {"NONE": {}, "SIMPLE": {"rendered_child_count": 5}, "INTERPOLATED": {"rendered_child_count": 5}}
FIELDS = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals")
BENT = {"brownian_factor": 0.2, "clump_factor": 0.5}


def hair_of(record: SceneRecord) -> MeshRecord:
    (mesh,) = (mesh for mesh in record.meshes if mesh.kind == "curves")
    return mesh


def kind_settings(children: str) -> dict[str, Any]:
    return {"child_type": children, "child_percent": 4} | CHILDREN[children] | BENT


@pytest.mark.parametrize("use_views", [True, False])
@pytest.mark.parametrize("children", CHILDREN)
def test_strands_are_those_that_blender_tells(scene: Any, children: str, use_views: bool) -> None:
    obj = emitter(**kind_settings(children))
    obj.location, obj.rotation_euler, obj.scale = (5.0, -2.0, 1.0), (0.3, 0.2, 0.1), (2.0, 1.0, 0.5)
    depsgraph = evaluated()
    reader = ArrayReader(use_views)
    mesh = hair_of(read_scene(depsgraph, reader=reader))
    expected = expected_strands(obj, depsgraph)
    assert len(expected) == COUNT * (1 if children == "NONE" else 4)
    np.testing.assert_allclose(mesh.positions, expected.reshape(-1, 3), atol=2e-6)
    assert mesh.curve_offsets is not None
    assert mesh.curve_offsets.tolist() == list(range(0, len(expected) * 5 + 1, 5))
    assert (mesh.curve_kind, mesh.name, mesh.triangle_ids, mesh.dropped_triangles) == (
        "catmull_rom",
        "Emitter",
        None,
        0,
    )
    assert reader.verdicts.get(VERDICT) == (True if use_views else None)


KINDS_OF_STRANDS: dict[str, dict[str, Any]] = {
    "spiral": {"kink": "SPIRAL", "kink_extra_steps": 3, "child_type": "SIMPLE"},
    "cut": {"child_type": "INTERPOLATED", "child_length": 0.4, "child_length_threshold": 0.5},
    "none of some": {"child_type": "INTERPOLATED", "child_length": 0.0, "child_length_threshold": 0.5},
    "shorter": {"path_end": 0.6},
    "by chance": {"child_type": "INTERPOLATED", "roughness_endpoint": 0.3, "length_random": 0.8},
    "splines": {"use_hair_bspline": True},
    "parents, too": {"child_type": "SIMPLE", "use_parent_particles": True},
    "virtual parents": {"child_type": "INTERPOLATED", "virtual_parents": 0.5, "clump_factor": 0.5},
    "many": {"child_type": "SIMPLE", "child_percent": 100, "count": 60},
    "from volume": {"emit_from": "VOLUME"},
}


@pytest.mark.parametrize("name", KINDS_OF_STRANDS)
def test_both_ways_of_reading_agree(scene: Any, name: str) -> None:
    emitter(**KINDS_OF_STRANDS[name])
    depsgraph, fast = evaluated(), ArrayReader()
    mesh = hair_of(read_scene(depsgraph, reader=fast))
    assert fast.verdicts[VERDICT]
    slow = hair_of(read_scene(depsgraph, reader=ArrayReader(use_views=False)))
    np.testing.assert_allclose(mesh.positions, slow.positions, atol=1e-5)
    assert mesh.curve_offsets is not None
    np.testing.assert_array_equal(mesh.curve_offsets, slow.curve_offsets)
    np.testing.assert_allclose(mesh.radii, slow.radii, atol=1e-5)


@pytest.mark.parametrize("children", CHILDREN)
def test_depth_and_index_are_those_of_cycles(scene: Any, registered: None, children: str) -> None:
    obj = emitter(**kind_settings(children))
    obj.rotation_euler, obj.pass_index = (0.3, 0.2, 0.1), 3
    obj.show_instancer_for_render = obj.show_instancer_for_viewport = False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (1.5, 1.5, 7.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.perfect_bvh.samples = 1
    with preserved((scene.cycles_curves, "shape", "THICK")):
        theirs = render_cycles(scene)
    ours = render_passes(scene, "PERFECT_BVH")
    seen = theirs.object_index == 3
    assert seen.mean() > 0.02
    assert ((ours.object_index == 3) != seen).mean() < 0.01
    both = seen & (ours.object_index == 3)
    depth = np.abs(ours.depth - theirs.depth)[both]
    assert np.quantile(depth, 0.95) < 1e-3 and np.median(depth) < 2e-4


def test_radii_are_those_of_the_settings(scene: Any) -> None:
    """By the lengths of Blender's own strands."""
    obj = emitter(radius_scale=0.4, root_radius=0.5, tip_radius=0.1, **BENT)
    settings = obj.particle_systems[0].settings
    for shape, use_close_tip in ((0.0, False), (0.5, False), (-0.7, True), (0.0, True)):
        settings.shape, settings.use_close_tip = shape, use_close_tip
        depsgraph = evaluated()
        radii = hair_of(read_scene(depsgraph)).radii
        strands = expected_strands(obj, depsgraph)
        lengths = np.cumsum(np.linalg.norm(np.diff(strands, axis=1), axis=2), axis=1)
        rest = 1.0 - np.insert(lengths, 0, 0.0, axis=1) / lengths[:, -1:]
        rest = np.clip(rest, 0.0, 1.0) ** (1.0 + shape if shape < 0.0 else 1.0 / (1.0 - shape))
        expected = rest * (0.1 - 0.02) + 0.02
        if use_close_tip:
            expected[:, -1] = 0.0
        assert radii is not None
        np.testing.assert_allclose(radii.reshape(expected.shape), expected, atol=2e-4 if shape < 0 else 2e-6)


@pytest.mark.parametrize("use_views", [True, False])
@pytest.mark.parametrize("emit_from", ["FACE", "VERT"])
@pytest.mark.parametrize("children", CHILDREN)
def test_uvs_are_those_at_the_root(scene: Any, children: str, emit_from: str, use_views: bool) -> None:
    """Of squares, a triangle and a hexagon, with two maps; the other one is active."""
    obj = emitter(**kind_settings(children), emit_from=emit_from)
    cut(obj.data)
    other = obj.data.uv_layers.new(name="Other")
    random = np.random.default_rng(1)
    other.uv.foreach_set("vector", random.random(2 * len(obj.data.loops)).astype(np.float32))
    other.active_render = True
    colors = obj.data.attributes.new("Paint", "BYTE_COLOR", "CORNER")
    colors.data.foreach_set("color_srgb", random.random(4 * len(obj.data.loops)).astype(np.float32))
    depsgraph = evaluated()
    wanted = LayerRequest(frozenset(["", "UVMap", "lacking"]), frozenset(["UVMap", "Paint"]))
    shown = obj.evaluated_get(depsgraph)
    hair = particle_hair_of(shown, for_render=False)
    assert hair is not None
    mesh = read_particle_hair(hair, None, "hair", wanted, ArrayReader(use_views))
    assert mesh is not None and mesh.corner_uvs is not None
    if use_views:
        assert find_roots_of(hair).faces is not None
    found = {1: mesh.corner_uvs, 0: mesh.named_uvs["UVMap"]}
    for number, uvs in found.items():
        expected = asked_of_blender(shown, "uv_on_emitter", number, len(uvs))
        np.testing.assert_allclose(uvs, expected, atol=1e-5)
        assert np.ptp(expected, axis=0).min() > 0.3
    np.testing.assert_array_equal(mesh.named_colors["UVMap"][:, :2], mesh.named_uvs["UVMap"])
    encoded = asked_of_blender(shown, "mcol_on_emitter", 0, mesh.part_count).astype(np.float64)
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert np.abs(mesh.named_colors["Paint"] - linear).max() < 0.01
    assert "lacking" not in mesh.named_uvs


def cut(data: Any) -> None:
    """Of the first squares a triangle and, of two, a hexagon."""
    made = bmesh.new()
    made.from_mesh(data)
    made.faces.ensure_lookup_table()
    bmesh.ops.triangulate(made, faces=made.faces[:1])
    made.faces.ensure_lookup_table()
    bmesh.ops.dissolve_faces(made, faces=[face for face in made.faces if len(face.verts) == 4][-2:])
    assert sorted({len(face.verts) for face in made.faces}) == [3, 4, 6]
    made.to_mesh(data)
    made.free()


def find_roots_of(hair: ParticleHair) -> Roots:
    (modifier, system), reader = hair.systems[0], ArrayReader()
    strands = read_strands(system, hair.obj, reader, hair.for_render)
    return find_roots(system, modifier, hair.obj.data, strands.first, len(strands.points), reader)


def asked_of_blender(shown: Any, accessor: str, number: int, count: int) -> np.ndarray:
    system, modifier = shown.particle_systems[0], shown.modifiers[0]
    first = 0 if count == len(system.particles) else len(system.particles)
    layer = "uv_no" if accessor == "uv_on_emitter" else "vcol_no"
    ask = getattr(system, accessor)
    particles = system.particles
    return np.array(
        [
            ask(modifier, particle=particles[min(row, len(particles) - 1)], particle_no=first + row, **{layer: number})
            for row in range(count)
        ]
    )


def rays(count: int = 500) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(4)
    origins = random.normal(size=(count, 3)) * 2.0 + (1.5, 1.5, 6.0)
    return origins, random.uniform((0, 0, 0), (3, 3, 1), (count, 3)) - origins


def assert_as_fresh(sync: SceneSync) -> int:
    """By the bits, in what rays meet and of what material. How many rays meet hair."""
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


def test_renders_have_the_amount_of_renders(scene: Any) -> None:
    settings = emitter(**kind_settings("SIMPLE")).particle_systems[0].settings
    settings.display_percentage = 50
    shown = hair_of(read_scene(evaluated()))
    assert (shown.part_count, len(shown.positions)) == (2 * COUNT, 2 * COUNT * 5)
    rendered = in_render(lambda depsgraph: hair_of(read_scene(depsgraph)))
    assert (rendered.part_count, len(rendered.positions)) == (5 * COUNT, 5 * COUNT * 9)


def test_what_is_combed_is_named(scene: Any) -> None:
    obj = emitter()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    record = read_scene(evaluated())
    assert [mesh.kind for mesh in record.meshes] == ["triangles"]
    assert any("its particle hair is not shown in Edit" in str(told) for told in record.not_shown)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert hair_of(read_scene(evaluated())).part_count == COUNT


def test_verified_updates_find_nothing(scene: Any) -> None:
    """Whichever way strands are read."""
    obj = emitter(**kind_settings("INTERPOLATED"))
    obj.location, obj.rotation_euler = (300.0, 20.0, 0.0), (0.3, 0.2, 0.1)
    sync = SceneSync()
    assert sync.update(evaluated(), verify=True).mismatches == ()
    sync.close()


def test_memory_of_another_layout_is_not_read(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fields around the pointers say so; then Blender is asked point by point."""
    emitter(**kind_settings("SIMPLE"))
    expected = hair_of(read_scene(evaluated(), reader=ArrayReader(use_views=False)))
    fields = strand_cache._SYSTEM.fields
    assert fields is not None
    formats = [kind for kind, _ in fields.values()]
    moved = [offset + 8 * (name in {"paths", "child_paths", "children"}) for name, (_, offset) in fields.items()]
    other = np.dtype({"names": list(fields), "formats": formats, "offsets": moved, "itemsize": 352})
    monkeypatch.setattr(strand_cache, "_SYSTEM", other)
    reader = ArrayReader()
    mesh = hair_of(read_scene(evaluated(), reader=reader))
    assert reader.verdicts[VERDICT] is False
    np.testing.assert_array_equal(mesh.positions, expected.positions)


def test_frames_are_followed(scene: Any) -> None:
    """Of a surface that waves below the hair, and of settings that are animated."""
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
    """Random ones of particle hair, its emitter and its materials."""

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
    """Each synced scene is a fresh one."""
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
