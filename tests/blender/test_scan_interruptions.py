"""Scans that are interrupted, or cast in chunks: nothing is half done, and the frame is restored."""

from __future__ import annotations

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from blender.scanned_room import LIDAR  # noqa: E402
from perfect_bvh_addon import CameraGrid, scan  # noqa: E402
from perfect_bvh_addon.scanning import Scanner, stretch_sync  # noqa: E402

pytestmark = pytest.mark.usefixtures("registered")


def test_a_sensor_deleted_during_the_scan_is_named_and_the_frame_set_back(room) -> None:
    room.frame_set(2)
    steps = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3)).steps()
    next(steps)
    assert room.frame_current == 2  # the end of the current interval
    bpy.data.objects.remove(bpy.data.objects["Head"])
    with pytest.raises(ValueError, match="the sensor 'Head' was deleted during the scan"):
        list(steps)
    assert room.frame_current == 2


def test_a_scanned_object_deleted_during_the_scan_is_gone_from_then_on(room) -> None:
    scanner = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3))
    steps = scanner.steps()
    next(steps)
    bpy.data.objects.remove(bpy.data.objects["Plane"])
    list(steps)
    cloud = scanner.result()
    on_plane = cloud.object_ids == cloud.object_names.index("Plane")
    assert on_plane.any() and cloud.times[on_plane].max() < 1 / 24


def test_giving_up_sets_the_frame_back(room) -> None:
    room.frame_set(3)
    steps = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3)).steps()
    next(steps)
    steps.close()
    assert room.frame_current == 3


def test_a_scan_can_be_given_up_before_its_first_ray(room, monkeypatch) -> None:
    """A scan can be stopped once the scene is read, which may take long; the operator checks Esc between steps."""
    monkeypatch.setattr(CameraGrid, "cast", None)
    steps = Scanner(CameraGrid(32, 18)).steps()
    assert next(steps) == 0.0
    steps.close()


def test_progress_can_stop_a_scan(room) -> None:
    seen: list[float] = []

    def stop_halfway(done: float) -> bool:
        seen.append(done)
        return done < 0.5

    with pytest.raises(perfect_bvh.Cancelled):
        scan(LIDAR, bpy.data.objects["Head"], frames=(1, 3), progress=stop_halfway)
    assert seen == sorted(seen) and seen[0] == 0.0 and 0.5 <= seen[-1] < 1.0


def test_large_scans_are_cast_in_pieces(room, monkeypatch) -> None:
    whole = scan(CameraGrid(32, 18))
    monkeypatch.setattr(stretch_sync, "RAYS_IN_A_STEP", 100)
    monkeypatch.setitem(scan.__globals__, "BUILD_STEP_SECONDS", 60.0)  # builds are no steps here
    scanner = Scanner(CameraGrid(32, 18))
    done = list(scanner.steps())
    assert len(done) == 7 and done == sorted(done) and (done[0], done[-1]) == (0.0, 1.0)
    cloud = scanner.result()
    for name in ("positions", "ray_ids", "object_ids", "times"):
        np.testing.assert_array_equal(getattr(cloud, name), getattr(whole, name))
