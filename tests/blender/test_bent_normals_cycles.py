"""Normals that nodes have bent away from the mesh's, under suns at all heights, compared with Cycles.

Light that only one of the two normals faces is not seen. Diffuse light gets weaker the lower it comes over the mesh.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIZE = 8
SAMPLES = 4
BENT = [0.5, 20, 45, 75]  # degrees; at the last, Cycles bends the normal of translucent and glossy light back
HEIGHTS = [70, 25, 6, -15]  # degrees of the sun over the plane, on the side that the normal leans to
KINDS = ["BsdfDiffuse", "BsdfTranslucent", "BsdfSheen", "BsdfGlossy"]


@pytest.fixture
def scene() -> Iterator[Any]:
    """A level plane, seen from straight above, and a sun."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=4.0)
    bpy.ops.object.light_add(type="SUN")
    light = bpy.context.object.data
    light.angle, light.energy = 0.0, math.pi
    bpy.ops.object.camera_add(location=(0.0, 0.0, 5.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.9
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def bend(kind: str) -> Any:
    """Give the plane a shader whose normal a node bends; return that node's colour."""
    material = bpy.data.materials.new("Surface")
    material.use_nodes = True
    tree = material.node_tree
    node, bent = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new("ShaderNodeNormalMap")
    bent.space = "WORLD"
    if kind == "BsdfGlossy":
        node.inputs["Roughness"].default_value = 0.7
    tree.links.new(bent.outputs["Normal"], node.inputs["Normal"])
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    bpy.data.objects["Plane"].data.materials.append(material)
    return bent.inputs["Color"]


@pytest.mark.parametrize("is_opposite", [False, True], ids=["towards", "away"])
@pytest.mark.parametrize("kind", KINDS)
def test_bent_normals_are_lit_as_in_cycles(scene: Any, kind: str, is_opposite: bool) -> None:
    color = bend(kind)
    ours, theirs = [], []
    for angle in map(math.radians, BENT):
        lean = -math.sin(angle) if is_opposite else math.sin(angle)
        color.default_value = (0.5 + 0.5 * lean, 0.5, 0.5 + 0.5 * math.cos(angle), 1.0)
        for height in HEIGHTS:
            bpy.data.objects["Sun"].rotation_euler = (0.0, math.radians(90.0 - height), 0.0)
            images = render_beside(scene, SAMPLES)
            for image, means in zip(images, (ours, theirs), strict=True):
                means.append(float(image[..., 0].mean()))
    assert max(theirs) > 0.03, "the suns light nothing"
    np.testing.assert_allclose(ours, theirs, rtol=0.02, atol=0.002)


def test_bumps_are_as_wide_in_bounced_light_as_in_cycles(scene: Any) -> None:
    """A room with uneven walls, in which light bounces often: a pixel is as wide as the whole path is long."""
    for name in ("Plane", "Sun"):
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    room = bpy.context.object
    material = bpy.data.materials.new("Wall")
    material.use_nodes = True
    tree = material.node_tree
    wall, bump, noise = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfDiffuse", "Bump", "TexNoise"))
    place = tree.nodes.new("ShaderNodeTexCoord")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 12.0, 0.0
    bump.inputs["Distance"].default_value = 0.3
    for source, target in (
        (place.outputs["Object"], noise.inputs["Vector"]),
        (noise.outputs[0], bump.inputs["Height"]),
        (bump.outputs[0], wall.inputs["Normal"]),
        (wall.outputs[0], tree.nodes["Material Output"].inputs["Surface"]),
    ):
        tree.links.new(source, target)
    room.data.materials.append(material)
    bpy.ops.object.light_add(type="POINT", location=(0.5, 0.2, 0.4))
    bpy.context.object.data.energy = 100.0
    scene.camera.data.type, scene.camera.location = "PERSP", (-1.0, -0.7, 1.2)
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 12
    ours, theirs = (image[..., :3].mean() for image in render_beside(scene, 1024))
    assert theirs > 0.1
    assert ours == pytest.approx(theirs, rel=0.02)
