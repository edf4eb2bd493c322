"""Normals of coarse smooth meshes with custom corner normals, down to grazing angles, compared with Cycles.

Diffuse lobes have the corners' interpolated normal in both. For glossy lobes both bend the normal if the mirror image
would lie below the surface, just far enough that it lies above. Cycles' pass Normal has the mean over the lobes of a
surface. Ours has the mesh's normal, independent of the lobes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import new_red, shader  # noqa: E402
from oracles.cycles import FILTER_WIDTH, index_edges, preserved, render_beside, render_passes  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

Vectors = npt.NDArray[np.float64]
SIZE = (160, 120)
EYE_HEIGHTS = [0.4, 3.0]
PATCH, SAMPLES = 8, 32
MATERIALS: dict[str, dict[str, Any]] = {
    "sharp metal": {"Metallic": 1.0, "Roughness": 0.1},
    "metal": {"Metallic": 1.0, "Roughness": 0.3},
    "plastic": {"Specular IOR Level": 0.5, "Roughness": 0.2},
    "glass": {"Transmission Weight": 1.0, "Roughness": 0.1},
}


@pytest.fixture(params=EYE_HEIGHTS)
def scene(request: Any) -> Iterator[Any]:
    """A mesh of large faces like waves, with corner normals turned at random, from low above and from higher up."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=7, y_subdivisions=7, size=12.0)
    mesh = bpy.context.object.data
    rng = np.random.default_rng(5)
    for vertex in mesh.vertices:
        vertex.co.z = rng.uniform(-0.1, 0.1)
    mesh.shade_smooth()
    normals = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.6, 0.6, (len(mesh.loops), 3))
    mesh.normals_split_custom_set((normals / np.linalg.norm(normals, axis=1, keepdims=True)).tolist())
    mesh.materials.append(new_red("Surface"))
    bpy.ops.object.camera_add(location=(0.0, -9.0, request.param), rotation=(np.arctan2(9.0, request.param), 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def normals_of_both(scene: Any) -> tuple[Vectors, Vectors, npt.NDArray[np.bool_]]:
    """Return both normals, (H, W, 3), and a mask of pixels where both see the surface, away from its outline."""
    with preserved(
        (scene.cycles, "samples", 1),
        (scene.cycles, "use_denoising", False),
        (scene.cycles, "filter_width", FILTER_WIDTH),
        (scene.cycles, "max_bounces", 0),
    ):
        ours, theirs = (render_passes(scene, engine) for engine in ("PERFECT_BVH", "CYCLES"))
    depths = [np.minimum(passes.depth, 1e3) for passes in (ours, theirs)]
    seen = (depths[0] < 1e3) & (depths[1] < 1e3) & (np.abs(depths[0] - depths[1]) < 1e-3)
    return (
        np.float64(ours.normal),
        np.float64(theirs.normal),
        seen & ~index_edges(*(np.float32(d < 1e3) for d in depths)),
    )


def angles(one: Vectors, other: Vectors) -> Vectors:
    """Return degrees between vectors."""
    sizes = np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1)
    cosines = (one * other).sum(axis=-1) / np.maximum(sizes, 1e-12)  # there are none on the background
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


def bent(normals: Vectors, flat: Vectors, view: Vectors) -> Vectors:
    """Normals turned towards the triangle's own until the mirror image of the view lies above it.

    In the plane of both normals, at the angle a from the flat one: the image's height is that of the view turned by
    twice a, r cos(2 a - p), where the view is r (sin p, cos p) in that plane.
    """
    height = (view * flat).sum(axis=-1)
    image = 2.0 * (normals * view).sum(axis=-1, keepdims=True) * normals - view
    least = np.minimum(0.9 * height, 0.01)
    across = normals - (normals * flat).sum(axis=-1, keepdims=True) * flat
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
    side = (view * across).sum(axis=-1)
    radius = np.hypot(side, height)
    angle = (
        0.5 * (np.arctan2(side, height) + np.arccos(np.clip(least / np.maximum(radius, 1e-12), -1.0, 1.0)))[..., None]
    )
    is_below = (image * flat).sum(axis=-1) < least
    return np.where(is_below[..., None], np.sin(angle) * across + np.cos(angle) * flat, normals)


def flatten(scene: Any) -> Vectors:
    """Flatten the mesh and return the triangles' own normals towards the viewer, (H, W, 3)."""
    mesh = bpy.data.objects["Grid"].data
    mesh.attributes.remove(mesh.attributes["custom_normal"])
    mesh.shade_flat()
    return normals_of_both(scene)[0]


def view_of(scene: Any) -> Vectors:
    """Return unit vectors from each pixel's surface to the camera, (H, W, 3)."""
    width, height = SIZE
    corners = np.array([tuple(corner) for corner in scene.camera.data.view_frame(scene=scene)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    x = low[0] + (np.arange(width) + 0.5) / width * (high[0] - low[0])
    y = high[1] - (np.arange(height) + 0.5) / height * (high[1] - low[1])
    local = np.stack([*np.meshgrid(x, y), np.full((height, width), corners[0, 2])], axis=-1)
    view = -local @ np.array(scene.camera.matrix_world.to_3x3()).T
    return view / np.linalg.norm(view, axis=-1, keepdims=True)


def test_the_normal_of_what_is_diffuse_is_cycles(scene: Any) -> None:
    ours, theirs, seen = normals_of_both(scene)
    assert seen.sum() > 1000
    off = angles(ours, theirs)[seen]
    assert np.percentile(off, 99.8) < 0.05


def test_cycles_writes_the_bent_normal_of_what_is_glossy_and_ours_is_the_meshs(scene: Any) -> None:
    plain, _, _ = normals_of_both(scene)
    inputs = shader(bpy.data.materials["Surface"]).inputs
    inputs["Metallic"].default_value, inputs["Roughness"].default_value = 1.0, 0.2
    ours, theirs, seen = normals_of_both(scene)
    np.testing.assert_array_equal(ours, plain)
    flat = flatten(scene)
    off = angles(ours, theirs)[seen]
    assert np.count_nonzero(off > 5.0) > 100, "the mesh is no example of it"
    assert np.percentile(angles(bent(ours, flat, view_of(scene)), theirs)[seen], 99.8) < 0.05


def surround(scene: Any) -> None:
    """A world with a distinct colour for each direction."""
    image = bpy.data.images.new("Around", 32, 16, float_buffer=True)
    row, column = np.mgrid[0:16, 0:32]
    around = column / 32.0 * 2.0 * np.pi
    colors = [0.2 + row * 0.05, 0.5 + 0.4 * np.sin(around), 0.6 + 0.3 * np.cos(2.0 * around), np.ones_like(around)]
    image.pixels.foreach_set(np.stack(colors, axis=-1).astype(np.float32).ravel())
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])


@pytest.mark.parametrize("name", MATERIALS)
def test_what_is_glossy_mirrors_what_it_does_in_cycles(scene: Any, name: str) -> None:
    """With the mesh's own normal it would be darker by 3 to 12 %: reflections into the surface are lost."""
    surround(scene)
    inputs = shader(bpy.data.materials["Surface"]).inputs
    for key, value in {"Base Color": (0.8, 0.7, 0.6, 1.0), **MATERIALS[name]}.items():
        inputs[key].default_value = value
    ours, theirs = render_beside(scene, SAMPLES)
    assert ours[..., :3].mean() == pytest.approx(theirs[..., :3].mean(), rel=0.01)
    shape = (SIZE[1] // PATCH, PATCH, SIZE[0] // PATCH, PATCH, 4)
    difference = np.abs((ours - theirs).reshape(shape).mean(axis=(1, 3)))
    assert difference.mean() < 0.005
