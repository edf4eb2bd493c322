"""Nodes that depend on a surface's position, view and rest shape: values compared with those of Cycles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import add, four_colors, new_red, surface  # noqa: E402
from oracles.cycles import FILTER_WIDTH, preserved, render_passes  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIZE = (80, 60)
WITHIN = 1e-3
OTHERS = 0.02  # the share of pixels, at outlines and edges
SCALE = 0.1  # of values around a half, so that all are light
Output = Callable[[Any], Any]


@pytest.fixture
def scene() -> Iterator[Any]:
    """A turned and unevenly scaled cube and a smooth sphere that a modifier bends, in front of a wide lens."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_cube_add(
        size=2.0, location=(-1.6, 0.0, 0.0), rotation=(0.5, 0.3, 0.7), scale=(1.0, 0.6, 1.4)
    )
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1.6, 0.4, 0.2), rotation=(0.2, 0.6, 0.1), scale=(1.3, 1.0, 0.8))
    bpy.ops.object.shade_smooth()
    bend = bpy.context.object.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.angle = "BEND", 1.0
    bpy.ops.object.camera_add(location=(0.5, -6.0, 1.5), rotation=(1.35, 0.1, 0.08))
    scene.camera = bpy.context.object
    scene.camera.data.lens, scene.camera.data.shift_x = 32.0, 0.03
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def show(output: Output, scale: float = SCALE) -> Any:
    """Give all meshes a material that emits an output's value."""
    material = new_red("Shown")
    tree = material.node_tree
    scaled = add(tree, "VectorMath", (output(tree), 0))
    scaled.operation = "MULTIPLY_ADD"
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (scale,) * 3, (0.5,) * 3
    tree.links.new(add(tree, "Emission", (scaled.outputs[0], 0)).outputs[0], surface(material))
    for obj in bpy.context.scene.objects:
        if obj.type == "MESH":
            obj.data.materials.clear()
            obj.data.materials.append(material)
    return material


def both(scene: Any) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3): our values and Cycles' in pixels where both see a surface at the same position."""
    with preserved(
        (scene.cycles, "samples", 1),
        (scene.cycles, "use_denoising", False),
        (scene.cycles, "use_adaptive_sampling", False),
        (scene.cycles, "filter_width", FILTER_WIDTH),
        (scene.cycles, "max_bounces", 0),
        (scene.render, "filter_size", FILTER_WIDTH),
        (scene.perfect_bvh, "samples", 1),
    ):
        ours, theirs = (render_passes(scene, engine) for engine in ("PERFECT_BVH", "CYCLES"))
    inside = (ours.depth < 1e3) & (np.abs(ours.depth - theirs.depth) < 0.01)
    return ours.combined[inside][:, :3], theirs.combined[inside][:, :3]


def check(scene: Any, scale: float = SCALE, least: int = 500) -> None:
    ours, theirs = ((image - 0.5) / scale for image in both(scene))
    assert len(ours) > least
    is_wrong = (np.abs(ours - theirs) > WITHIN * np.maximum(1.0, np.abs(theirs))).any(axis=1)
    assert is_wrong.mean() <= OTHERS, (ours[is_wrong][:5], theirs[is_wrong][:5])
    assert len(np.unique(np.round(theirs, 3), axis=0)) > 20


def node(kind: str, output: str | int, **properties: Any) -> Output:
    def made(tree: Any) -> Any:
        found = add(tree, kind)
        for name, value in properties.items():
            setattr(found, name, value)
        return found.outputs[output]

    return made


def transformed(kind: str, source: str, target: str) -> Output:
    def made(tree: Any) -> Any:
        given = add(tree, "NewGeometry").outputs["Position" if kind == "POINT" else "Normal"]
        found = add(tree, "VectorTransform", (given, 0))
        found.vector_type, found.convert_from, found.convert_to = kind, source, target
        return found.outputs[0]

    return made


def boxed(blend: float, place: str = "Generated") -> Output:
    def made(tree: Any) -> Any:
        image = add(tree, "TexImage", (add(tree, "TexCoord").outputs[place], 0))
        image.image, image.projection, image.projection_blend = four_colors(), "BOX", blend
        return image.outputs[0]

    return made


