"""Odd legacy particle hair: layers that are added later, unexpected memory, and useless numbers."""

from __future__ import annotations

import ctypes
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import evaluated
from blender.particle_hair import COUNT, add_hair, asked_of_blender, emitter, hair_of, kind_settings
from perfect_bvh_addon.extract import read_scene, strand_cache
from perfect_bvh_addon.extract.geometry import particle_hair
from perfect_bvh_addon.extract.geometry.particle_hair import particle_hair_of, read_particle_hair
from perfect_bvh_addon.extract.geometry.particle_roots import find_roots, is_askable, sees_final_mesh
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.extract.strand_cache import CHILD_VERDICT, VERDICT, read_strands
from perfect_bvh_addon.sync.records import AttributeRequest, LayerRequest


@pytest.mark.parametrize("use_views", [True, False])
@pytest.mark.parametrize("count", [0, 1])
def test_maps_that_come_after_the_particles_are_missing(scene: Any, count: int, use_views: bool) -> None:
    """Blender keeps the mesh of the particles' modifier; a request for a map that is added later crashes Blender."""
    obj = emitter(**kind_settings("SIMPLE"))
    if count == 0:
        obj.data.uv_layers.remove(obj.data.uv_layers[0])
    nodes_after(obj, "Later")
    shown = obj.evaluated_get(evaluated())
    assert [layer.name for layer in shown.data.uv_layers] == ["UVMap", "Later"][1 - count :]
    hair = particle_hair_of(shown, for_render=False)
    assert hair is not None
    wanted = LayerRequest(frozenset(["UVMap", "Later"]), frozenset(["Later"]))
    mesh = read_particle_hair(hair, None, "hair", wanted, ArrayReader(use_views))
    assert mesh is not None
    assert sorted(mesh.named_uvs) == ["UVMap"][:count] and not mesh.named_colors
    if not count:  # Blender refuses requests for maps if there is none at all
        (modifier, system), reader = hair.systems[0], ArrayReader(use_views)
        roots = find_roots(system, modifier, shown.data, 0, COUNT, reader, frozenset([0]), is_final=False)
        assert roots.faces is None and roots.ask("uv_on_emitter", 0) is None
    if count:
        expected = asked_of_blender(shown, "uv_on_emitter", 0, mesh.part_count)
        np.testing.assert_array_equal(mesh.named_uvs["UVMap"], expected.astype(np.float32))


@pytest.mark.parametrize(
    ("before", "after", "is_final", "can_ask"),
    [
        ([], [], True, True),
        (["SUBSURF", "NODES"], ["WAVE"], True, True),
        ([], ["SUBSURF"], False, True),
        (["MIRROR"], ["NODES"], False, True),
        (["NODES"], ["SUBSURF"], False, False),
    ],
)
def test_layers_are_asked_for_that_particles_saw(
    scene: Any, before: list[str], after: list[str], is_final: bool, can_ask: bool
) -> None:
    """Modifiers that change the mesh later do not affect layers that the mesh had from the start."""
    obj = emitter()
    for kind in (*before, *after):
        obj.modifiers.new(kind, kind)
    obj.modifiers.move(0, len(before))
    shown = obj.evaluated_get(evaluated())
    hair = particle_hair_of(shown, for_render=False)
    assert hair is not None
    modifier, _ = hair.systems[0]
    assert sees_final_mesh(shown, modifier, for_render=False) == is_final
    assert is_askable(shown, modifier, False, "uv_layers", 0) == can_ask
    mesh = read_particle_hair(hair, None, "hair", LayerRequest(frozenset(["UVMap"])), ArrayReader())
    assert mesh is not None and ("UVMap" in mesh.named_uvs) == can_ask
    if can_ask:
        expected = asked_of_blender(shown, "uv_on_emitter", 0, mesh.part_count, modifier)
        np.testing.assert_allclose(mesh.named_uvs["UVMap"], expected, atol=1e-5)


