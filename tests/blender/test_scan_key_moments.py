"""A scan's time samples: the evaluations and readings, Blender's frame, and the objects named as being at rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import mesh_object
from blender.moving_scenes import keyed
from perfect_bvh_addon import CameraGrid, SpinningLidar, scan
from perfect_bvh_addon.extract.geometry import mesh_table
from perfect_bvh_addon.live import scene_sync
from perfect_bvh_addon.scanning import Scanner

LIDAR = SpinningLidar(elevations=(-40.0, -17.0, -12.0), columns=90, rate=10.0)


class Counts:
    """Counts the evaluations and the readings of scans."""

    def __init__(self) -> None:
        self.frames: list[float] = []  # as a render sees them
        self.viewport_frames: list[float] = []
        self.readings = 0
        self.meshes: list[str] = []

    def note(self, scene: Any, depsgraph: Any) -> None:
        frames = self.frames if depsgraph.mode == "RENDER" else self.viewport_frames
        frames.append(scene.frame_current_final)


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Counts]:
    found = Counts()
    read_scene, read_mesh = scene_sync.read_scene, mesh_table.read_mesh

    def count_scene(*what: Any, **how: Any) -> Any:
        found.readings += 1
        return read_scene(*what, **how)

    def count_mesh(mesh: Any, key: Any, name: str, *rest: Any) -> Any:
        found.meshes.append(name)
        return read_mesh(mesh, key, name, *rest)

    monkeypatch.setattr(scene_sync, "read_scene", count_scene)
    monkeypatch.setattr(mesh_table, "read_mesh", count_mesh)
    bpy.app.handlers.frame_change_post.append(found.note)
    yield found
    bpy.app.handlers.frame_change_post.remove(found.note)


@pytest.fixture
def head(scene: Any) -> Any:
    """A sensor above a ground, and a box nearby."""
    bpy.ops.mesh.primitive_plane_add(size=400.0)
    bpy.context.object.data.name = "Ground"
    bpy.context.object.name = "Ground"
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 6.0, 1.0))
    bpy.context.object.name = bpy.context.object.data.name = "Box"
    made = bpy.data.objects.new("Head", None)
    made.location.z = 3.0
    scene.collection.objects.link(made)
    return made


def move_the_box() -> None:
    keyed(bpy.data.objects["Box"], "location", [(-3.0, 6.0, 1.0), (3.0, 6.0, 1.0)], (1, 6))


def deform_the_box() -> None:
    box = bpy.data.objects["Box"]
    box.shape_key_add(name="Basis")
    key = box.shape_key_add(name="Far")
    key.data[0].co.x += 2.0
    keyed(key, "value", [0.0, 1.0], (1, 6))


# Evaluations and readings --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("steps", "moments"), [(1, [2, 3, 4, 5]), (2, [1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5])])
@pytest.mark.parametrize("move", [None, move_the_box, deform_the_box])
@pytest.mark.parametrize("for_viewport", [False, True])
def test_each_key_moment_is_evaluated_and_read_once(
    head: Any,
    counts: Counts,
    move: Callable[[], None] | None,
    steps: int,
    moments: list[float],
    for_viewport: bool,
) -> None:
    if move is not None:
        move()
    counts.frames.clear()
    counts.viewport_frames.clear()
    scan(LIDAR, head, frames=(1, 4), steps_per_frame=steps, for_viewport=for_viewport)
    if for_viewport:
        assert (counts.frames, counts.viewport_frames) == ([], [*moments, 1.0])  # the last is the way back
    else:
        assert counts.frames == [1.0, *moments]
        assert set(counts.viewport_frames) == {1.0}
    assert counts.readings == len(moments) + 1
    assert counts.meshes.count("Ground") == 1
    assert counts.meshes.count("Box") == (len(moments) + 1 if move is deform_the_box else 1)


def test_what_rests_has_no_motion_and_one_tree(head: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rays have no times either if nothing moves."""
    times: list[Any] = []
    cast = perfect_bvh.Snapshot.cast_rays

    def note(*what: Any, **how: Any) -> Any:
        times.append(np.ndim(how["times"]))
        return cast(*what, **how)

    monkeypatch.setattr(perfect_bvh.Snapshot, "cast_rays", note)
    scan(LIDAR, head, frames=(1, 3))
    assert times == [0, 0, 0]
    keyed(bpy.data.objects["Box"], "location", [(0.0, 6.0, 1.0), (3.0, 6.0, 1.0)], (3, 4))
    scan(LIDAR, head, frames=(1, 3))
    assert times[3:] == [0, 0, 1]