SPACES = ("WORLD", "OBJECT", "CAMERA")
PLACES = [node("TexCoord", name) for name in ("Camera", "Window", "Reflection", "Generated", "Normal")]
PLACES += [node("CameraData", number) for number in range(3)] + [node("NewGeometry", "Tangent")]
TRANSFORMS = [(kind, one, two) for kind in ("POINT", "VECTOR", "NORMAL") for one in SPACES for two in SPACES]
TANGENTS = [{"direction_type": "RADIAL", "axis": axis} for axis in "XYZ"] + [{"direction_type": "UV_MAP"}]


@pytest.mark.parametrize(
    "output", PLACES, ids=["camera", "window", "reflection", "generated", "normal", *"vzd", "tangent"]
)
def test_places_are_those_of_cycles(scene, output: Output) -> None:
    show(output)
    check(scene)


@pytest.mark.parametrize(("kind", "source", "target"), TRANSFORMS)
def test_vectors_are_transformed_as_in_cycles(scene, kind: str, source: str, target: str) -> None:
    scale = 0.03 if kind == "POINT" else SCALE
    show(transformed(kind, source, target), scale)
    check(scene, scale)


@pytest.mark.parametrize("properties", TANGENTS, ids=["x", "y", "z", "uv"])
def test_tangents_are_those_of_cycles(scene, properties: dict[str, str]) -> None:
    show(node("Tangent", 0, **properties))
    check(scene)


@pytest.mark.parametrize("blend", [0.0, 0.3, 1.0])
def test_boxes_of_images_are_those_of_cycles(scene, blend: float) -> None:
    show(boxed(blend, "Object"), 0.4)
    check(scene, 0.4)


@pytest.mark.parametrize("kind", ["ORTHO", "PANO"])
def test_other_cameras_have_windows_and_spaces_of_their_own(scene, kind: str) -> None:
    camera = scene.camera.data
    camera.type, camera.ortho_scale = kind, 8.0
    if kind == "PANO":
        camera.panorama_type, camera.shift_x = "EQUIRECTANGULAR", 0.0
    for output in (node("TexCoord", "Window"), node("TexCoord", "Camera")):
        show(output)
        check(scene, least=50)


def test_shape_keys_leave_generated_places_where_they_were(scene) -> None:
    cube = next(obj for obj in scene.objects if not obj.modifiers and obj.type == "MESH")
    cube.shape_key_add(name="Basis")
    key = cube.shape_key_add(name="Long")
    for point in key.data:
        point.co.z += 0.5 * point.co.x * point.co.z
    key.value = 0.8
    show(node("TexCoord", "Generated"))
    check(scene)


def bumped(width: float) -> Output:
    """The normal of a bump by bands that are narrower than the distance between the bump's samples."""

    def made(tree: Any) -> Any:
        bump = add(tree, "Bump", Strength=1.0, Distance=0.05, Filter_Width=width)
        wave = add(tree, "TexWave", (add(tree, "TexCoord").outputs["Object"], 0), Scale=1.5)
        tree.links.new(wave.outputs["Fac"], bump.inputs["Height"])
        return bump.outputs[0]

    return made


@pytest.mark.skipif(bpy.app.version < (4, 3, 0), reason="Blender before 4.3 has no such input")
def test_a_bump_looks_as_many_pixels_aside_as_in_cycles(scene) -> None:
    """The difference from Cycles is far smaller than that between two filter widths."""
    found = []
    for width in (0.1, 3.0):
        show(bumped(width), 0.4)
        found.append(both(scene))
    apart = [np.abs(ours - theirs).mean() for ours, theirs in found]
    change = np.abs(found[0][1] - found[1][1]).mean()
    assert max(apart) < 0.02 * change, (apart, change)


def test_a_box_in_a_world_is_no_error(scene) -> None:
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    tree.links.new(boxed(0.2)(tree), tree.nodes["Background"].inputs["Color"])
    scene.camera.rotation_euler = (math.pi / 2, 0.0, 0.6)
    for obj in [obj for obj in scene.objects if obj.type == "MESH"]:
        bpy.data.objects.remove(obj)
    with preserved((scene.cycles, "samples", 1), (scene.perfect_bvh, "samples", 1)):
        ours, theirs = (render_passes(scene, engine).combined for engine in ("PERFECT_BVH", "CYCLES"))
    assert np.abs(ours - theirs).mean() < 0.02