def nodes_after(obj: Any, name: str) -> None:
    """Add a modifier that stores a map of this name on the corners of the mesh."""
    tree = bpy.data.node_groups.new("later", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    begin, end = (tree.nodes.new(f"NodeGroup{which}") for which in ("Input", "Output"))
    stored = tree.nodes.new("GeometryNodeStoreNamedAttribute")
    stored.data_type, stored.domain = "FLOAT2", "CORNER"
    stored.inputs["Name"].default_value = name
    tree.links.new(begin.outputs[0], stored.inputs["Geometry"])
    tree.links.new(stored.outputs["Geometry"], end.inputs[0])
    obj.modifiers.new("later", "NODES").node_group = tree


@pytest.mark.parametrize("use_views", [True, False])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 0.0), (0.0, 0.0, 0.0)])
def test_emitters_may_be_scaled_to_nothing(scene: Any, scale: tuple[float, float, float], use_views: bool) -> None:
    """Such a matrix has no inverse. Blender itself puts the strands into one point, where nothing is visible."""
    obj = emitter(**kind_settings("SIMPLE"))
    obj.location, obj.scale = (1.0, 2.0, 3.0), scale
    depsgraph, reader = evaluated(), ArrayReader(use_views)
    shown = obj.evaluated_get(depsgraph)
    told = [shown.particle_systems[0].co_hair(shown, particle_no=COUNT + 3, step=step) for step in range(5)]
    np.testing.assert_array_equal(told, [obj.location] * 5)
    record = read_scene(depsgraph, reader=reader)
    assert "curves" not in {mesh.kind for mesh in record.meshes} and not record.not_shown
    assert not reader.verdicts.keys() & {VERDICT, CHILD_VERDICT}
    obj.scale = (1.0, 1.0, 1.0)
    assert hair_of(read_scene(evaluated(), reader=reader)).part_count == 4 * COUNT


def test_names_may_be_no_text(scene: Any) -> None:
    """Old files have such names, with bytes that are not UTF-8; Blender is asked for their strands."""
    obj, reader = emitter(), ArrayReader()
    depsgraph = evaluated()
    shown = obj.evaluated_get(depsgraph).particle_systems[0]
    fields = strand_cache._SYSTEM.fields
    assert fields is not None
    ctypes.memmove(shown.as_pointer() + fields["name"][1], b"h\xffr\0", 4)
    with pytest.raises(UnicodeDecodeError):
        len(shown.name)
    assert hair_of(read_scene(depsgraph, reader=reader)).part_count == COUNT
    assert VERDICT not in reader.verdicts


def test_modifiers_may_have_no_system_and_systems_no_settings() -> None:
    empty = (None, SimpleNamespace(settings=None))
    modifiers = [SimpleNamespace(type="PARTICLE_SYSTEM", show_viewport=True, particle_system=one) for one in empty]
    obj = SimpleNamespace(particle_systems=[empty[1]], modifiers=modifiers)
    assert particle_hair_of(obj, for_render=False) is None
    assert not particle_hair.has_strands(obj)


def test_numbers_of_strands_and_points_tell_readings_apart(scene: Any) -> None:
    obj = emitter(**kind_settings("SIMPLE"))
    hair = particle_hair_of(obj.evaluated_get(evaluated()), for_render=False)
    assert hair is not None
    settings, places = hair.systems[0][1].settings, [hair.place()]
    for name, value in (("display_percentage", 50), ("display_step", 4), ("kink", "SPIRAL")):
        setattr(settings, name, value)  # of the evaluated ones, unnoticed
        places.append(hair.place())
    assert len(set(places)) == 4


def test_an_odd_system_does_not_condemn_the_others(scene: Any) -> None:
    """Its strands claim to be longer than the settings say, and are read one by one."""
    obj, reader = emitter(), ArrayReader()
    shown = obj.evaluated_get(evaluated())
    system = shown.particle_systems[0]
    expected = read_strands(system, shown, ArrayReader(use_views=False), for_render=False).points
    space = strand_cache.Space.of(shown)
    assert space is not None
    assert strand_cache._read_memory(system, 0, COUNT, 4, space) is None
    assert strand_cache._read_memory(system, 0, COUNT, 5, space) is not None
    more = strand_cache._read_memory(system, 0, COUNT + 2, 5, space)
    slow = strand_cache._read_one_by_one(system, shown, range(COUNT + 2), 5, space)
    assert more is not None
    np.testing.assert_allclose(more, slow, atol=1e-5)
    np.testing.assert_allclose(read_strands(system, shown, reader, for_render=False).points, expected, atol=1e-5)
    assert reader.verdicts[VERDICT]


def test_heads_are_read_before_what_follows_them() -> None:
    """Strands are not read if they claim to be longer than their distance in memory, or than the number of steps."""
    records = np.zeros((6, 3), strand_cache._RECORD)
    records["point"] = np.arange(54).reshape(6, 3, 3)
    begins = records.ctypes.data + np.arange(6) * 3 * records.itemsize
    for segments, steps, is_read in ((2, 3, True), (-1, 3, True), (3, 3, False), (-2, 3, False), (2, 2, False)):
        records["segments"][4, 0] = segments
        records["segments"][[0, 1, 2, 3, 5], 0] = 1
        points = np.full((6, steps, 3), -1.0, np.float32)
        assert strand_cache._gather(begins, np.eye(4, dtype=np.float32), points) == is_read
        if is_read:
            np.testing.assert_array_equal(points[4], records["point"][4][np.minimum(np.arange(3), max(segments, 0))])
            np.testing.assert_array_equal(points[5], records["point"][5][[0, 1, 1]])
        else:
            assert (points == -1.0).all()


