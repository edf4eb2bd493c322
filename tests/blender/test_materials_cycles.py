"""Typical materials, and lights with all their settings, in the mode "preview", compared with Cycles' picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import SETUPS, new_red, paint, painted_plainly, tiled  # noqa: E402
from blender.textured_setups import TEXTURED  # noqa: E402
from oracles.cycles import render_beside, render_passes  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIZE, PATCH, SAMPLES = (96, 64), 8, 64


@pytest.fixture
def scene() -> Iterator[bpy.types.Scene]:
    """A cube just above a floor, under a sun and a grey sky, seen from the front."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60.0)
    bpy.context.object.data.materials.append(new_red("Floor"))
    bpy.ops.mesh.primitive_cube_add(size=2.4, location=(0.0, 0.0, 1.21), rotation=(0.0, 0.0, 0.4))
    bpy.context.object.name = "Cube"
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, -0.7, 0.0))
    bpy.context.object.name, bpy.context.object.data.energy = "Sun", 2.5
    bpy.ops.object.camera_add(location=(0.0, -7.0, 5.0), rotation=(1.0, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.world = bpy.data.worlds.new("World")
    scene.world.color, scene.world.use_nodes = (0.3, 0.3, 0.3), False
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = SAMPLES, False
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def patches(image: np.ndarray) -> np.ndarray:
    """(H / PATCH, W / PATCH, 3): the mean colour of each patch."""
    parts = np.clip(image[..., :3], 0.0, 2.0).reshape(SIZE[1] // PATCH, PATCH, SIZE[0] // PATCH, PATCH, 3)
    return parts.mean(axis=(1, 3))


def render_both(scene: bpy.types.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the patches of our image and of Cycles'."""
    ours, theirs = render_beside(scene, SAMPLES)
    return patches(ours), patches(theirs)


def check(scene: bpy.types.Scene) -> np.ndarray:
    ours, theirs = render_both(scene)
    assert np.abs(ours - theirs).max() < 0.13
    assert np.abs(ours - theirs).mean() < 0.02
    return ours


@pytest.mark.parametrize("setup", [*SETUPS, *TEXTURED])
def test_materials_look_as_in_cycles(scene, setup: Callable[[Any], None]) -> None:
    material = new_red()
    mesh = scene.objects["Cube"].data
    mesh.materials.append(material)
    paint(mesh)
    setup(material)
    check(scene)


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
@pytest.mark.parametrize("kind", ["FLOAT_COLOR", "BYTE_COLOR"])
def test_painted_meshes_look_as_in_cycles(scene, domain: str, kind: str) -> None:
    material = new_red()
    mesh = scene.objects["Cube"].data
    mesh.materials.append(material)
    painted_plainly(material)
    attribute = paint(mesh, domain, kind)
    first = check(scene)
    for item in attribute.data:
        item.color = (0.1, 0.2, 0.9, 1.0)
    mesh.update()
    assert np.abs(check(scene) - first).max() > 0.2


def test_a_cube_of_fog_is_not_a_black_box(scene) -> None:
    """Fog itself is not shown; objects in it and behind it are."""
    plain = check(scene)
    material = new_red()
    tree = material.node_tree
    output = tree.get_output_node("ALL")
    tree.links.remove(output.inputs["Surface"].links[0])
    tree.links.new(tree.nodes.new("ShaderNodeVolumePrincipled").outputs[0], output.inputs["Volume"])
    bpy.ops.mesh.primitive_cube_add(size=50.0)
    bpy.context.object.data.materials.append(material)
    assert patches(render_passes(scene, "PERFECT_BVH").combined) == pytest.approx(plain, abs=0.03)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("AREA", {"energy": 20.0, "size": 1.0, "spread": 0.7}),
        ("AREA", {"energy": 20.0, "shape": "DISK", "size": 1.5, "spread": 1.6}),
        ("AREA", {"energy": 40.0, "shape": "ELLIPSE", "size": 2.0, "size_y": 0.5, "normalize": False}),
        ("POINT", {"energy": 300.0, "shadow_soft_size": 0.3, "normalize": False}),
        ("SUN", {"energy": 30.0, "angle": 0.3, "normalize": False}),
    ],
)
def test_lights_look_as_in_cycles(scene, kind: str, values: dict[str, Any]) -> None:
    bpy.data.objects.remove(scene.objects["Sun"])
    scene.world.color = (0.0, 0.0, 0.0)
    bpy.ops.object.light_add(type=kind, location=(1.0, -2.0, 4.0), rotation=(0.4, 0.2, 0.0))
    light = bpy.context.object.data
    if not all(hasattr(light, name) for name in values):
        pytest.skip(f"Blender {bpy.app.version_string} has no such setting")
    for name, value in values.items():
        setattr(light, name, value)
    assert check(scene).max() > 0.2


@pytest.mark.parametrize(
    ("kind", "inputs"),
    [("ShaderNodeBlackbody", {"Temperature": 2500.0}), ("ShaderNodeLightFalloff", {"Strength": 3.0})],
)
def test_a_lights_own_nodes_count(scene, kind: str, inputs: dict[str, float]) -> None:
    bpy.data.objects.remove(scene.objects["Sun"])
    scene.world.color = (0.0, 0.0, 0.0)
    bpy.ops.object.light_add(type="POINT", location=(1.0, -2.0, 4.0))
    light = bpy.context.object.data
    light.energy, light.use_nodes = 100.0, True
    tree = light.node_tree
    emission = tree.nodes["Emission"]
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], emission.inputs["Color" if kind == "ShaderNodeBlackbody" else "Strength"])
    unused = tree.nodes.new("ShaderNodeEmission")  # its output is not linked
    unused.inputs["Strength"].default_value = 50.0
    assert check(scene).max() > 0.2


