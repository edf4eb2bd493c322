"""Depth of field: pictures compared with Cycles', and changes of focus, which every kind of picture shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import new_red  # noqa: E402
from oracles.cycles import preserved, render_beside, render_passes  # noqa: E402
from oracles.png import read_png  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402
from perfect_bvh_addon.view3d.rendered.screen import camera_of  # noqa: E402
from perfect_bvh_addon.view3d.rendered.viewport import _camera_key  # noqa: E402

SIZE, PATCH, SAMPLES = 64, 8, 64
Image = npt.NDArray[np.float32]


@pytest.fixture
def scene() -> Iterator[Any]:
    """A camera that looks along y and blurs everything that is not 3 away; the render is a small square."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add(rotation=(math.pi / 2, 0.0, 0.0))
    scene.camera = bpy.context.object
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 3.0, 0.1
    scene.world = bpy.data.worlds.new("World")
    paint_world(scene, 0.0)
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.engine = "PERFECT_BVH"
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = SAMPLES, False
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def paint_world(scene: Any, grey: float) -> None:
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (grey, grey, grey, 1.0)


def emissive_ball(location: tuple[float, float, float], radius: float = 0.15) -> Any:
    material = bpy.data.materials.new("Glow")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Strength"].default_value = 20.0
    material.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    bpy.ops.mesh.primitive_ico_sphere_add(radius=radius, subdivisions=3, location=location)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def ours(scene: Any) -> Image:
    return render_passes(scene, "PERFECT_BVH").combined


def render_both(scene: Any) -> tuple[Image, Image]:
    """Return our image and Cycles', (H, W, 4) each."""
    return render_beside(scene, SAMPLES)


def patches(image: Image) -> Image:
    """(H / PATCH, W / PATCH): the mean green of each patch."""
    return image[..., 1].reshape(SIZE // PATCH, PATCH, SIZE // PATCH, PATCH).mean(axis=(1, 3))


def moments(image: Image) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the light's centre and spread along each axis, in pixels, and its skewness relative to the spread."""
    light = image[..., 1].astype(np.float64) / image[..., 1].sum()
    y, x = np.mgrid[:SIZE, :SIZE]
    middle_x, middle_y = (light * x).sum(), (light * y).sum()
    dx, dy = x - middle_x, y - middle_y
    spread_x, spread_y = np.sqrt((light * dx**2).sum()), np.sqrt((light * dy**2).sum())
    dx, dy = dx / spread_x, dy / spread_y
    leaning = [(light * product).sum() for product in (dx * dy, dx**3, dy**3, dx**2 * dy, dx * dy**2)]
    return np.array([middle_x, middle_y, spread_x, spread_y]), np.array(leaning)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
@pytest.mark.parametrize(("blades", "rotation", "ratio"), [(0, 0.0, 1.0), (3, 0.3, 1.4)])
def test_blur_has_the_size_and_the_shape_of_cycles(
    scene, kind: str, blades: int, rotation: float, ratio: float
) -> None:
    camera = scene.camera.data
    camera.type, camera.lens, camera.ortho_scale = kind, 40.0, 4.0
    if kind == "PANO":
        settings = panorama_settings(camera)
        settings.panorama_type = "EQUIRECTANGULAR"
        settings.longitude_min = settings.latitude_min = -0.5
        settings.longitude_max = settings.latitude_max = 0.5
    camera.dof.aperture_fstop = 0.7 if kind == "ORTHO" else 0.018
    camera.dof.aperture_blades, camera.dof.aperture_rotation, camera.dof.aperture_ratio = blades, rotation, ratio
    emissive_ball((0.4, 7.0, 0.3), radius=0.4)
    mine, theirs = render_both(scene)
    (place, shape), (their_place, their_shape) = moments(mine), moments(theirs)
    assert 4.0 < their_place[3] < 12.0, "blurred, and not out of the picture"
    np.testing.assert_allclose(place, their_place, atol=0.3)
    np.testing.assert_allclose(shape, their_shape, atol=0.08)
    if blades == 3:
        assert np.abs(their_shape).max() > 0.1
    assert mine[..., 1].sum() == pytest.approx(theirs[..., 1].sum(), rel=0.05)


def courtyard(scene: Any) -> Any:
    """Build cubes one behind the other under a sun; return the middle one, which the camera focuses on."""
    paint_world(scene, 0.4)
    bpy.ops.mesh.primitive_plane_add(size=60.0, location=(0.0, 0.0, -1.0))
    cubes = []
    for x, y in ((-0.8, 2.5), (0.1, 5.0), (1.9, 9.0)):
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(x, y, -0.5), rotation=(0.0, 0.0, 0.4))
        cubes.append(bpy.context.object)
    for thing in [obj for obj in scene.objects if obj.type == "MESH"]:
        thing.data.materials.append(new_red())
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, -0.7, 0.0))
    bpy.context.object.data.energy = 2.0
    scene.camera.data.dof.focus_object = cubes[1]
    scene.camera.data.dof.aperture_fstop = 0.03
    return cubes[1]


def test_a_scene_is_blurred_as_in_cycles(scene) -> None:
    courtyard(scene)
    mine, theirs = render_both(scene)
    assert np.abs(patches(mine) - patches(theirs)).max() < 0.03
    assert np.abs(patches(mine) - patches(theirs)).mean() < 0.005
    scene.camera.data.dof.use_dof = False
    assert np.abs(patches(mine) - patches(ours(scene))).max() > 0.12