@pytest.mark.filterwarnings("error")
def test_strands_that_are_all_dropped_are_named(scene: Any) -> None:
    obj = emitter()
    obj.particle_systems[0].settings.radius_scale = 1e20
    record = read_scene(evaluated())
    text = f"Emitter: left out {COUNT} curves with a number that is not finite or beyond 1e18"
    assert [str(told) for told in record.not_shown] == [text] and text in record.warnings
    assert [mesh.kind for mesh in record.meshes] == ["triangles"]
    assert record.instances.mesh_indices.tolist() == [0]


@pytest.mark.parametrize("use_views", [True, False])
def test_systems_may_have_no_particle(scene: Any, use_views: bool) -> None:
    """First alone, then together with another system that has particles."""
    obj = emitter(count=0)
    assert [mesh.kind for mesh in read_scene(evaluated(), reader=ArrayReader(use_views)).meshes] == ["triangles"]
    add_hair(obj)
    assert hair_of(read_scene(evaluated(), reader=ArrayReader(use_views))).part_count == COUNT


@pytest.mark.filterwarnings("error")
def test_lengths_that_are_not_finite_warn_of_nothing(scene: Any) -> None:
    points = np.full((2, 3, 3), np.inf, np.float32)
    points[1] = np.arange(9).reshape(3, 3) * 1e30
    _, lengths = particle_hair._along(points)
    assert not np.isfinite(lengths).any()


def test_places_on_maps_are_numbers(scene: Any) -> None:
    """Values of the emitter's map that are not finite become 0, as in attributes of curves, in both ways of reading."""
    obj = emitter()
    values = np.array([np.nan, np.inf] * len(obj.data.loops), np.float32)
    obj.data.uv_layers[0].uv.foreach_set("vector", values)
    hair = particle_hair_of(obj.evaluated_get(evaluated()), for_render=False)
    assert hair is not None
    for use_views in (True, False):
        mesh = read_particle_hair(hair, None, "hair", LayerRequest(frozenset([""])), ArrayReader(use_views))
        assert mesh is not None and mesh.corner_uvs is not None
        assert (mesh.corner_uvs[:, 0] == 0.0).all() and np.isfinite(mesh.corner_uvs).all()


UNFIT = "the attribute Paint of Emitter must be a Byte Color of face corners for particle hair"


@pytest.mark.parametrize(
    ("kind", "domain", "told"),
    [
        (
            "FLOAT_COLOR",
            "CORNER",
            UNFIT,
        ),
        (
            "BYTE_COLOR",
            "POINT",
            UNFIT,
        ),
        (None, None, "the attribute Paint is not found on Emitter"),
        ("BYTE_COLOR", "CORNER", None),
    ],
)
def test_colors_that_hair_cannot_show_are_named(scene: Any, kind: Any, domain: Any, told: str | None) -> None:
    obj = emitter()
    if kind:
        obj.data.attributes.new("Paint", kind, domain)
    material = bpy.data.materials.new("Hair")
    material.use_nodes = True
    tree = material.node_tree
    paint = tree.nodes.new("ShaderNodeAttribute")
    paint.attribute_name = "Paint"
    tree.links.new(paint.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    obj.data.materials.append(material)
    rows = [str(row) for row in read_scene(evaluated(), AttributeRequest(shading=True)).not_shown if row.name == "Hair"]
    assert rows == ([] if told is None else [f"Hair: {told}; black is used"])


class _OneStrand:
    """A strand of two steps whose tip is in the world's origin."""

    def co_hair(self, obj: Any, particle_no: int, step: int) -> tuple[float, ...]:
        if step > 1 or particle_no > 0:
            return (0.0, 0.0, 0.0)
        return tuple((np.array(obj.matrix_world) @ (1.0, 0.0, float(step), 1.0))[:3])


def test_a_tip_in_the_origin_is_no_end() -> None:
    """Compared with the answer for an object at another position."""
    at, elsewhere = (SimpleNamespace(matrix_world=np.eye(4)) for _ in range(2))
    at.matrix_world[:3, 3] = -1.0, 0.0, -1.0
    space, system = strand_cache.Space.of(at), _OneStrand()
    assert space is not None
    points = strand_cache._read_one_by_one(system, at, [0], 4, space, lambda: (at, elsewhere))
    expected = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 1.0]], np.float32)
    np.testing.assert_array_equal(points, expected[None])
    assert strand_cache._agrees(expected[None], 0, system, at, space)
    assert not strand_cache._agrees(expected[None] + np.float32(0.1), 0, system, at, space)
