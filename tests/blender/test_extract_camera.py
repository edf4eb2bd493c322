"""Camera windows against the projection matrices that Blender computes itself."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from blender.builders import camera_object, evaluated, in_render, mesh_object
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.camera import Frame, camera_from_projection, panorama_settings, read_camera, read_frame
from perfect_bvh_addon.sync.appearance import as_camera
from perfect_bvh_addon.sync.records import CameraRecord


def projection_of(camera: CameraRecord) -> npt.NDArray[np.float64]:
    """Return the OpenGL projection matrix of a camera record."""
    left, right, bottom, top = camera.window
    near, far = camera.clip_start, camera.clip_end
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = 2 / (right - left), 2 / (top - bottom)
    if camera.projection == "perspective":
        matrix[0, 2], matrix[1, 2] = (right + left) / (right - left), (top + bottom) / (top - bottom)
        matrix[2, 2], matrix[2, 3], matrix[3, 2] = -(far + near) / (far - near), -2 * far * near / (far - near), -1
    else:
        matrix[0, 3], matrix[1, 3] = -(right + left) / (right - left), -(top + bottom) / (top - bottom)
        matrix[2, 2], matrix[2, 3], matrix[3, 3] = -2 / (far - near), -(far + near) / (far - near), 1
    return matrix


def blenders_projection(scene: Any, width: int, height: int) -> npt.NDArray[np.float64]:
    return np.array(
        scene.camera.calc_matrix_camera(
            evaluated(),
            x=width,
            y=height,
            scale_x=scene.render.pixel_aspect_x,
            scale_y=scene.render.pixel_aspect_y,
        )
    )


SIZES = [(64, 36), (36, 64), (50, 50)]
ASPECTS = [(1.0, 1.0), (2.0, 1.0), (1.0, 1.7)]


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, -0.7)])
def test_windows_are_blenders(scene: Any, kind: str, fit: str, shift: tuple[float, float]) -> None:
    camera_object(
        type=kind,
        sensor_fit=fit,
        shift_x=shift[0],
        shift_y=shift[1],
        sensor_width=31.0,
        sensor_height=17.0,
        lens=23.0,
        ortho_scale=5.5,
        clip_start=0.5,
        clip_end=40.0,
    )
    for (width, height), (aspect_x, aspect_y) in itertools.product(SIZES, ASPECTS):
        scene.render.resolution_x, scene.render.resolution_y = width, height
        scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect_x, aspect_y
        camera = read_scene(evaluated()).camera
        assert camera is not None
        expected = blenders_projection(scene, width, height)
        np.testing.assert_allclose(projection_of(camera), expected, rtol=2e-6, atol=2e-6)


def test_focal_length_may_be_given_as_an_angle(scene: Any) -> None:
    camera_object(lens_unit="FOV", angle=1.0)
    camera = read_scene(evaluated()).camera
    assert camera is not None
    assert camera.window[1] == pytest.approx(np.tan(0.5))


def test_the_matrix_has_no_scale_and_keeps_its_place(scene: Any) -> None:
    obj = camera_object()
    obj.location, obj.rotation_euler, obj.scale = (1, 2, 3), (0.5, 0.6, 0.7), (2, 5, 0.1)
    camera = read_scene(evaluated()).camera
    assert camera is not None
    rotation = np.array(obj.rotation_euler.to_matrix())
    np.testing.assert_allclose(camera.matrix[:3, :3], rotation, atol=1e-6)
    np.testing.assert_allclose(camera.matrix[:3, 3], [1, 2, 3], atol=1e-6)


def test_parents_and_constraints_move_the_camera(scene: Any) -> None:
    obj = camera_object()
    obj.parent = mesh_object("dolly", location=(0, 0, 10))
    camera = read_scene(evaluated()).camera
    assert camera is not None
    np.testing.assert_allclose(camera.matrix[:3, 3], [0, 0, 10])


@pytest.mark.parametrize(
    ("resolution", "percentage", "expected"),
    [((1081, 1920), 50, (540, 960)), ((640, 480), 33, (211, 158)), ((4, 5), 10, (1, 1))],
)
def test_the_size_is_that_of_a_render(
    scene: Any, resolution: tuple[int, int], percentage: int, expected: tuple[int, int]
) -> None:
    scene.render.resolution_x, scene.render.resolution_y = resolution
    scene.render.resolution_percentage = percentage
    frame = read_frame(scene)
    assert (frame.width, frame.height) == expected


def test_the_border_is_part_of_the_frame(scene: Any) -> None:
    camera_object()
    render = scene.render
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.5, 0.125, 0.75
    whole = read_scene(evaluated()).camera
    render.use_border = True
    part = read_scene(evaluated()).camera
    assert whole is not None
    assert part is not None
    assert whole.border == (0.0, 1.0, 0.0, 1.0)
    assert part.border == (0.25, 0.5, 0.125, 0.75)
    assert part.window == whole.window


def test_a_given_size_changes_the_window(scene: Any) -> None:
    camera_object(sensor_fit="HORIZONTAL")
    record = read_scene(evaluated(), size=(40, 40))
    assert record.size == (40, 40)
    assert record.camera is not None
    left, right, bottom, top = record.camera.window
    assert (right - left) == pytest.approx(top - bottom)


def test_another_camera_may_be_given(scene: Any) -> None:
    first = camera_object("first")
    second = camera_object("second")
    first.location.x, second.location.x = 1, 2
    assert camera_x(read_scene(evaluated())) == 2
    assert camera_x(read_scene(evaluated(), camera=first)) == 1
    record = CameraRecord(np.eye(4), (-1, 1, -1, 1), "perspective", 0.1, 10)
    assert read_scene(evaluated(), camera=record).camera is record


def camera_x(record: Any) -> float:
    return float(record.camera.matrix[0, 3])


def test_markers_switch_cameras(scene: Any) -> None:
    first = camera_object("first")
    second = camera_object("second")
    first.location.x, second.location.x = 1, 2
    scene.timeline_markers.new("one", frame=1).camera = first
    scene.timeline_markers.new("two", frame=5).camera = second
    seen = []
    for frame in (1, 5):
        scene.frame_set(frame)
        seen.append(camera_x(read_scene(evaluated())))
    assert seen == [1, 2]


def test_cameras_that_cannot_be_read_are_named(scene: Any) -> None:
    obj = camera_object("eye", type="PANO")
    settings = panorama_settings(obj.data)
    settings.panorama_type = "MIRRORBALL"
    record = read_scene(evaluated())
    assert record.camera is None
    assert "'eye' cannot be a Mirrorball panorama: choose Equirectangular as its Panorama Type" in record.warnings[0]

    settings.panorama_type = "EQUIRECTANGULAR"
    settings.latitude_min, settings.latitude_max = 0.3, 0.2
    assert "sees nothing" in read_scene(evaluated()).warnings[0]

    obj.data.type = "PERSP"
    obj.scale.x = 0.0
    assert "no usable matrix" in read_scene(evaluated()).warnings[0]

    obj.scale.x = 1.0
    obj.data.clip_start, obj.data.clip_end = 10.0, 5.0
    assert "clips everything" in read_scene(evaluated()).warnings[0]

    scene.camera = mesh_object("box")
    assert "'box' is a mesh object" in read_scene(evaluated()).warnings[0]


@pytest.mark.parametrize("keeper", ["itself", "Cycles"])
def test_a_panorama_is_read_wherever_blender_keeps_it(keeper: str) -> None:
    """Blender 5.0 and later keep it on the camera itself, older versions in Cycles' settings, if Cycles is there."""
    angles = {"longitude_min": -1.0, "longitude_max": 2.0, "latitude_min": -0.5, "latitude_max": 1.5}
    settings = {"panorama_type": "EQUIRECTANGULAR", **angles}
    common = {"type": "PANO", "shift_x": 0.1, "shift_y": -0.2, "clip_start": 0.2, "clip_end": 9.0}
    common["dof"] = SimpleNamespace(use_dof=False)
    own = settings if keeper == "itself" else {"cycles": SimpleNamespace(**settings)}
    obj = SimpleNamespace(name="eye", type="CAMERA", matrix_world=np.eye(4), data=SimpleNamespace(**common, **own))
    record, complaint = read_camera(obj, Frame(100, 50))
    assert complaint is None
    assert (record.projection, record.clip_start, record.clip_end) == ("equirectangular", 0.2, 9.0)
    assert record.window == pytest.approx((-0.7, 2.3, -0.9, 1.1))
    obj.data = SimpleNamespace(**common)
    assert read_camera(obj, Frame(100, 50)) == (
        None,
        "Camera 'eye' is panoramic: this Blender keeps its settings in Cycles, which is disabled in the preferences",
    )


