"""Objects that move during a LiDAR's scan are hit at their position at each ray's time: closed forms, and frames."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import NodeGroup, mesh_object
from blender.moving_scenes import EVEN, FRAME, keyed, make
from perfect_bvh.audit import AUDITED_FIELDS
from perfect_bvh_addon import PointCloud, SpinningLidar, scan

# From the space of a pattern, which looks along -Z, to that of an object, which looks along +Y.
TO_OBJECT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
MILLIMETRE = 1e-3
STEPS = (1, 2, 5)


@pytest.fixture(autouse=True)
def audits(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Judge every answer of the scans in double precision and without a tree; none may be wrong."""
    cast = perfect_bvh.Snapshot.cast_rays
    judged: list[Any] = []

    def audited(snapshot: Any, *rays: Any, **how: Any) -> Any:
        asked = tuple({*how["fields"], *AUDITED_FIELDS})
        hits = cast(snapshot, *rays, **{**how, "fields": asked, "audit": 1.0})
        judged.append(hits.audit)
        return hits

    monkeypatch.setattr(perfect_bvh.Snapshot, "cast_rays", audited)
    yield
    assert judged and sum(len(audit.wrong_rows) for audit in judged) == 0


def sensor(**place: Any) -> Any:
    head = bpy.data.objects.new("Head", None)
    for name, value in place.items():
        setattr(head, name, value)
    bpy.context.scene.collection.objects.link(head)
    return head


def rotated(angles: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotate vectors about z."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1], vectors[:, 2]], 1)


def error(cloud: PointCloud, rows: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest error of the points, which must belong to these rays."""
    assert np.array_equal(cloud.ray_ids, rows) and len(rows) > 500
    return float(np.linalg.norm(cloud.positions - expected, axis=1).max())


@pytest.mark.parametrize("steps", STEPS)
def test_a_wall_that_comes_at_30_metres_a_second(scene: Any, steps: int) -> None:
    bpy.ops.mesh.primitive_plane_add(size=400.0, rotation=(0.0, math.pi / 2, 0.0))
    keyed(bpy.context.object, "location", [(40.0, 0.0, 0.0), (10.0, 0.0, 0.0)], (1, 25))
    lidar = SpinningLidar(elevations=(-20.0, 0.0, 5.0), columns=1800, rate=10.0)
    cloud = scan(lidar, sensor(), frames=(1, 12), steps_per_frame=steps)
    rays = lidar.cast(0.0, 0.5, None)
    away = rays.directions @ TO_OBJECT.T
    with np.errstate(divide="ignore"):
        far = (40.0 - 30.0 * rays.times) / away[:, 0]
    points = away * far[:, None]
    met = (far > 0.0) & (np.abs(points[:, 1:]) < 200.0).all(axis=1)
    assert error(cloud, np.flatnonzero(met), points[met]) < MILLIMETRE
    assert cloud.scene_error < MILLIMETRE and cloud.pose_error == 0.0 and cloud.warnings == ()


def box_hits(origins: np.ndarray, away: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the distance along each ray to a box around the origin, (R,); inf for a miss."""
    with np.errstate(divide="ignore"):
        sides = np.stack([(-half - origins) / away, (half - origins) / away])
    first, last = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
    return np.where((first < last) & (first > 0.0), first, np.inf)


@pytest.mark.parametrize("steps", STEPS)
def test_a_head_that_drives_and_turns_past_a_box_that_does(scene: Any, steps: int) -> None:
    """The mount moves by 30 units and a quarter turn a second, the box by 20 the other way and two turns."""
    head = sensor()
    keyed(head, "location", [(0.0, 0.0, 0.0), (30.0, 0.0, 0.0)], (1, 25))
    keyed(head, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)], (1, 25))
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    box, half = bpy.context.object, np.array([4.0, 1.0, 2.0])
    box.scale = half
    keyed(box, "location", [(20.0, 7.0, 0.0), (0.0, 7.0, 0.0)], (1, 25))
    keyed(box, "rotation_euler", [(0.0, 0.0, 0.3), (0.0, 0.0, 0.3 + 4.0 * math.pi)], (1, 25))
    lidar = SpinningLidar(elevations=(-8.0, -1.0, 3.0), columns=1800, rate=10.0)
    cloud = scan(lidar, head, frames=(1, 24), steps_per_frame=steps)
    rays = lidar.cast(0.0, 1.0, None)
    t = rays.times
    away = rotated(0.5 * math.pi * t, rays.directions @ TO_OBJECT.T)
    origins = np.outer(t, [30.0, 0.0, 0.0])
    centre = np.array([20.0, 7.0, 0.0]) + np.outer(t, [-20.0, 0.0, 0.0])
    turn = -(0.3 + 4.0 * math.pi * t)
    local = rotated(turn, origins - centre), rotated(turn, away)
    far = box_hits(*local, half)
    # A ray that passes an edge within a tenth of a millimetre may hit it or not.
    sure = np.isfinite(box_hits(*local, half - 1e-4)) | ~np.isfinite(box_hits(*local, half + 1e-4))
    met = np.zeros(len(t), np.bool_)
    met[cloud.ray_ids] = True
    assert len(cloud) > 500 and np.array_equal(met[sure], np.isfinite(far)[sure])
    both = np.isfinite(far[cloud.ray_ids]) & sure[cloud.ray_ids] & (cloud.incidences > 0.01)
    expected = (origins + far[:, None] * away)[cloud.ray_ids[both]]
    assert np.linalg.norm(cloud.positions[both] - expected, axis=1).max() < MILLIMETRE
    assert cloud.scene_error < MILLIMETRE


