"""Legacy particle hair of a scene as curves: the read data, the hits of rays, and answers that are never old."""

from __future__ import annotations

from typing import Any

import bmesh
import bpy
import numpy as np
import pytest
from blender.builders import (
    evaluated,
    in_render,
)
from blender.particle_hair import (
    BENT,
    CHILDREN,
    COUNT,
    asked_of_blender,
    emitter,
    expected_strands,
    hair_of,
    kind_settings,
)
from oracles.cycles import preserved, render_cycles, render_passes
from perfect_bvh_addon.extract import read_scene, strand_cache
from perfect_bvh_addon.extract.geometry.particle_hair import ParticleHair, particle_hair_of, read_particle_hair
from perfect_bvh_addon.extract.geometry.particle_roots import Roots, find_roots
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.extract.strand_cache import CHILD_VERDICT, VERDICT, read_strands
from perfect_bvh_addon.sync.records import LayerRequest


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
    assert reader.verdicts.get(VERDICT if children == "NONE" else CHILD_VERDICT) == (True if use_views else None)


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
    assert [fast.verdicts[verdict] for verdict in (VERDICT, CHILD_VERDICT) if verdict in fast.verdicts] == [True]
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
        theirs, ours = render_cycles(scene), render_passes(scene, "PERFECT_BVH")
    seen = theirs.object_index == 3
    assert seen.mean() > 0.02
    assert ((ours.object_index == 3) != seen).mean() < 0.01
    both = seen & (ours.object_index == 3)
    depth = np.abs(ours.depth - theirs.depth)[both]
    assert np.quantile(depth, 0.95) < 1e-3 and np.median(depth) < 2e-4


def test_radii_are_those_of_the_settings(scene: Any) -> None:
    """Computed with the lengths of Blender's own strands."""
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
    """The faces are squares, a triangle and a hexagon, with two maps; the second map is active."""
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
    """Make two triangles of the first square, and a hexagon of two other squares."""
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


def test_memory_of_another_layout_is_not_read(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fields around the pointers show the difference; then Blender is asked point by point."""
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
    assert not any(verdict in reader.verdicts for verdict in (VERDICT, CHILD_VERDICT))
    np.testing.assert_array_equal(mesh.positions, expected.positions)