def test_an_edit_inside_a_group_and_of_a_mapping_shows_in_the_next_render(scene) -> None:
    material = new_red()
    scene.objects["Cube"].data.materials.append(material)
    tiled(material)
    first = check(scene)
    mapping = next(node for node in material.node_tree.nodes if node.type == "MAPPING")
    mapping.inputs["Scale"].default_value = (2.0, 2.0, 1.0)
    second = check(scene)
    assert np.abs(first - second).max() > 0.1


MULTIPLE = bpy.app.version >= (5, 0, 0)


def new_sky(scene: bpy.types.Scene, model: str, strength: float) -> Any:
    """Make a Sky Texture node the world's background."""
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    sky, background = tree.nodes.new("ShaderNodeTexSky"), tree.nodes["Background"]
    sky.sky_type, background.inputs["Strength"].default_value = model, strength
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    return sky


@pytest.mark.parametrize(
    ("strength", "settings"),
    [
        (0.03, {"sun_elevation": 0.6, "sun_rotation": 0.8}),
        (0.03, {"sun_elevation": 0.5, "sun_rotation": -2.0, "altitude": 3000.0, "air_density": 2.0}),
        (0.08, {"sun_elevation": 0.15, "sun_rotation": 2.0}),
        (0.08, {"sun_elevation": 0.5, "sun_disc": False}),
    ],
)
@pytest.mark.parametrize("model", ["SINGLE_SCATTERING", "MULTIPLE_SCATTERING"] if MULTIPLE else ["NISHITA"])
def test_a_sky_lights_as_in_cycles(scene, model: str, strength: float, settings: dict[str, Any]) -> None:
    """The sun's brightness, colour and position agree."""
    bpy.data.objects.remove(scene.objects["Sun"])
    scene.camera.rotation_euler.x = 1.45
    sky = new_sky(scene, model, strength)
    for name, value in settings.items():
        setattr(sky, name, value)
    ours, theirs = render_both(scene)
    ground, heaven = np.s_[-3:], np.s_[:2]
    for part in (ground, heaven):
        assert ours[part].mean(axis=(0, 1)) == pytest.approx(theirs[part].mean(axis=(0, 1)), rel=0.02)
    assert np.abs(ours - theirs)[ground].mean() < 0.02


def test_a_backdrop_for_the_camera_alone_looks_as_in_cycles(scene) -> None:
    """Studio pictures use this: one background gives the light, and the camera sees another one."""
    scene.camera.rotation_euler.x = 1.45
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    scene.world.use_nodes = True
    first, second = tree.nodes["Background"], tree.nodes.new("ShaderNodeBackground")
    first.inputs["Color"].default_value, second.inputs["Color"].default_value = (
        (0.2, 0.3, 0.5, 1.0),
        (0.9, 0.3, 0.1, 1.0),
    )
    mix = tree.nodes.new("ShaderNodeMixShader")
    camera_rays = tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
    for place, output in enumerate((camera_rays, first.outputs[0], second.outputs[0])):
        tree.links.new(output, mix.inputs[place])
    tree.links.new(mix.outputs[0], tree.get_output_node("ALL").inputs["Surface"])
    assert check(scene)[0, 0] == pytest.approx((0.9, 0.3, 0.1), rel=0.01)