@pytest.mark.parametrize("steps", STEPS)
def test_a_ground_that_deforms(scene: Any, steps: int) -> None:
    """One side sinks by 6 units a second, the other by 12: the ground is always a plane, and vertices move straight."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=10, y_subdivisions=10, size=100.0)
    ground = bpy.context.object
    ground.shape_key_add(name="Basis")
    key = ground.shape_key_add(name="Sunk")
    for point in key.data:
        point.co.z = -9.0 + 0.06 * point.co.x
    keyed(key, "value", [0.0, 1.0], (1, 25))
    lidar = SpinningLidar(elevations=(-30.0, -20.0), columns=1800, rate=10.0)
    cloud = scan(lidar, sensor(location=(0.0, 0.0, 2.0)), frames=(1, 12), steps_per_frame=steps)
    rays = lidar.cast(0.0, 0.5, None)
    away = rays.directions @ TO_OBJECT.T
    # z = t * (0.06 x - 9), where 2 + far * away_z = z and far * away_x = x
    far = (2.0 + 9.0 * rays.times) / (0.06 * rays.times * away[:, 0] - away[:, 2])
    expected = np.array([0.0, 0.0, 2.0]) + far[:, None] * away
    assert error(cloud, np.arange(len(far)), expected) < MILLIMETRE
    assert cloud.scene_error < MILLIMETRE


@pytest.mark.parametrize("name", EVEN)
def test_each_column_sees_what_a_scene_that_stands_still_there_shows(scene: Any, name: str) -> None:
    """Instances, shapes, curves, points and text are compared with single scans of Blender's frames in between."""
    make(name)
    head = sensor(location=(0.5, -9.0, 1.0))
    lidar = SpinningLidar(elevations=tuple(np.linspace(-25.0, 20.0, 61)), columns=12, rate=20.0, sweep=50.0)
    cloud = scan(lidar, head, frames=(FRAME, FRAME + 1), steps_per_frame=2)
    assert (cloud.ray_count, cloud.warnings, scene.frame_current) == (20 * 61, (), FRAME)
    seen = 0
    for column in range(20):
        at = FRAME + column / 10
        scene.frame_set(int(at), subframe=at % 1)
        still = scan(lidar, head)
        expected = {int(ray) % 61: row for row, ray in enumerate(still.ray_ids) if ray // 61 == column % 12}
        found = {int(ray) % 61: row for row, ray in enumerate(cloud.ray_ids) if ray // 61 == column}
        both = sorted(expected.keys() & found.keys())
        # At most one ray passes so close to an edge that only one of the two hits it, or hits the surface behind.
        assert len(expected.keys() | found.keys()) - len(both) <= 1
        ends = cloud.positions[[found[ring] for ring in both]], still.positions[[expected[ring] for ring in both]]
        assert (np.linalg.norm(ends[0] - ends[1], axis=1) > MILLIMETRE).sum() <= 1
        seen += len(both)
    assert seen > 40


def test_an_oracle_that_stands_still_is_far_off(scene: Any) -> None:
    """The tests above would detect the former scans, in which the scene was at rest within a frame."""
    bpy.ops.mesh.primitive_plane_add(size=400.0, rotation=(0.0, math.pi / 2, 0.0))
    keyed(bpy.context.object, "location", [(40.0, 0.0, 0.0), (10.0, 0.0, 0.0)], (1, 25))
    cloud = scan(SpinningLidar(elevations=(0.0,)), sensor(rotation_euler=(0, 0, -1.57)), frames=(1, 12))
    moved = 40.0 - cloud.positions[:, 0]
    still = 30.0 * np.floor(cloud.times * 24.0 + 1e-6) / 24.0
    assert np.abs(moved - 30.0 * cloud.times).max() < MILLIMETRE and np.abs(moved - still).max() > 1.0


# Messages about curved paths ------------------------------------------------------------------------------------------


def by_frame(owner: Any, path: str, expression: str, index: int = -1) -> None:
    owner.driver_add(path, index).driver.expression = expression


@pytest.mark.parametrize("what", ["instance", "shape"])
def test_a_curved_way_is_as_far_off_as_the_cloud_says(scene: Any, what: str) -> None:
    bpy.ops.mesh.primitive_plane_add(size=400.0)
    ground = bpy.context.object
    if what == "instance":
        by_frame(ground, "location", "5*cos(frame/4)", 2)
    else:
        ground.shape_key_add(name="Basis")
        key = ground.shape_key_add(name="High")
        key.slider_min, key.slider_max = -1.0, 1.0
        for point in key.data:
            point.co.z = 5.0
        by_frame(key, "value", "cos(frame/4)")
    lidar = SpinningLidar(elevations=(-30.0,), columns=720, rate=10.0)
    said = []
    for steps in (1, 4):
        cloud = scan(lidar, sensor(location=(0.0, 0.0, 10.0)), frames=(1, 12), steps_per_frame=steps)
        off = np.abs(cloud.positions[:, 2] - 5.0 * np.cos((1.0 + 24.0 * cloud.times) / 4.0)).max()
        assert len(cloud) == 3600 and off < 1.05 * cloud.scene_error < 1.3 * off
        said.append(cloud.scene_error)
    assert said[1] < said[0] / 10


def test_an_even_turn_is_no_curved_way(scene: Any) -> None:
    """Nor does an even change of scale at the same time count, mirrored or not; a turn that gets faster does."""
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 6.0, 0.0))
    wheel, lidar, head = bpy.context.object, SpinningLidar(elevations=(0.0,), columns=360), sensor()
    by_frame(wheel, "rotation_euler", "frame*frame/50", 2)
    # A second difference of 1 / 25, of corners at a distance of the root of two from the axis.
    assert scan(lidar, head, frames=(1, 6)).scene_error == pytest.approx(math.sqrt(2) / 25 / 8, rel=0.01)
    wheel.driver_remove("rotation_euler", 2)
    keyed(wheel, "rotation_euler", [(0.0, 0.0, 0.0), (9.0, 0.0, 0.0)], (1, 25))
    assert scan(lidar, head, frames=(1, 6)).scene_error < 1e-5
    keyed(wheel, "scale", [(1.0, 1.0, 1.0), (3.0, 3.0, 3.0)], (1, 25))
    assert scan(lidar, head, frames=(1, 6)).scene_error < 1e-5
    keyed(wheel, "scale", [(-1.0, 1.0, 1.0), (-3.0, 2.0, 3.0)], (1, 25))
    assert scan(lidar, head, frames=(1, 6)).scene_error < 1e-5