def test_an_edit_of_a_panorama_shows_in_the_next_update(scene: Any) -> None:
    obj = camera_object("eye", type="PANO")
    settings = panorama_settings(obj.data)
    settings.panorama_type = "EQUIRECTANGULAR"
    sync = SceneSync(watch=False)
    sync.update(evaluated())
    assert not sync.update(evaluated()).camera_changed
    settings.longitude_max = 1.0
    assert sync.update(evaluated()).camera_changed
    assert sync.camera.window[1] == pytest.approx(1.0)
    settings.panorama_type = "MIRRORBALL"
    assert sync.update(evaluated()).camera_changed
    assert sync.camera is None


def test_a_scene_without_a_camera_has_none_and_no_complaint(scene: Any) -> None:
    record = read_scene(evaluated())
    assert record.camera is None
    assert record.warnings == ()


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_camera_comes_back_from_its_projection(scene: Any, kind: str) -> None:
    camera_object(type=kind, shift_x=0.2, shift_y=-0.1, clip_start=0.5, clip_end=40.0)
    camera = read_scene(evaluated()).camera
    assert camera is not None
    again = camera_from_projection(camera.matrix, blenders_projection(scene, 32, 18), camera.border)
    np.testing.assert_allclose(again.window, camera.window, rtol=1e-5)
    assert again.projection == camera.projection
    assert again.clip_start == pytest.approx(0.5, rel=1e-4)
    assert again.clip_end == pytest.approx(40.0, rel=1e-4)


