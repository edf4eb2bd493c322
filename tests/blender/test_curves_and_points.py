"""Hair curves and point clouds of a scene: rays hit the right surfaces, and answers are never old."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import NodeGroup, collection, collection_instance, evaluated, mesh_object
from blender.hair_and_points import (
    cloud_data,
    cloud_object,
    hair_data,
    hair_object,
    make_poly,
    set_points,
    set_radii,
    upright,
)
from oracles.cycles import preserved, render_cycles, render_passes
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.geometry.hair_shape import HairShape
from perfect_bvh_addon.scanning.point_data import OBJECT_NAMES

DOWN = (0.0, 0.0, -1.0)
FIELDS = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals")


def rays(count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(4)
    origins = random.normal(size=(count, 3)) * 3.0 + (2.0, 0.0, 8.0)
    return origins, random.uniform((-1, -1, -0.5), (5, 1, 1.5), (count, 3)) - origins


def updated(sync: SceneSync) -> Any:
    return sync.update(evaluated())


def assert_as_fresh(sync: SceneSync) -> int:
    """Compare the bits of all answers with a fresh sync; return the number of rays that hit."""
    fresh = SceneSync(watch=False)
    try:
        updated(fresh)
        hits, expected = (one.scene.cast_rays(*rays(), fields=FIELDS) for one in (sync, fresh))
        for field in FIELDS:
            assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field
        return int(expected.is_hit.sum())
    finally:
        fresh.close()


def test_what_is_read_of_hair(scene: Any) -> None:
    strands = upright()
    radii = np.linspace(0.1, 0.02, 20)
    hair_object("Hair", strands, radii)
    (mesh,) = read_scene(evaluated()).meshes
    assert (mesh.kind, mesh.curve_kind, mesh.name, mesh.part_count) == ("curves", "catmull_rom", "Hair", 5)
    assert mesh.curve_offsets is not None and mesh.curve_offsets.tolist() == [0, 4, 8, 12, 16, 20]
    np.testing.assert_array_equal(mesh.positions, strands.reshape(-1, 3))
    np.testing.assert_array_equal(mesh.radii, radii.astype(np.float32))
    assert not len(mesh.triangles) and mesh.triangle_ids is None


def test_rays_meet_hair_and_points(scene: Any) -> None:
    scene.cycles_curves.shape = "THICK"
    hair = hair_object("Hair", upright())
    hair.location.y = 3.0
    cloud_object("Cloud", [(0.0, 0.0, 0.0), (2.0, 0.0, 1.0)], [0.5, 0.25])
    sync = SceneSync()
    updated(sync)
    origins = [(0, 0, 9), (2, 0, 9), (3, 3, 9), (3.2, 3, 9)]
    hits = sync.scene.cast_rays(origins, DOWN, fields=("t_hit", "primitive_ids", "instance_ids", "mesh_ids"))
    np.testing.assert_allclose(hits.t_hit, [8.5, 7.75, 9.0 - 1.1, np.inf], rtol=1e-6)
    assert hits.primitive_ids.tolist() == [0, 1, 3, -1]
    assert sync.describe(hits.instance_ids).names.tolist() == ["Cloud", "Cloud", "Hair", ""]
    assert sync.polygon_ids(hits).tolist() == [0, 1, 3, -1]
    assert sync.triangle_ids(hits).tolist() == [0, 1, 3, -1]
    sync.close()


def test_radii_that_are_missing_are_those_of_cycles(scene: Any) -> None:
    hair_object("Hair", upright(1), None)
    cloud_object("Cloud", [(0.0, 5.0, 0.0)], None).data.attributes.get("radius")
    meshes = {mesh.kind: mesh for mesh in read_scene(evaluated()).meshes}
    for attribute in ("curves", "points"):
        radii = meshes[attribute].radii
        assert radii is not None and np.ptp(radii) == 0.0
    assert meshes["curves"].radii[0] in (np.float32(0.005), np.float32(0.01))


def test_polys_go_straight(scene: Any) -> None:
    corner = [[(0, 0, 0), (1, 0, 0), (1, 1, 0)]]
    hair = hair_object("Hair", corner, 0.01)
    sync = SceneSync()
    updated(sync)
    bends = sync.scene.cast_rays((0.5, 0.0, 5.0), DOWN).is_hit
    make_poly(hair.data)
    report = updated(sync)
    assert [mesh.action for mesh in report.meshes] == ["replaced"]
    assert sync.scene.cast_rays((0.5, 0.0, 5.0), DOWN).is_hit and not bends
    assert_as_fresh(sync)
    sync.close()


def test_what_moves_is_followed(scene: Any) -> None:
    strands = upright()
    hair = hair_object("Hair", strands)
    cloud = cloud_object("Cloud", [(0.0, 2.0, 0.0), (1.0, 2.0, 0.0)])
    sync = SceneSync()
    updated(sync)
    random = np.random.default_rng(5)
    for _ in range(3):
        set_points(hair.data, strands + random.normal(scale=0.1, size=strands.shape))
        set_points(cloud.data, random.normal(size=(2, 3)))
        report = updated(sync)
        assert {mesh.name: mesh.action for mesh in report.meshes} == {"Hair": "deformed", "Cloud": "deformed"}
        assert_as_fresh(sync)
    set_radii(hair.data, 0.2)
    report = updated(sync)
    assert {mesh.name: mesh.action for mesh in report.meshes} == {"Hair": "deformed", "Cloud": "kept"}
    assert assert_as_fresh(sync) > 20
    assert {action.action for action in report.commit.meshes} <= {"refitted", "rebuilt"}
    hair.location.z = 1.0
    report = updated(sync)
    assert {mesh.action for mesh in report.meshes} == {"kept"} and report.moved_count == 1
    assert assert_as_fresh(sync) > 20
    sync.close()


def test_others_take_their_place(scene: Any) -> None:
    hair = hair_object("Hair", upright())
    sync = SceneSync()
    updated(sync)
    hair.data.add_curves([3, 2])
    offsets = np.empty(len(hair.data.curves) + 1, np.int32)
    hair.data.curve_offset_data.foreach_get("value", offsets)
    set_points(hair.data, np.random.default_rng(6).normal(size=(offsets[-1], 3)))
    report = updated(sync)
    assert [mesh.action for mesh in report.meshes] == ["replaced"] and report.meshes[0].triangle_count == 7
    assert_as_fresh(sync)
    bpy.data.objects.remove(hair)
    report = updated(sync)
    assert [mesh.action for mesh in report.meshes] == ["removed"]
    assert not sync.scene.cast_rays(*rays()).is_hit.any()
    sync.close()


def test_an_edit_is_never_answered_with_what_was_before(scene: Any) -> None:
    from perfect_bvh import StaleSceneError

    hair = hair_object("Hair", upright())
    sync = SceneSync()
    updated(sync)
    set_points(hair.data, upright() + np.float32(1.0))
    bpy.context.view_layer.update()
    with pytest.raises(StaleSceneError):
        sync.scene.cast_rays(*rays())
    sync.close()


def test_numbers_that_are_not_finite_are_left_out_by_name(scene: Any) -> None:
    strands = upright()
    strands[1, 2, 0] = np.nan
    hair_object("Hair", strands)
    cloud_object("Cloud", [(0, 9, 0), (np.inf, 9, 0), (1, 9, 0)])
    record = read_scene(evaluated())
    assert sorted(record.warnings) == [
        "Cloud: left out 1 point with a number that is not finite or beyond 1e18",
        "Hair: left out 1 curve with a number that is not finite or beyond 1e18",
    ]
    sync = SceneSync()
    updated(sync)
    hits = sync.scene.cast_rays([(2, 0, 9), (1, 9, 9)], DOWN)
    assert sync.triangle_ids(hits).tolist() == [2, 2]
    sync.close()


def test_curves_of_one_point_are_not_met(scene: Any) -> None:
    data = hair_data("Hair", upright(2))
    data.add_curves([1, 2])
    set_points(data, [*upright(2).reshape(-1, 3), (5, 0, 0), (6, 0, 0), (6, 0, 1)])
    set_radii(data, 0.1)
    mesh_object("Hair", data)
    record = read_scene(evaluated())
    assert record.meshes[0].triangle_ids is not None and record.meshes[0].triangle_ids.tolist() == [0, 1, 3]
    assert record.warnings == ()


def test_instances_share_one_tree(scene: Any) -> None:
    held = collection("Fur", linked=False)
    held.objects.link(mesh_object("Hair", hair_data("Hair", upright()), collection=False))
    for x in range(3):
        collection_instance(f"there {x}", held, location=(0.0, 2.0 * x, 0.0))
    record = read_scene(evaluated())
    assert len(record.meshes) == 1 and len(record.instances) == 3
    sync = SceneSync()
    updated(sync)
    hits = sync.scene.cast_rays([(0, 0, 9), (0, 2, 9), (0, 4, 9)], DOWN)
    assert hits.is_hit.all()
    assert assert_as_fresh(sync) > 10
    sync.close()


def test_what_nodes_make(scene: Any) -> None:
    """Nodes add points to a mesh, and show a mesh on hair."""
    group = NodeGroup("points")
    node = group.node("GeometryNodeMeshToPoints", Radius=0.25)
    group.link(group.input.outputs[0], node.inputs["Mesh"])
    group.show(group.input.outputs[0], node.outputs["Points"])
    obj = mesh_object("Thing")
    group.apply_to(obj)
    record = read_scene(evaluated())
    assert sorted(mesh.kind for mesh in record.meshes) == ["points", "triangles"]
    sync = SceneSync()
    updated(sync)
    assert sync.scene.cast_rays((0.0, -0.2, 9.0), DOWN).t_hit == pytest.approx(8.0 - 0.15, abs=1e-6)
    obj.data.vertices[3].co.z = 2.0
    obj.data.update_tag()
    report = updated(sync)
    assert {mesh.action for mesh in report.meshes} == {"deformed"}
    assert_as_fresh(sync)
    sync.close()


def test_scans_stay_out_of_the_picture(scene: Any) -> None:
    """Points of an earlier scan would hide the surfaces that it scanned."""
    cloud = cloud_object("Scan", [(0, 0, 0)])
    cloud.data[OBJECT_NAMES] = "[]"
    cloud.data.attributes.new("Color", "FLOAT_COLOR", "POINT")
    record = read_scene(evaluated())
    assert not record.meshes and record.warnings == ("Scan: its points are not rendered; 3D viewports show them",)


SHAPES = {
    ("RIBBONS", 2): ("catmull_rom", "ribbon", 5),
    ("RIBBONS", 0): ("catmull_rom", "ribbon", 2),
    ("THICK", 2): ("catmull_rom", "round", 8),
    ("THICK_LINEAR", 2): ("poly", "round", 8),
}


def test_hair_has_the_shape_that_cycles_settings_ask_for(scene: Any) -> None:
    """A change of the settings is followed, and affects nothing but hair."""
    hair_object("Hair", upright())
    poly = hair_object("Poly", upright() + np.float32(0.5))
    make_poly(poly.data)
    mesh_object("Mesh")
    sync = SceneSync()
    updated(sync)
    for (shape, subdivisions), form in SHAPES.items():
        scene.cycles_curves.shape, scene.cycles_curves.subdivisions = shape, subdivisions
        meshes = {mesh.name: mesh for mesh in read_scene(evaluated()).meshes}
        read = meshes["Hair"]
        assert (read.curve_kind, read.curve_shape, read.curve_pieces) == form
        assert meshes["Poly"].form == ("curves", "poly", "round", 1)
        actions = {mesh.name: mesh.action for mesh in updated(sync).meshes}
        assert actions["Mesh"] == actions["Poly"] == "kept"
        assert actions["Hair"] == ("kept" if (shape, subdivisions) == ("RIBBONS", 2) else "replaced")
        assert assert_as_fresh(sync) > 20
    sync.close()


def test_hair_and_points_that_are_all_dropped_are_named(scene: Any) -> None:
    hair_object("Hair", upright() * np.float32(np.nan))
    cloud_object("Cloud", [(np.nan, 0, 0), (0, 0, np.inf)])
    record = read_scene(evaluated())
    assert not record.meshes and not len(record.instances)
    assert sorted(str(told) for told in record.not_shown) == [
        "Cloud: left out 2 points with a number that is not finite or beyond 1e18",
        f"Hair: left out {len(upright())} curves with a number that is not finite or beyond 1e18",
    ]


@pytest.mark.parametrize(("subdivisions", "pieces"), [(6, 65), (7, 65), (24, 65)])
def test_more_pieces_than_are_asked_are_named(scene: Any, subdivisions: int, pieces: int) -> None:
    hair_object("Hair", upright())
    scene.cycles_curves.shape, scene.cycles_curves.subdivisions = "RIBBONS", subdivisions
    sync = SceneSync()
    updated(sync)
    record = sync.record
    assert record.meshes[0].curve_pieces == pieces
    told = [str(row) for row in record.not_shown]
    text = f"Curves: {subdivisions} subdivisions of ribbons exceed the limit; 6 are used"
    assert told == ([text] if subdivisions > 6 else [])
    assert assert_as_fresh(sync) > 10
    sync.close()


def test_hair_that_stays_is_the_same_record(scene: Any) -> None:
    """If only transforms change, its record is kept without a comparison; another shape makes another record."""
    hair_object("Hair", upright())
    mover = mesh_object("Mover")
    sync = SceneSync()
    held = []
    for place in range(3):
        mover.location.x = place
        updated(sync)
        held.append({mesh.name: mesh for mesh in sync.record.meshes}["Hair"])
    assert held[2] is held[1]
    scene.cycles_curves.shape = "THICK"
    updated(sync)
    assert {mesh.name: mesh for mesh in sync.record.meshes}["Hair"].curve_shape == "round"
    sync.close()


@pytest.mark.parametrize(("setting", "shape"), [("STRAND", "ribbon"), ("STRIP", "ribbon"), ("CYLINDER", "round")])
def test_without_cycles_eevees_shape_counts(setting: str, shape: str) -> None:
    without = SimpleNamespace(render=SimpleNamespace(hair_type=setting))
    assert HairShape.of(without).shape == shape


def far_camera(scene: Any) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, 0.0, 8.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.perfect_bvh.samples = 1


@pytest.mark.parametrize("is_bent", [False, True])
def test_ribbons_are_those_of_cycles(scene: Any, registered: None, is_bent: bool) -> None:
    """Straight ribbons are equal except for rounding. Where ribbons bend, Cycles joins the segments differently."""
    random = np.random.default_rng(9)
    steps = random.normal(size=(60, 1, 3)) * (0.4, 0.4, 0.4) + random.normal(scale=0.1 * is_bent, size=(60, 5, 3))
    strands = random.uniform(-1.5, 1.5, (60, 1, 3)) + np.cumsum(steps, axis=1)
    shown = hair_object("Hair", strands, 0.03)
    shown.pass_index = 3
    far_camera(scene)
    theirs, ours = render_cycles(scene), render_passes(scene, "PERFECT_BVH")
    seen, found = theirs.object_index == 3, ours.object_index == 3
    assert seen.mean() > 0.05 and (found != seen).mean() < (0.003 if is_bent else 0.001)
    both = seen & found
    depth = np.abs(ours.depth / theirs.depth - 1.0)[both]
    angles = np.degrees(np.arccos(np.clip((ours.normal * theirs.normal).sum(axis=-1)[both], -1.0, 1.0)))
    assert np.quantile(depth, 0.98) < (1e-3 if is_bent else 1e-4) and np.median(depth) < 1e-4
    # A pixel may show one strand here and another in Cycles; near an edge the normal turns fast.
    assert np.quantile(angles, 0.9) < (10.0 if is_bent else 1.0) and np.median(angles) < (2.0 if is_bent else 0.5)


@pytest.mark.parametrize("kind", ["poly", "catmull_rom", "points"])
def test_depth_and_normals_are_those_of_cycles(scene: Any, registered: None, kind: str) -> None:
    random = np.random.default_rng(7)
    if kind == "points":
        shown = cloud_object("Cloud", random.uniform(-1.0, 1.0, (300, 3)), random.uniform(0.02, 0.1, 300))
    else:
        strands = random.uniform(-1.0, 1.0, (120, 1, 3)) + np.cumsum(random.normal(scale=0.2, size=(120, 6, 3)), axis=1)
        shown = hair_object("Hair", strands, np.tile(np.linspace(0.05, 0.01, 6), 120))
        if kind == "poly":
            make_poly(shown.data)
    shown.pass_index = 3
    far_camera(scene)
    with preserved((scene.cycles_curves, "shape", "THICK")):
        theirs, ours = render_cycles(scene), render_passes(scene, "PERFECT_BVH")
    seen = theirs.object_index == 3
    assert seen.mean() > 0.05
    # At a silhouette the exact position in the pixel decides; Cycles' ray may miss the centre by 0.005 pixels.
    assert ((ours.object_index == 3) != seen).mean() < 0.01
    both = seen & (ours.object_index == 3)
    depth = np.abs(ours.depth - theirs.depth)[both]
    turned = (ours.normal * theirs.normal).sum(axis=-1)[both]
    # Cycles bends these curves; the engine divides them into segments.
    is_bent = kind == "catmull_rom"
    assert np.quantile(depth, 0.95) < (1e-2 if is_bent else 1e-5) and np.median(depth) < (1e-3 if is_bent else 1e-5)
    assert np.quantile(turned, 0.05) > (0.95 if is_bent else 0.9999)


class Edits:
    """Random edits of hair, of a point cloud, and of the objects that show them."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._hair = hair_object("Hair", upright())
        self._cloud = cloud_object("Cloud", random.normal(size=(30, 3)))
        self._all = (self.bend, self.grow, self.thicken, self.scatter, self.add, self.hide, self.turn, self.straighten)
        self._all += (self.reshape,)

    def make(self) -> None:
        for edit in self._random.choice(np.array(self._all, object), self._random.integers(1, 3)):
            edit()

    def bend(self) -> None:
        set_points(self._hair.data, self._random.normal(size=(len(self._hair.data.points), 3)))

    def grow(self) -> None:
        self._hair.data.add_curves([int(self._random.integers(1, 5))])
        self.bend()

    def thicken(self) -> None:
        set_radii(self._hair.data, self._random.uniform(0.0, 0.2, len(self._hair.data.points)))

    def scatter(self) -> None:
        set_points(self._cloud.data, self._random.normal(size=(len(self._cloud.data.points), 3)))

    def add(self) -> None:
        old = self._cloud.data
        self._cloud.data = cloud_data("More", self._random.normal(size=(int(self._random.integers(1, 60)), 3)))
        bpy.data.pointclouds.remove(old)

    def hide(self) -> None:
        chosen = self._any()
        chosen.hide_viewport = not chosen.hide_viewport

    def turn(self) -> None:
        chosen = self._any()
        chosen.rotation_euler = self._random.uniform(0.0, 6.0, 3)
        chosen.scale = self._random.uniform(0.5, 1.5, 3)

    def straighten(self) -> None:
        make_poly(self._hair.data)

    def reshape(self) -> None:
        settings = bpy.context.scene.cycles_curves
        settings.shape = str(self._random.choice(["RIBBONS", "THICK", "THICK_LINEAR"]))
        settings.subdivisions = int(self._random.integers(0, 4))

    def _any(self) -> Any:
        return self._hair if self._random.random() < 0.5 else self._cloud


def test_random_edits(scene: Any) -> None:
    """Each synced scene equals a fresh one."""
    edits = Edits(np.random.default_rng(8))
    mesh_object("Mesh")
    sync = SceneSync()
    updated(sync)
    hit = 0
    for _ in range(40):
        edits.make()
        updated(sync)
        hit += assert_as_fresh(sync)
    assert hit > 400
    sync.close()