def points_sorted_anew(scene: Any, *, with_ids: bool) -> None:
    """Cubes on points of a row, which nodes sort by random numbers in each frame; with ids of the unsorted points."""
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0.0, 0.0, -50.0))
    group = NodeGroup("sorted")
    line = group.node("GeometryNodeMeshLine", Count=40, Start_Location=(-20.0, 8.0, 0.0), Offset=(1.0, 0.0, 0.0))
    time, number = group.node("GeometryNodeInputSceneTime"), group.node("FunctionNodeRandomValue")
    ids, index = group.node("GeometryNodeSetID"), group.node("GeometryNodeInputIndex")
    sort, on_points = group.node("GeometryNodeSortElements"), group.node("GeometryNodeInstanceOnPoints")
    cube = group.node("GeometryNodeObjectInfo", Object=bpy.context.object, As_Instance=True)
    group.link(line.outputs[0], ids.inputs["Geometry"])
    group.link(index.outputs[0], ids.inputs["ID"])
    group.link((ids if with_ids else line).outputs[0], sort.inputs["Geometry"])
    group.link(time.outputs["Frame"], number.inputs["Seed"])
    group.link(number.outputs[1], sort.inputs["Sort Weight"])
    group.link(sort.outputs[0], on_points.inputs["Points"])
    group.link(cube.outputs["Geometry"], on_points.inputs["Instance"])
    group.show(on_points.outputs[0]).apply_to(mesh_object("Sorted"))


@pytest.mark.parametrize("with_ids", [False, True])
def test_copies_that_are_sorted_anew_are_met_where_they_are(scene: Any, with_ids: bool) -> None:
    points_sorted_anew(scene, with_ids=with_ids)
    cloud = scan(SpinningLidar(elevations=(0.0,), columns=3600, rate=24.0), sensor(), frames=(1, 2))
    row = np.round(cloud.positions[:, 0])
    assert len(cloud) > 500
    assert np.abs(cloud.positions[:, 0] - row).max() <= 0.2501
    assert np.abs(cloud.positions[:, 1] - 8.0).max() <= 0.2501
    told = [text for text in cloud.warnings if "instances without ids change places" in text]
    assert len(told) == (not with_ids) and len(cloud.warnings) == len(told)
    assert all("Sorted" in text for text in told)