def test_a_view_without_an_end_comes_back_from_its_projection(scene: Any) -> None:
    camera_object(clip_start=1e-6, clip_end=100.0)
    camera = read_scene(evaluated()).camera
    assert camera is not None
    again = camera_from_projection(camera.matrix, blenders_projection(scene, 32, 18), camera.border)
    assert again.clip_start == pytest.approx(1e-6, rel=1e-4)
    assert again.clip_end == np.inf
    sync = SceneSync(watch=False)
    bpy.ops.mesh.primitive_ico_sphere_add(radius=1e-4, location=camera.matrix[:3, 3] - 3e-4 * camera.matrix[:3, 2])
    sync.update(evaluated())
    shown = {
        name: perfect_bvh.render(sync.scene, as_camera(record), "normal", (32, 18))
        for name, record in (("read", camera), ("again", again))
    }
    assert len(np.unique(shown["read"].reshape(-1, 4), axis=0)) > 10
    np.testing.assert_allclose(shown["again"], shown["read"], atol=1e-3)


def test_an_orthographic_view_that_sees_behind_itself_steps_back() -> None:
    record = CameraRecord(np.eye(4), (-2, 2, -1, 1), "orthographic", -100.0, 100.0)
    camera = camera_from_projection(np.eye(4), projection_of(record), record.border)
    assert camera.clip_start == 0.0
    assert camera.clip_end == pytest.approx(200.0)
    np.testing.assert_allclose(camera.matrix[:3, 3], [0, 0, 100])
    np.testing.assert_allclose(camera.window, record.window)


def test_renders_read_the_same_camera(scene: Any) -> None:
    camera_object(shift_x=0.2).location = (3, 4, 5)
    here = read_scene(evaluated())
    there = in_render(read_scene)
    assert here.camera.window == there.camera.window
    np.testing.assert_array_equal(here.camera.matrix, there.camera.matrix)
    assert here.size == there.size
    assert bpy.context.scene.camera is not None