def test_passes_are_those_of_the_middle_of_the_lens(scene) -> None:
    """Cycles' passes hold the hits of one ray through a random point of the lens; in focus they are the same."""
    courtyard(scene)
    mine = render_passes(scene, "PERFECT_BVH")
    scene.camera.data.dof.use_dof = False
    sharp = render_passes(scene, "PERFECT_BVH")
    for name in ("depth", "normal", "object_index", "material_index"):
        np.testing.assert_array_equal(getattr(mine, name), getattr(sharp, name))
    assert not np.array_equal(mine.combined, sharp.combined)


# Changes of the focus ----------------------------------------------------------------------------------------------


def focus_distance_of(scene: Any) -> float:
    sync = SceneSync(watch=False)
    sync.update(bpy.context.evaluated_depsgraph_get())
    return float(sync.camera.lens.focus_distance)


def test_focus_follows_distance_object_and_bone(scene) -> None:
    dof = scene.camera.data.dof
    scene.camera.rotation_euler, scene.camera.location = (math.pi / 2, 0.0, math.pi / 2), (2.0, 0.0, 0.0)  # along -x
    assert focus_distance_of(scene) == 3.0
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("Nose")
    bone.head, bone.tail = (1.0, 0.0, 0.0), (1.0, 0.0, 1.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.location, armature.scale = (-4.0, 5.0, 1.0), (2.0, 2.0, 2.0)
    dof.focus_object = armature
    assert focus_distance_of(scene) == pytest.approx(6.0, abs=1e-5)
    dof.focus_subtarget = "Nose"
    assert focus_distance_of(scene) == pytest.approx(4.0, abs=1e-5)
    armature.pose.bones["Nose"].location.x = 0.5
    assert focus_distance_of(scene) == pytest.approx(3.0, abs=1e-5)
    armature.hide_viewport = armature.hide_render = True
    armature.location.x = -5.0
    assert focus_distance_of(scene) == pytest.approx(4.0, abs=1e-5)
    dof.focus_subtarget = "None of these"
    assert focus_distance_of(scene) == pytest.approx(7.0, abs=1e-5)
    armature.location.x = 2.0
    assert focus_distance_of(scene) == pytest.approx(1e-5)


def change_distance(scene: Any) -> None:
    scene.camera.data.dof.focus_distance = 5.0


def move_focus_object(scene: Any) -> None:
    scene.objects["Focus"].location.y += 2.0


def open_lens(scene: Any) -> None:
    scene.camera.data.dof.aperture_fstop *= 0.5


def turn_off(scene: Any) -> None:
    scene.camera.data.dof.use_dof = False


@pytest.mark.parametrize("change", [change_distance, move_focus_object, open_lens, turn_off])
def test_a_change_of_focus_shows_in_syncs_viewports_and_renders(scene, change: Callable[[Any], None]) -> None:
    focus = bpy.data.objects.new("Focus", None)
    focus.location.y = 3.0
    scene.collection.objects.link(focus)
    if change is move_focus_object:
        scene.camera.data.dof.focus_object = focus
    emissive_ball((0.0, 6.0, 0.0), radius=0.5)
    scene.render.use_persistent_data = True
    space = SimpleNamespace(camera=scene.camera)
    view = SimpleNamespace(view_perspective="CAMERA")

    def key() -> tuple[Any, ...]:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        view.window_matrix = np.array(scene.camera.calc_matrix_camera(depsgraph, x=SIZE, y=SIZE))
        view.view_matrix = np.array(scene.camera.matrix_world.inverted())
        camera, complaint = camera_of(view, space, depsgraph)
        assert complaint is None
        return _camera_key(camera)

    sync = SceneSync()
    sync.update(bpy.context.evaluated_depsgraph_get())
    before, image = key(), ours(scene)
    assert key() == before
    change(scene)
    assert key() != before
    report = sync.update(bpy.context.evaluated_depsgraph_get())
    assert report.camera_changed
    assert sync.update(bpy.context.evaluated_depsgraph_get(), verify=True).mismatches == ()
    sync.close()
    assert np.abs(ours(scene) - image).max() > 0.3


def test_a_view_that_is_not_the_cameras_has_no_lens(scene) -> None:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    space = SimpleNamespace(camera=scene.camera, use_render_border=False)
    view = SimpleNamespace(view_perspective="PERSP", view_matrix=np.eye(4))
    view.window_matrix = np.array(scene.camera.calc_matrix_camera(depsgraph, x=SIZE, y=SIZE))
    assert camera_of(view, space, depsgraph)[0].lens is None
    view.view_perspective = "CAMERA"
    assert camera_of(view, space, depsgraph)[0].lens is not None


@pytest.mark.parametrize("use_persistent_data", [False, True])
def test_an_animation_follows_the_focus_object(scene, tmp_path: Path, use_persistent_data: bool) -> None:
    emissive_ball((0.0, 6.0, 0.0), radius=0.5)
    focus = bpy.data.objects.new("Focus", None)
    scene.collection.objects.link(focus)
    for frame, distance in ((1, 2.0), (3, 6.0)):
        focus.location.y = distance
        focus.keyframe_insert("location", index=1, frame=frame)
    scene.camera.data.dof.focus_object = focus
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.use_persistent_data = use_persistent_data
    with preserved((scene.render, "filepath", str(tmp_path / "frame_"))):
        bpy.ops.render.render(animation=True)
    animated = [read_png(file) for file in sorted(tmp_path.iterdir())]
    assert len(animated) == 3
    scene.render.use_persistent_data = False
    for frame, image in enumerate(animated, start=1):
        scene.frame_set(frame)
        with preserved((scene.render, "filepath", str(tmp_path / "single.png"))):
            bpy.ops.render.render(write_still=True)
        np.testing.assert_array_equal(read_png(tmp_path / "single.png"), image)
    assert not np.array_equal(animated[0], animated[1])
    assert not np.array_equal(animated[1], animated[2])