def test_a_single_moment_has_no_shutter(head: Any, counts: Counts) -> None:
    """This is the current frame alone, and each picture of a camera grid."""
    move_the_box()
    scene = bpy.context.scene
    scene.frame_set(3)
    counts.frames.clear()
    cloud = scan(LIDAR, head)
    assert (counts.frames, counts.readings, cloud.scene_error) == ([3.0], 1, 0.0)
    x = cloud.positions[cloud.object_ids == cloud.object_names.index("Box"), 0]
    assert abs((x.min() + x.max()) / 2 - -0.6) < 0.2
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -6.0, 2.0), (1.5, 0.0, 0.0)
    scene.collection.objects.link(camera)
    counts.frames.clear()
    cloud = scan(CameraGrid(32, 18), camera, frames=(1, 3), steps_per_frame=2)
    assert counts.frames == [3.0, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5] and cloud.scene_error == 0.0
    for step in range(6):
        scene.frame_set(1 + step // 2, subframe=step % 2 / 2)
        alone = scan(CameraGrid(32, 18), camera)
        mine = cloud.ray_ids // (32 * 18) == step
        np.testing.assert_array_equal(cloud.positions[mine], alone.positions)
        assert cloud.times[mine] == pytest.approx(step / 48)


# Blender's frame during a scan ------------------------------------------------------------------------------------


def test_between_steps_it_is_where_the_stretch_ends(head: Any) -> None:
    move_the_box()
    bpy.context.scene.frame_set(9)
    steps = Scanner(LIDAR, head, frames=(1, 4)).steps()
    number = 0
    for done in steps:
        assert bpy.context.scene.frame_current == number + 2
        number += done == (number + 1) / 4  # the last step of an interval
    assert number == 4
    assert bpy.context.scene.frame_current == 9


@pytest.mark.parametrize("count", [1, 2, 5])
def test_giving_up_in_the_middle_leaves_the_frame(head: Any, count: int) -> None:
    move_the_box()
    bpy.context.scene.frame_set(9, subframe=0.25)
    told: list[float] = []

    def progress(done: float) -> bool:
        told.append(done)
        return len(told) < count

    with pytest.raises(perfect_bvh.Cancelled):
        scan(LIDAR, head, frames=(1, 4), steps_per_frame=2, progress=progress)
    assert (bpy.context.scene.frame_current, bpy.context.scene.frame_subframe) == (9, 0.25)


def flatten_the_head() -> str:
    keyed(bpy.data.objects["Head"], "scale", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)], (2, 3))
    return "no usable matrix"


def remove_the_head_on_the_way() -> str:
    def remove(scene: Any, _: Any) -> None:
        if scene.frame_current == 3 and "Head" in bpy.data.objects:
            bpy.data.objects.remove(bpy.data.objects["Head"])

    bpy.app.handlers.frame_change_post.append(remove)
    return "the sensor 'Head' was deleted during the scan"


@pytest.mark.parametrize("fail", [flatten_the_head, remove_the_head_on_the_way])
def test_what_fails_at_the_end_of_a_stretch_leaves_the_frame(head: Any, fail: Callable[[], str]) -> None:
    handlers = list(bpy.app.handlers.frame_change_post)
    words = fail()
    bpy.context.scene.frame_set(9)
    try:
        with pytest.raises(ValueError, match=words):
            scan(LIDAR, head, frames=(1, 4))
    finally:
        bpy.app.handlers.frame_change_post[:] = handlers
    assert bpy.context.scene.frame_current == 9


def test_undo_in_the_middle_is_read_from_the_next_stretch_on(head: Any) -> None:
    move_the_box()
    bpy.context.scene.frame_set(9)
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Ground"].location.z = -1.0
    bpy.ops.ed.undo_push(message="lowered")
    scanner = Scanner(LIDAR, head, frames=(1, 4))
    steps = scanner.steps()
    next(steps)
    bpy.ops.ed.undo()
    list(steps)
    cloud = scanner.result()
    low = cloud.positions[:, 2] < -0.5
    assert low.any() and cloud.times[low].max() < 1 / 24 <= cloud.times[~low & (cloud.positions[:, 2] < 0.1)].min()
    assert bpy.context.scene.frame_current == 9


