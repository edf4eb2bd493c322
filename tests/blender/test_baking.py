"""Values that rays bake onto surfaces: closed forms, and a brute force in double precision."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from blender.baked_scenes import (  # noqa: E402
    SUN_PATH,
    SUNS,
    UP,
    Floats,
    box,
    centres,
    end_of,
    ground,
    made,
    normals,
    world_corners,
    world_quads,
)
from blender.builders import camera_object, mesh_object  # noqa: E402
from perfect_bvh_addon import DirectionTable, bake_rays  # noqa: E402
from perfect_bvh_addon.baking import Baker, BakeSettings  # noqa: E402
from perfect_bvh_addon.baking.receivers import Receiver, place_points  # noqa: E402
from perfect_bvh_addon.sync.records import MeshRecord  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene")

# Closed forms ---------------------------------------------------------------------------------------------------------


def test_a_wall_shades_the_ground_for_as_long_as_the_sun_is_behind_it() -> None:
    floor = ground("Floor", (10.0, 2.0), (50, 1), location=(5.0, 0.0, 0.0))
    box("Wall", (-1.0, -1000.0, -1.0), (0.0, 1000.0, 3.0))
    weights = np.linspace(0.1, 2.0, len(SUNS))
    bake = bake_rays([floor], kind="SUN_HOURS", directions=DirectionTable(SUNS, weights))
    origins = bake["Floor"].origins
    assert np.abs(origins[:, :2] - centres(floor)[:, :2] - (5.0, 0.0)).max() < 0.02  # near the centres
    away = origins[:, 0]
    is_lit = (SUNS[:, 0] > -1e-9) | (-np.tan(SUN_PATH) > 3.0 / away[:, None])
    np.testing.assert_allclose(bake["Floor"].values, is_lit @ weights, rtol=1e-12)
    assert bake.units == {"sun_hours": "h"}
    assert bake.ray_count == len(away) * len(SUNS)


def test_sums_of_hours_are_exact() -> None:
    """Steps of a sixth or of seven sixtieths of an hour are no whole binary fractions."""
    floor = ground("Floor", (1.0, 1.0), (1, 1))
    for minutes, count in ((10, 72), (7, 60), (1, 720)):
        table = DirectionTable(UP * count, np.full(count, minutes / 60.0))
        assert np.cumsum(table.weights)[-1] != count * minutes / 60
        for domain in ("FACE", "CORNER", "POINT"):
            baked = bake_rays([floor], kind="SUN_HOURS", domain=domain, directions=table)["Floor"]
            assert set(baked.values.tolist()) == {count * minutes / 60}


def test_irradiance_has_the_cosine() -> None:
    slope = made("Slope", [(0, 0, 0), (1, 0, 1), (1, 1, 1), (0, 1, 0)], [(0, 1, 2, 3)])
    bake = bake_rays([slope], kind="SUN_HOURS", directions=DirectionTable(SUNS, unit="kWh/m2", has_cosine=True))
    cosines = SUNS @ np.array([-math.sqrt(0.5), 0.0, math.sqrt(0.5)])
    assert bake["Slope"].values == pytest.approx([cosines[cosines > 0].sum()], rel=1e-12)
    assert bake.units == {"sun_hours": "kWh/m2"}


@pytest.mark.parametrize("cosine", [True, False])
def test_a_free_sphere_sees_the_sky_by_its_slope(cosine: bool) -> None:
    # Without caps, and not Blender's own: the order of its faces, and thus their rays, differs from run to run.
    tilts, turns = np.meshgrid(np.radians(np.arange(-84, 85, 12)), np.radians(np.arange(0, 360, 10)), indexing="ij")
    shape = np.stack([np.cos(turns) * np.cos(tilts), np.sin(turns) * np.cos(tilts), np.sin(tilts)], axis=-1)
    starts = [(row * 36, column, (column + 1) % 36) for row in range(14) for column in range(36)]
    ball = made("Ball", 2.0 * shape.reshape(-1, 3), [(r + a, r + b, r + 36 + b, r + 36 + a) for r, a, b in starts])
    baked = bake_rays([ball], kind="SKY_VIEW", rays=1024, cosine=cosine)[ball.name]
    up = normals(ball)[:, 2]
    expected = (1.0 + up) / 2.0 if cosine else 1.0 - np.arccos(np.clip(up, -1.0, 1.0)) / math.pi
    assert baked.error is not None
    off = np.abs(baked.values - expected)
    assert (off <= 5.0 * baked.error + 4.0 / 1024).all()  # the cells at the horizon may agree by chance
    assert off.mean() < 0.004
    assert baked.error.max() < 0.02


@pytest.mark.parametrize("rays", [64, 1024])
def test_the_floor_of_a_pit_sees_the_opening(rays: int) -> None:
    count, depth = 256, 2.0
    turns = np.arange(count) * (2.0 * math.pi / count)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    rim = np.concatenate([np.c_[ring, np.zeros(count)], np.c_[ring, np.full(count, depth)]])
    made("Shaft", rim, [(i, (i + 1) % count, (i + 1) % count + count, i + count) for i in range(count)])
    floor = ground("Floor", (0.002, 0.002), (20, 20))
    baked = bake_rays([floor], kind="SKY_VIEW", rays=rays)["Floor"]
    expected = 1.0 / (1.0 + depth**2)
    assert baked.error is not None
    real = baked.values.std()
    assert baked.values.mean() == pytest.approx(expected, abs=5.0 * real / 20 + 2e-4)  # the polygon is no circle
    assert np.sqrt((baked.error**2).mean()) == pytest.approx(real, rel=0.1)


@pytest.mark.parametrize(("method", "angle"), [("CONE", 0.5), ("CONE", 0.0), ("SPHERE", 0.5)])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (1.0, -1.0, 2.0)])
def test_a_slab_is_as_thick_as_it_is(method: str, angle: float, scale: Sequence[float]) -> None:
    slab = box("Slab", (-5.0, -5.0, 0.0), (5.0, 5.0, 0.25), location=(100.0, 0.0, 7.0))
    slab.scale, slab.rotation_euler = scale, (0.3, 0.2, 0.1)
    box("Beside", (-5.0, -5.0, 0.1), (5.0, 5.0, 0.2), location=slab.location).rotation_euler = slab.rotation_euler
    baked = bake_rays([slab], kind="THICKNESS", method=method, angle=angle)["Slab"]
    assert baked.values[:2] == pytest.approx([0.25 * scale[2]] * 2, rel=1e-5)


def test_a_ball_is_as_thick_as_its_diameter() -> None:
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=3.0)
    ball = bpy.context.object
    baked = bake_rays([ball], kind="THICKNESS", method="SPHERE")[ball.name]
    assert baked.values.max() <= 6.0 + 1e-4
    assert baked.values == pytest.approx(5.6, rel=0.1)  # the faces beside are flat, so a sphere that touches is smaller
    assert baked.error is None


def test_rays_that_leave_an_open_mesh_have_no_thickness() -> None:
    floor = ground("Floor", (1.0, 1.0), (1, 1))
    bake = bake_rays([floor], kind="THICKNESS")
    assert np.isnan(bake["Floor"].values).all()
    assert bake.write_attributes() == ("thickness", "thickness_error")
    assert floor.data.attributes["thickness"].data[0].value == 0.0


@pytest.mark.parametrize("distance", [1.0, 0.5])
def test_parallel_plates_hide_each_other_by_their_view_factor(distance: float) -> None:
    floor = ground("Floor", (0.001, 0.001), (12, 12))
    ground("Above", (2.0, 3.0), (1, 1), location=(0.0, 0.0, distance))
    a, b = 1.0 / distance, 1.5 / distance
    p, q = math.sqrt(1.0 + a * a), math.sqrt(1.0 + b * b)
    factor = 2.0 / math.pi * (a / p * math.atan(b / p) + b / q * math.atan(a / q))
    baked = bake_rays([floor], kind="AMBIENT_OCCLUSION", rays=256)["Floor"]
    assert baked.values.mean() == pytest.approx(1.0 - factor, abs=5.0 * baked.values.std() / 12 + 1e-4)
    near = bake_rays([floor], kind="AMBIENT_OCCLUSION", distance=0.9 * distance)["Floor"]
    assert (near.values == 1.0).all()


def test_occlusion_falls_off_with_the_distance() -> None:
    """Above an endless plane all at height h, the mean of (1 - h / (d cos)) over the cone that reaches it."""
    floor = ground("Floor", (0.001, 0.001), (10, 10))
    ground("Above", (400.0, 400.0), (1, 1), location=(0.0, 0.0, 1.0))
    baked = bake_rays([floor], kind="AMBIENT_OCCLUSION", distance=4.0, falloff=1.0, rays=1024)["Floor"]
    c = 1.0 / 4.0  # of the widest ray: the integral of 2 x (1 - c / x) from c to 1
    assert baked.values.mean() == pytest.approx(1.0 - (1.0 - c) ** 2, abs=5.0 * baked.values.std() / 10 + 1e-5)


# Where rays begin -----------------------------------------------------------------------------------------------------


def test_a_ray_never_hits_the_triangle_that_it_leaves() -> None:
    """Slivers, shears, mirrors and places far away; rays down to a billionth over the horizon."""
    random = np.random.default_rng(40)
    scene_count, ray_count = 200, 1000
    for number in range(scene_count):
        corners = random.normal(size=(3, 3)) * 10.0 ** random.uniform(-3, 3) + random.normal(size=3) * 10.0 ** (
            number % 7 - 3
        )
        corners[2] += (corners[0] - corners[2]) * (1.0 - 10.0 ** -random.uniform(0, 5))
        linear = random.normal(size=(3, 3)) * 10.0 ** random.uniform(-2, 2, 3)
        transform = np.c_[linear, random.normal(size=3) * 10.0 ** (number % 5 - 1)].astype(np.float32)
        mesh = MeshRecord(
            "key", "Mesh", corners.astype(np.float32), np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32)
        )
        receiver = Receiver(
            "Mesh", 1, (), "", mesh, transform.astype(np.float64), np.array([[0, 1, 2]]), None, 1, np.ones(1)
        )
        scene = perfect_bvh.Scene()
        scene.add_instance(scene.add_mesh(mesh.positions, mesh.triangles), transform)
        scene.commit()
        for kind, domain in (("SKY_VIEW", "FACE"), ("THICKNESS", "CORNER")):
            points = end_of(place_points(receiver, BakeSettings(kind, domain)))
            for position, normal in zip(points.positions, points.normals, strict=True):
                directions = random.normal(size=(ray_count, 3))
                heights = directions @ normal
                low = np.abs(random.normal(size=ray_count)) * 10.0 ** random.uniform(-9, 0, ray_count)
                directions += (low - heights)[:, None] * normal
                assert not scene.test_occlusions(position, directions).any(), number


def test_the_sides_of_a_crease_shadow_each_other() -> None:
    room = made(
        "Room", [(0, -9, 0), (9, -9, 0), (9, 9, 0), (0, 9, 0), (0, -9, 9), (0, 9, 9)], [(0, 1, 2, 3), (0, 3, 5, 4)]
    )
    suns = DirectionTable([[-0.6, 0.0, 0.8], [0.6, 0.0, 0.8]], [1.0, 10.0])
    corners = bake_rays([room], kind="SUN_HOURS", domain="CORNER", directions=suns)["Room"]
    assert corners.values.tolist() == [10.0, 11.0, 11.0, 10.0, 10.0, 10.0, 10.0, 10.0]
    points = bake_rays([room], kind="SUN_HOURS", domain="POINT", directions=suns)["Room"]
    assert points.values == pytest.approx([10.0, 11.0, 11.0, 10.0, 10.0, 10.0])


def test_a_face_that_lies_on_another_is_dark() -> None:
    below = ground("Below", (1.0, 1.0), (1, 1))
    ground("Above", (1.0, 1.0), (1, 1), location=(0.0, 0.0, 1e-6))
    assert bake_rays([below], kind="SUN_HOURS", directions=UP)["Below"].values.tolist() == [0.0]


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_folded_and_concave_faces_have_a_point_on_them(scale: float) -> None:
    shape = [(0, 0, 0), (4, 0, 0), (4, 1, 0), (1, 1, 0), (1, 4, 0), (0, 4, 0)]
    obj = made("L", shape, [range(6)])
    obj.scale = (scale, 1.0, 1.0)
    roof = made("Roof", [(10, 50, 0), (12, 50, 1), (12, 52, 0), (10, 52, 1)], [(0, 1, 2, 3)])
    bake = bake_rays([obj, roof], kind="SUN_HOURS", directions=SUNS)
    assert bake["L"].values.tolist() == [len(SUNS)]
    assert 0.5 * len(SUNS) < bake["Roof"].values[0] < len(SUNS)


def hits_of_quads(origins: Floats, directions: Floats, quads: Floats, own: npt.NDArray[np.int64]) -> tuple[Any, Floats]:
    """(P, D): whether any quad but the own one is hit, and how near any ray comes to an edge, as a sine."""
    is_hit, margin = np.zeros((len(origins), len(directions)), bool), np.full((len(origins), len(directions)), np.inf)
    for number, (a, b, c, d) in enumerate(quads):
        normal = np.cross(b - a, d - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((a - origins) @ normal)[:, None] / (directions @ normal)
        at = origins[:, None] + t[:, :, None] * directions
        across = []
        for start, end in ((a, b), (b, c), (c, d), (d, a)):
            inner = np.cross(normal, end - start)
            across.append((at - start) @ (inner / np.linalg.norm(inner)))
        inside = np.minimum.reduce(across)
        others = (own != number)[:, None]
        is_ahead = (t > 0.0) & np.isfinite(t)
        is_hit |= (inside > 0.0) & is_ahead & others
        margin = np.where(is_ahead & others, np.minimum(margin, np.abs(inside)), margin)
    return is_hit, margin


def test_sun_hours_of_a_street_are_those_of_a_brute_force() -> None:
    random = np.random.default_rng(4)
    houses = [
        box(
            f"House {x} {y}",
            (0, 0, 0),
            (8, 9, random.uniform(6, 20)),
            location=(8.3 * x, 21 * y + random.uniform(0, 1), 0),
        )
        for y in range(2)
        for x in range(4)
    ]
    for house in houses:
        house.rotation_euler.z = random.uniform(-0.05, 0.05)
    road = ground("Road", (35.0, 11.0), (60, 16), location=(16.0, 15.3, -0.01))
    road.rotation_euler = (0.01, 0.02, 0.03)
    bpy.context.view_layer.update()
    heights, turns = random.uniform(0.05, 1.0, 1000), random.uniform(0.0, 2 * math.pi, 1000)
    flat = np.sqrt(1.0 - heights**2)
    suns = np.stack([flat * np.cos(turns), flat * np.sin(turns), heights], axis=1)
    objects = [*houses, road]
    bake = bake_rays(objects, kind="SUN_HOURS", directions=suns, keep_visible=True)
    quads = np.concatenate([world_quads(obj) for obj in objects])
    corners = [row * 61 + column for row, column in ((0, 0), (0, 60), (16, 60), (16, 0))]  # all of the road as one
    walls = np.concatenate([*(world_quads(house) for house in houses), world_corners(road)[corners][None]])
    origins = np.concatenate([baked.origins for baked in bake.objects])
    assert np.abs(origins - quads.mean(axis=1)).max() < 0.03 * 20.0
    facing = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    wrong = certain = 0
    for first in range(0, len(suns), 50):
        some = suns[first : first + 50]
        is_hit, margin = hits_of_quads(origins, some, walls, np.minimum(np.arange(len(quads)), len(walls) - 1))
        lit = (facing @ some.T > 0.0) & ~is_hit
        found = np.concatenate([np.unpackbits(baked.visible, axis=1, count=len(suns)) for baked in bake.objects])
        is_sure = margin > 1e-9
        wrong += np.count_nonzero((found[:, first : first + 50] != lit) & is_sure)
        certain += np.count_nonzero(is_sure)
    assert certain > 1_000_000
    assert wrong == 0
    assert [baked.values.tolist() for baked in bake.objects] == [
        np.unpackbits(baked.visible, axis=1, count=len(suns)).sum(axis=1).tolist() for baked in bake.objects
    ]


def test_a_mirrored_object_faces_where_it_is_shown_to() -> None:
    obj = ground("Mirrored", (1.0, 1.0), (1, 1))
    obj.scale = (-1.0, 1.0, 1.0)
    assert bake_rays([obj], kind="SUN_HOURS", directions=UP)["Mirrored"].values.tolist() == [1.0]


# Exposure -------------------------------------------------------------------------------------------------------------


def test_a_camera_sees_what_is_in_its_frames(scene: Any) -> None:
    floor = ground("Floor", (40.0, 4.0), (40, 1))
    box("Pillar", (4.9, -2.0, 0.5), (5.1, 2.0, 0.6))
    camera = camera_object("Eye", lens=18.0, sensor_width=36.0)  # 90 degrees wide
    for frame, x in ((1, -10.0), (2, 5.0)):
        camera.location = (x, 0.0, 3.0)
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(7)
    baked = bake_rays([floor], kind="EXPOSURE", frames=(1, 2))["Floor"]
    x, y, _ = baked.origins.T
    seen = np.stack([np.abs(x + 10.0) < 3.0, (np.abs(x - 5.0) < 3.0) & (np.abs(x - 5.0) > 0.2)])
    assert baked.columns["exposure"].tolist() == (seen.sum(axis=0) / 2.0).tolist()
    to = np.hypot(np.where(seen[0], x + 10.0, x - 5.0), y)
    expected = np.where(seen.any(axis=0), np.hypot(to, 3.0), np.nan)
    np.testing.assert_allclose(baked.columns["nearest_distance"], expected, rtol=1e-6)
    np.testing.assert_allclose(
        baked.columns["smallest_angle"], np.where(seen.any(axis=0), np.arctan2(to, 3.0), np.nan), atol=1e-6
    )
    assert scene.frame_current == 7


def test_a_curve_and_positions_are_viewers() -> None:
    floor = ground("Floor", (1.0, 1.0), (1, 1))
    data = bpy.data.curves.new("Path", "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("POLY")
    spline.points.add(3)
    for number, point in enumerate(spline.points):
        point.co = (0.0, 0.0, number - 1.5, 1.0)
    path = mesh_object("Path", data, location=(0.0, 0.0, 1.0))
    by_curve = bake_rays([floor], kind="EXPOSURE", viewers=path)["Floor"]
    assert by_curve.columns["exposure"].tolist() == [0.75]
    assert by_curve.columns["nearest_distance"] == pytest.approx([0.5], rel=1e-3)  # it begins beside the diagonal
    places = [(0, 0, z - 0.5) for z in range(4)]
    by_places = bake_rays([floor], kind="EXPOSURE", viewers=places, distance=2.0)["Floor"]
    assert by_places.columns["exposure"].tolist() == [0.5]


# Repeatable -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["SKY_VIEW", "AMBIENT_OCCLUSION", "THICKNESS"])
def test_threads_and_blocks_do_not_change_a_byte(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    head = bpy.context.object
    first, alone = (bake_rays([head], kind=kind, domain="POINT", rays=32, threads=threads) for threads in (0, 1))
    monkeypatch.setattr("perfect_bvh_addon.baking.bake.BLOCK_POINTS", 100)
    blocks = bake_rays([head], kind=kind, domain="POINT", rays=32)
    other = bake_rays([head], kind=kind, domain="POINT", rays=32, seed=1)
    assert alone.objects[0].values.tobytes() == first.objects[0].values.tobytes()
    np.testing.assert_allclose(blocks.objects[0].values, first.objects[0].values, rtol=1e-12)
    assert not np.array_equal(other.objects[0].values, first.objects[0].values)


@pytest.mark.parametrize("domain", ["FACE", "CORNER", "POINT", "TEXEL"])
def test_points_placed_in_portions_are_the_same(domain: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    head = bpy.context.object
    how: dict[str, Any] = {"kind": "SKY_VIEW", "domain": domain, "rays": 8, "image_size": (32, 24)}
    whole = bake_rays([head], **how).objects[0]
    count = len(list(Baker([head], BakeSettings(**how)).steps()))
    monkeypatch.setattr("perfect_bvh_addon.baking.receivers._TRIANGLES_AT_ONCE", 7)
    monkeypatch.setattr("perfect_bvh_addon.baking.receivers._TEXELS_AT_ONCE", 5)
    parts = bake_rays([head], **how).objects[0]
    assert np.isfinite(whole.values).any()
    np.testing.assert_array_equal(parts.values, whole.values)
    assert len(list(Baker([head], BakeSettings(**how)).steps())) > count + 967 // 14  # it can be stopped in between


def test_what_did_not_change_is_kept() -> None:
    objects = [ground("One", (1.0, 1.0), (2, 2)), ground("Two", (1.0, 1.0), (2, 2), location=(3.0, 0.0, 0.0))]
    how: dict[str, Any] = {"kind": "SKY_VIEW", "rays": 16}
    first = bake_rays(objects, **how)
    again = bake_rays(objects, previous=first, **how)
    assert again.ray_count == 0
    assert again["Two"] is first["Two"]
    assert bake_rays(objects, previous=first, kind="SKY_VIEW", rays=32).ray_count > 0
    objects[1].location.z = 1.0
    assert bake_rays(objects, previous=again, **how)["One"] is not first["One"]  # something that it sees moved
    how["kind"] = "THICKNESS"  # for which only the object itself counts
    alone = bake_rays(objects, **how)
    objects[1].location.z = 2.0
    moved = bake_rays(objects, previous=alone, **how)
    assert moved["One"] is alone["One"]
    assert moved["Two"] is not alone["Two"]


def test_a_renamed_object_keeps_its_values_under_its_name() -> None:
    floor = ground("Floor", (1.0, 1.0), (1, 1))
    first = bake_rays([floor], kind="SKY_VIEW", rays=4)
    floor.name = "Ground"
    again = bake_rays([floor], kind="SKY_VIEW", rays=4, previous=first)
    assert again.ray_count == 0 and again["Ground"].values is first["Floor"].values


def test_a_stopped_bake_has_whole_objects() -> None:
    objects = [ground(name, (1.0, 1.0), (2, 2)) for name in ("One", "Two")]
    with pytest.raises(perfect_bvh.Cancelled):
        bake_rays(objects, kind="SKY_VIEW", progress=lambda _: False)
    assert not objects[0].data.attributes.get("sky_view")
    baker = Baker(objects, BakeSettings("SKY_VIEW", rays=4))
    assert not baker.run(lambda _: len(baker.result().objects) < 1)
    assert [len(baked.values) for baked in baker.result().objects] in ([4], [4, 4])
