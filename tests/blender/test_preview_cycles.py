"""Visibility and shadows of objects in the mode "preview", compared with Cycles' picture of the same scene.

Alpha depends only on the surfaces that the camera sees, so it is compared pixel by pixel. Colour is compared as the
mean of small patches, in which the noise of both is small.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

from blender.builders import SQUARE, instances_on_grid, mesh_data, mesh_object, object_info  # noqa: E402
from blender.spheres import add_uv_sphere  # noqa: E402
from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mathutils import Vector  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402

SIZE = (96, 64)
PATCH = 8
SAMPLES = 64


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    """Two cubes on a floor, one behind the other, under a low sun and a grey sky; the camera looks down on them."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60.0)
    paint(bpy.context.object, (0.6, 0.6, 0.6))
    for name, y, color in (("Front", -1.5, (0.7, 0.1, 0.1)), ("Back", 1.8, (0.1, 0.2, 0.7))):
        bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, y, 1.0), rotation=(0.0, 0.0, 0.3))
        bpy.context.object.name = name
        paint(bpy.context.object, color)
    bpy.ops.object.light_add(type="SUN", rotation=(0.2, -0.9, 0.0))
    bpy.context.object.data.energy = 3.0
    bpy.ops.object.camera_add(location=(0.0, -11.0, 7.0), rotation=(1.2, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.3, 0.3, 0.3)
    scene.world.use_nodes = False
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = SAMPLES, False
    return scene


def paint(obj: bpy.types.Object, color: tuple[float, float, float]) -> None:
    """Paint the object matt, so that Cycles' picture has no highlights either."""
    material = bpy.data.materials.new(obj.name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (*color, 1.0)
    material.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    obj.data.materials.append(material)


def render_both(scene: bpy.types.Scene) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return our image and Cycles', (H, W, 4) each."""
    return render_beside(scene, SAMPLES)


def patches(image: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(H / PATCH, W / PATCH, 3): the mean colour of each patch."""
    height, width = image.shape[0] // PATCH, image.shape[1] // PATCH
    return image[..., :3].reshape(height, PATCH, width, PATCH, 3).mean(axis=(1, 3))


def check(
    scene: bpy.types.Scene, alpha_tolerance: float = 0.1
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """alpha_tolerance: for a single pixel."""
    ours, theirs = render_both(scene)
    # Both filters have the same width, but other samples: a pixel on an edge differs a little.
    assert np.abs(ours[..., 3] - theirs[..., 3]).max() < alpha_tolerance
    assert np.abs(ours[..., 3] - theirs[..., 3]).mean() < 0.002
    alphas = (np.repeat(image[..., 3:], 3, axis=2) for image in (ours, theirs))
    assert np.abs(np.subtract(*map(patches, alphas))).max() < 0.06
    difference = np.abs(patches(ours) - patches(theirs))
    assert difference.max() < 0.06
    assert difference.mean() < 0.006
    return ours, theirs


def front(scene: bpy.types.Scene) -> bpy.types.Object:
    return scene.objects["Front"]


def hide_from_cameras(scene: bpy.types.Scene) -> None:
    front(scene).visible_camera = False


def hide_from_shadows(scene: bpy.types.Scene) -> None:
    front(scene).visible_shadow = False


def hide_from_diffuse(scene: bpy.types.Scene) -> None:
    front(scene).visible_diffuse = False


def hold_out(scene: bpy.types.Scene) -> None:
    front(scene).is_holdout = True


def hold_out_by_shader(scene: bpy.types.Scene) -> None:
    tree = front(scene).active_material.node_tree
    hole = tree.nodes.new("ShaderNodeHoldout")
    tree.links.new(hole.outputs[0], tree.nodes["Material Output"].inputs["Surface"])


def hold_out_in_part(scene: bpy.types.Scene, share: float = 0.4, other: str = "ShaderNodeBsdfDiffuse") -> None:
    """Mix a holdout with the cube's original shader, or with another one."""
    tree = front(scene).active_material.node_tree
    surface = tree.nodes["Material Output"].inputs["Surface"]
    beside = surface.links[0].from_node if other == "ShaderNodeBsdfDiffuse" else tree.nodes.new(other)
    mix, hole = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeHoldout")
    mix.inputs[0].default_value = share
    tree.links.new(beside.outputs[0], mix.inputs[1])
    tree.links.new(hole.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], surface)


def hold_out_with_air(scene: bpy.types.Scene) -> None:
    hold_out_in_part(scene, other="ShaderNodeBsdfTransparent")


def move_to_collection(scene: bpy.types.Scene) -> bpy.types.LayerCollection:
    collection = bpy.data.collections.new("Apart")
    scene.collection.children.link(collection)
    collection.objects.link(front(scene))
    scene.collection.objects.unlink(front(scene))
    return scene.view_layers[0].layer_collection.children["Apart"]


def hold_out_collection(scene: bpy.types.Scene) -> None:
    move_to_collection(scene).holdout = True


def show_collection_indirectly(scene: bpy.types.Scene) -> None:
    move_to_collection(scene).indirect_only = True


CASES = [
    hide_from_cameras,
    hide_from_shadows,
    hide_from_diffuse,
    hold_out,
    hold_out_collection,
    hold_out_by_shader,
    hold_out_in_part,
    hold_out_with_air,
    show_collection_indirectly,
]


@pytest.mark.parametrize(
    ("change", "film_transparent"),
    [
        *((case, False) for case in CASES),
        *((case, True) for case in (hide_from_cameras, hold_out, hold_out_by_shader, hold_out_in_part)),
    ],
)
def test_what_is_hidden_or_held_out_looks_as_in_cycles(scene, change, film_transparent: bool) -> None:
    scene.render.film_transparent = film_transparent
    plain, _ = check(scene)
    change(scene)
    # In air Cycles leaves to chance, sample by sample, which shader a ray meets: five standard deviations of the mean.
    left_to_chance = 5.0 * 0.5 / SAMPLES**0.5
    changed, _ = check(scene, left_to_chance if change is hold_out_with_air else 0.1)
    assert np.abs(changed - plain).max() > 0.02, "the change shows"
    if change in (hold_out_in_part, hold_out_with_air):
        left = 0.6 if change is hold_out_in_part else 0.6 * 0.6  # a look through air meets the cube's back as well
        assert (np.abs(changed[..., 3] - left) < 0.01).mean() > 0.05
    elif change in (hold_out, hold_out_collection, hold_out_by_shader):
        assert 0.05 < (changed[..., 3] < 0.01).mean() < 0.5
    elif not film_transparent:
        assert (changed[..., 3] > 0.999).all()


# Surfaces that a sharp mirror shows get no light from a second bounce.
@pytest.mark.parametrize(
    ("metallic", "roughness", "tolerance"),
    [(1.0, 0.05, 0.2), (1.0, 0.3, 0.08), (1.0, 0.6, 0.08), (0.0, 0.1, 0.08), (0.0, 0.5, 0.08)],
)
def test_shiny_things_shine_as_in_cycles(scene, metallic: float, roughness: float, tolerance: float) -> None:
    """A sphere in front of cubes, under an area light: highlights and reflections."""
    add_uv_sphere(radius=1.3, location=(3.2, 0.5, 1.3), segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("Shiny")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (0.8, 0.55, 0.2, 1.0)
    inputs["Metallic"].default_value, inputs["Roughness"].default_value = metallic, roughness
    bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="AREA", location=(-2.0, -6.0, 5.0), rotation=(0.9, 0.0, -0.6))
    bpy.context.object.data.energy, bpy.context.object.data.size = 300.0, 2.0
    bpy.context.view_layer.update()
    place = world_to_camera_view(scene, scene.camera, Vector((3.2, 0.5, 1.3)))
    column, row = int(place.x * SIZE[0] / PATCH), int((1.0 - place.y) * SIZE[1] / PATCH)
    ours, theirs = (patches(np.minimum(image, 2.0)) for image in render_both(scene))
    ball = np.s_[row - 1 : row + 2, column - 1 : column + 2]
    assert np.abs(ours - theirs).mean() < 0.01
    assert np.abs(ours - theirs)[ball].mean() < tolerance * theirs[ball].mean()


def test_emission_lights_as_in_cycles(scene) -> None:
    """The only light is a small bright sphere between the cubes; its light is compared, and there are no specks."""
    bpy.data.objects.remove(scene.objects["Sun"])
    scene.world.color = (0.0, 0.0, 0.0)
    bpy.ops.mesh.primitive_ico_sphere_add(radius=0.1, location=(-2.0, -3.0, 1.5), subdivisions=2)
    paint(bpy.context.object, (0.0, 0.0, 0.0))
    tree = bpy.context.object.active_material.node_tree
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Strength"].default_value = 1000.0
    tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    ours, theirs = (np.minimum(patches(image), 1.0) for image in render_both(scene))
    assert np.abs(ours - theirs).mean() < 0.03 * theirs.mean()
    assert np.abs(ours - theirs).max() < 0.03


def test_a_holdout_behind_glass_stays_a_hole(scene) -> None:
    """A transparent pane is there by half, and the held-out object behind it is not there at all."""
    bpy.ops.mesh.primitive_plane_add(size=9.0, location=(0.0, -4.0, 2.0), rotation=(1.2, 0.0, 0.0))
    paint(bpy.context.object, (0.2, 0.6, 0.2))
    tree = bpy.context.object.active_material.node_tree
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    output = tree.nodes["Material Output"]
    tree.links.new(output.inputs["Surface"].links[0].from_socket, mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    hold_out(scene)
    ours, _ = check(scene)
    half = np.abs(ours[..., 3] - 0.5) < 0.02
    assert half.mean() > 0.05


def shown_by_nodes(lamp: bpy.types.Object) -> bpy.types.Object:
    return instances_on_grid("Lamps", object_info(lamp))


def shown_by_vertices(lamp: bpy.types.Object) -> bpy.types.Object:
    lamp.parent = parent = mesh_object("Lamps", mesh_data("Lamps", *SQUARE))
    parent.instance_type = "VERTS"
    return parent


@pytest.mark.parametrize("show", [shown_by_nodes, shown_by_vertices])
def test_lights_that_are_instanced_shine_as_in_cycles(scene, show) -> None:
    alone, _ = render_both(scene)
    bpy.ops.object.light_add(type="POINT", location=(0.0, 0.0, -2.0))
    lamp = bpy.context.object
    lamp.data.energy, lamp.data.shadow_soft_size = 60.0, 0.5
    show(lamp).location = (0.0, 0.0, 4.0)
    ours, _ = check(scene)
    assert ours[..., :3].mean() > 1.05 * alone[..., :3].mean()


@pytest.mark.parametrize(
    ("angle", "tilt", "is_normalized"), [(0.6, 0.0, True), (0.6, 1.4, True), (2.0, 0.8, True), (0.6, 0.3, False)]
)
def test_wide_suns_light_as_in_cycles(scene, angle: float, tilt: float, is_normalized: bool) -> None:
    """All of their directions are equally bright, also if a part of them is below the surface."""
    for name in ("Front", "Back"):
        bpy.data.objects.remove(scene.objects[name])
    scene.world = None
    sun = scene.objects["Sun"]
    sun.data.angle, sun.rotation_euler = angle, (0.0, tilt, 0.0)
    if not is_normalized and not hasattr(sun.data, "normalize"):
        pytest.skip("lights are always normalized before Blender 4.5")
    if hasattr(sun.data, "normalize"):
        sun.data.normalize = is_normalized
    ours, theirs = (image[-SIZE[1] // 2 :, :, :3].mean() for image in render_both(scene))
    assert theirs > 0.01
    assert ours == pytest.approx(theirs, rel=0.003)