def test_what_is_moved_by_hand_in_the_middle_has_not_gone_a_curved_way(head: Any) -> None:
    move_the_box()
    alone = scan(LIDAR, head, frames=(1, 4))
    scanner = Scanner(LIDAR, head, frames=(1, 4))
    steps = scanner.steps()
    next(steps)
    bpy.data.objects["Box"].delta_location.y = 1.0
    list(steps)
    cloud = scanner.result()
    farthest = [made.positions[made.object_ids == made.object_names.index("Box"), 1].max() for made in (alone, cloud)]
    assert farthest[1] > farthest[0] + 0.5
    assert alone.scene_error < 1e-5 and cloud.scene_error < 1e-5


def test_more_key_moments_than_columns_leave_stretches_without_rays(head: Any) -> None:
    move_the_box()
    cloud = scan(LIDAR, head, frames=(1, 1), steps_per_frame=100)
    assert cloud.ray_count == 3 * 38  # 900 columns a second: the last begins before 1 / 24
    assert len(cloud) > 90 and bpy.context.scene.frame_current == 1


# Objects at rest ------------------------------------------------------------------------------------------------------


def other_triangles() -> str:
    keyed(bpy.data.objects["Box"].modifiers.new("Array", "ARRAY"), "count", [1, 6], (1, 6))
    change = "its shape gets different triangles between two time samples of the scan"
    return f"Box: {change}; until the later one it keeps the earlier one's"


def gone() -> str:
    move_the_box()
    keyed(bpy.data.objects["Box"], "hide_render", [False, True], (2, 3))
    return (
        "Box: it disappears between two time samples of the scan; until the later one it stands still, as at the "
        "earlier one"
    )


def come() -> str:
    keyed(bpy.data.objects["Box"], "hide_render", [True, False], (2, 3))
    return "Box: it appears between two time samples of the scan; until the later one it is not hit"


def flat() -> str:
    keyed(bpy.data.objects["Box"], "scale", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)], (2, 3))
    return (
        "Box: its scale is zero at a time sample of the scan; before and after that it stands still, as at the "
        "earlier one"
    )


@pytest.mark.parametrize("change", [other_triangles, gone, come, flat])
def test_what_cannot_be_followed_is_named_once(head: Any, change: Callable[[], str]) -> None:
    words = change()
    cloud = scan(LIDAR, head, frames=(1, 5))
    assert cloud.warnings == (words,)


def test_particles_that_come_and_go_are_named_once_however_many(scene: Any, head: Any) -> None:
    cube = mesh_object("Drop")
    bpy.ops.mesh.primitive_grid_add(size=6.0, location=(0.0, 8.0, 0.0))
    spray = bpy.context.object
    spray.name = "Spray"
    spray.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = spray.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 100, 1, 20, 4
    settings.render_type, settings.instance_object, settings.normal_factor = "OBJECT", cube, 5.0
    for frame in range(1, 13):
        scene.frame_set(frame)
    cloud = scan(LIDAR, head, frames=(5, 10))
    assert cloud.warnings == (
        "Spray: some of its instances disappear between two time samples of the scan; until the later one they stand "
        "still, as at the earlier one",
        "Spray: some of its instances appear between two time samples of the scan; until the later one they are "
        "not hit",
    )


def test_switches_of_motion_blur_are_for_pictures(head: Any) -> None:
    move_the_box()
    moving = scan(LIDAR, head, frames=(1, 3))
    bpy.data.objects["Box"].cycles.use_motion_blur = False
    np.testing.assert_array_equal(scan(LIDAR, head, frames=(1, 3)).positions, moving.positions)


def test_what_a_lidar_cannot_read_is_named_as_a_cameras_is(head: Any) -> None:
    mesh = bpy.data.objects["Box"].data
    mesh.vertices[0].co.x = float("nan")
    mesh.update()
    for frames in (None, (1, 2)):
        (warning,) = scan(LIDAR, head, frames=frames).warnings
        assert "with a vertex that is not finite" in warning
