"""Depth, normal and index passes, pixel by pixel, against those of Cycles.

A pixel is alike if depths agree within 1e-4, normals within one degree, and indices exactly. Pixels within one
pixel of an edge in Cycles' index pass are left out, for Cycles' ray is up to 0.005 pixels off the pixel's centre.
Inside an object a few pixels may differ. For each of them the double-precision judge must find the engine's own hit
right or ambiguous. Cycles is wrong on slivers of 18 m by 9 mm seen at four degrees, where its depth is off by
millimetres. A hit is ambiguous if it lies within the judge's margin of an edge that the index pass does not show, or
where two triangles coincide, as in the walls of the sea. Which of such pixels differ depends on the processor that
Cycles runs on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.judged_pixels import cast_through, judge_pixels  # noqa: E402
from mathutils import Matrix  # noqa: E402
from oracles.cycles import (  # noqa: E402
    Passes,
    Surfaces,
    index_edges,
    preserved,
    render_cycles,
    render_cycles_uvs,
    render_passes,
    write_multilayer,
)
from oracles.exr import read_exr  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.live.sync_cache import syncs_of  # noqa: E402

# The judge here supports triangles only: hair and points are compared in `test_meadow.py`.
FILES = (Path(__file__).resolve().parents[2] / "blend_scenes").glob("*.blend")
SCENES = sorted(path.stem for path in FILES if path.stem != "meadow")
# Failure cases that Cycles itself handles.
ZOO = (
    "teapot_in_stadium",
    "ground_under_gravel",
    "far_clusters",
    "diagonal_sticks",
    "interleaved_instances",
    "skewed_matrices",
    "explosion",
    "twist",
    "equal_counts",
    "topology_on_some_frames",
    "non_finite_vertices",
    "deleted_objects",
)
DEPTH_TOLERANCE = 1e-4
NORMAL_TOLERANCE = np.cos(np.radians(1.0))
BACKGROUND = 1e9
DISPUTED_SHARE = 2.5e-4


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    """An empty scene with a camera 12 units away that looks at the origin from the front, somewhat above."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (2.0, -11.0, 5.0), (1.17, 0.0, 0.18)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


# Comparison --------------------------------------------------------------------------------------------------------


def unlike(ours: Surfaces, theirs: Surfaces) -> npt.NDArray[np.bool_]:
    """Return where the passes differ by more than the tolerances; arrays have one shape, or broadcast."""
    hit, hit_ours = theirs.depth < BACKGROUND, ours.depth < BACKGROUND
    depth = np.abs(ours.depth - theirs.depth) > DEPTH_TOLERANCE * np.abs(theirs.depth)
    # A normal of no length has no direction to compare: on the background, and of triangles without area.
    normal = hit & ~((ours.normal * theirs.normal).sum(-1) >= NORMAL_TOLERANCE)
    index = (ours.object_index != theirs.object_index) | (ours.material_index != theirs.material_index)
    return (hit != hit_ours) | (hit & depth) | normal | index


@dataclass(frozen=True, slots=True)
class Comparison:
    """compared: pixels away from index edges. disputed: those that differ. wrong: disputed, and the engine's fault."""

    ours: Passes
    theirs: Surfaces
    compared: int
    disputed: list[tuple[int, int]]
    wrong: list[tuple[int, int]]


def compare(scene: bpy.types.Scene, size: tuple[int, int] = (320, 180)) -> Comparison:
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.perfect_bvh.samples = 1
    for ids in (bpy.data.objects, bpy.data.materials):
        for index, item in enumerate(ids, 1):
            item.pass_index = index
    theirs = render_cycles(scene)
    ours = render_passes(scene, "PERFECT_BVH")
    inside = ~index_edges(theirs.object_index)
    disputed = [(int(x), int(y)) for y, x in np.argwhere(unlike(ours, theirs) & inside)]
    sync = syncs_of(scene)[-1]
    wrong = wrong_pixels(sync, disputed) if disputed else []
    return Comparison(ours, theirs, int(inside.sum()), disputed, wrong)


def wrong_pixels(sync: perfect_bvh_addon.SceneSync, pixels: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the pixels at whose centres the engine's hit is neither right nor ambiguous."""
    verdict = judge_pixels(sync, pixels, cast_through(sync, pixels))
    return [pixel for pixel, is_wrong in zip(pixels, verdict.wrong, strict=True) if is_wrong]


def check(scene: bpy.types.Scene, *, objects: int, size: tuple[int, int] = (320, 180)) -> Comparison:
    """Compare the passes. objects: the least number of distinct objects that must be visible."""
    result = compare(scene, size)
    assert result.wrong == []
    assert len(result.disputed) <= DISPUTED_SHARE * size[0] * size[1]
    assert result.compared > 0.2 * size[0] * size[1]
    assert len(np.unique(result.theirs.object_index)) - 1 >= objects
    return result


def test_the_judge_of_pixels_tells_wrong_hits(scene) -> None:
    """Hits that are moved, of another triangle, or missing are wrong at each pixel; the engine's own hits are right."""
    add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, radius=2.0)
    add("Wall", bpy.ops.mesh.primitive_plane_add, size=9.0, location=(0.0, 5.0, 0.0), rotation=(1.5, 0.0, 0.0))
    scene.render.resolution_x, scene.render.resolution_y, scene.perfect_bvh.samples = 96, 54, 1
    render_passes(scene, "PERFECT_BVH")
    sync = syncs_of(scene)[-1]
    width, height = sync.size
    pixels = [(width // 2 + x, height // 2 + y) for x in range(-9, 10, 3) for y in range(-9, 10, 3)]
    hits = cast_through(sync, pixels)
    assert hits.is_hit.all()
    assert not judge_pixels(sync, pixels, hits).wrong.any()
    assert wrong_pixels(sync, pixels) == []
    nothing = np.full(len(pixels), -1)
    lies = (
        {"t_hit": hits.t_hit * np.float32(1.001)},
        {"primitive_ids": hits.primitive_ids + 7},
        {"instance_ids": nothing, "primitive_ids": nothing, "t_hit": np.full(len(pixels), np.inf)},
    )
    for lie in lies:
        told = replace(hits, columns={**hits.columns, **lie})
        assert judge_pixels(sync, pixels, told).wrong.all()


# Scenes ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_scenes_look_the_same_to_cycles(name: str, scene, blend_file: Callable[[str], Path]) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend_file(name)))
    scene = bpy.context.scene
    for frame in sampled_frames(scene):
        scene.frame_set(frame)
        check(scene, objects=2)


@pytest.mark.parametrize("name", ZOO)
def test_failure_cases_look_the_same_to_cycles(name: str, scene, blend_file: Callable[[str], Path]) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend_file(f"zoo/{name}")))
    scene = bpy.context.scene
    for frame in sampled_frames(scene):
        scene.frame_set(frame)
        for obj in scene.objects:  # Cycles shows nothing flattened by a matrix without an inverse if its mesh is shared
            is_flat = obj.type == "MESH" and obj.matrix_world.to_3x3().determinant() == 0.0
            obj.hide_render = is_flat and obj.data.users > 1
        check(scene, objects=0, size=(160, 90))


def sampled_frames(scene: bpy.types.Scene) -> list[int]:
    """Return the first frame, the one in the middle and the last."""
    return sorted({scene.frame_start, (scene.frame_start + scene.frame_end) // 2, scene.frame_end})


def add(name: str, mesh_operator: Callable[..., object], **arguments: object) -> bpy.types.Object:
    mesh_operator(**arguments)
    obj = bpy.context.object
    obj.name = name
    return obj


def add_row(count: int, make: Callable[[float], bpy.types.Object]) -> list[bpy.types.Object]:
    return [make((index - (count - 1) / 2) * 9.0 / count) for index in range(count)]


@pytest.mark.parametrize("projection", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("size", [(160, 90), (90, 160)])
def test_cameras(scene, projection: str, fit: str, size: tuple[int, int]) -> None:
    camera = scene.camera.data
    camera.type, camera.sensor_fit = projection, fit
    camera.lens, camera.ortho_scale, camera.sensor_width, camera.sensor_height = 28.0, 9.0, 30.0, 22.0
    camera.shift_x, camera.shift_y = 0.13, -0.21
    camera.clip_start, camera.clip_end = 11.0, 17.0
    scene.camera.scale = (2.0, 0.5, 3.0)
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 1.4
    add("Floor", bpy.ops.mesh.primitive_plane_add, size=30.0)
    add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, radius=2.0, location=(0.0, 0.0, 1.0))
    result = check(scene, objects=2, size=size)
    assert (result.theirs.depth[result.theirs.depth < BACKGROUND] >= 11.0).all()


@pytest.mark.parametrize("mode", ["PREVIEW", "MATCAP"])
@pytest.mark.parametrize(
    ("part", "shift", "size"),
    [
        ((-np.pi, np.pi, -np.pi / 2, np.pi / 2), (0.0, 0.0), (192, 96)),
        ((-1.9, 2.4, -0.9, 1.2), (0.1, -0.2), (120, 160)),
    ],
    ids=["whole", "part"],
)
def test_panoramas(
    scene, mode: str, part: tuple[float, ...], shift: tuple[float, float], size: tuple[int, int]
) -> None:
    camera = scene.camera.data
    camera.type = "PANO"
    settings = panorama_settings(camera)
    settings.panorama_type = "EQUIRECTANGULAR"
    settings.longitude_min, settings.longitude_max, settings.latitude_min, settings.latitude_max = part
    camera.shift_x, camera.shift_y = shift
    camera.clip_start, camera.clip_end = 1.5, 17.0
    scene.camera.scale, scene.camera.rotation_euler = (2.0, 0.5, 3.0), (1.3, 0.2, 0.4)
    scene.perfect_bvh.mode = mode
    add("Floor", bpy.ops.mesh.primitive_plane_add, size=60.0)
    for x, y, z in ((0.0, 0.0, 1.0), (2.0, -16.0, 4.0), (8.0, -12.0, 7.0), (-5.0, -11.0, 6.0), (2.0, -11.0, 9.5)):
        ball = add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, radius=1.8, location=(x, y, z))
        ball.data.shade_smooth()
    result = check(scene, objects=4, size=size)
    nearest, farthest = result.theirs.depth.min(), result.theirs.depth[result.theirs.depth < BACKGROUND].max()
    assert nearest >= 1.5
    assert farthest <= 17.0
    assert (result.theirs.object_index == 0).any()


def test_uvs_are_those_of_cycles(scene) -> None:
    """Compare the mode's picture with Cycles' pass UV: with a map, one that exceeds 0 to 1, and none."""
    floor = add("Floor", bpy.ops.mesh.primitive_grid_add, x_subdivisions=9, y_subdivisions=7, size=12.0)
    for corner in floor.data.uv_layers.active.data:
        corner.uv = corner.uv * 3.0 - corner.uv.yx
    add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, radius=1.5, location=(1.5, -1.0, 1.6))
    bare = add("Bare", bpy.ops.mesh.primitive_cube_add, size=2.0, location=(-2.5, 0.0, 1.0))
    bare.data.uv_layers.remove(bare.data.uv_layers.active)
    scene.perfect_bvh.mode = "UV"
    result = check(scene, objects=3)
    theirs = render_cycles_uvs(scene)
    inside = ~index_edges(result.theirs.object_index)
    assert theirs[inside].max() > 1.5
    assert theirs[inside].min() < -0.5
    # Seams run across the sphere where no index changes.
    differs = np.abs(result.ours.combined[..., :3] - theirs).max(axis=-1) > 2e-3
    assert (differs & inside).sum() <= 0.002 * inside.sum()


def test_smooth_flat_mirrored_and_sheared_objects(scene) -> None:
    flat = add("Flat", bpy.ops.mesh.primitive_monkey_add, size=1.6, location=(-3.75, 0.0, 0.0))
    # All smooth ones share one mesh. Of a mesh with a single user Cycles moves the vertices into the world, and
    # blends normals that were each moved and normalised: under an uneven scale that is another smooth surface.
    smooth_mesh = flat.data.copy()
    smooth_mesh.shade_smooth()
    shears = Matrix.Shear("XY", 4, (0.7, 0.3)), Matrix.Shear("XY", 4, (0.0, 0.0))
    scales = ((1.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (0.5, 2.0, 1.5), (1.0, 0.8, 1.2))
    for index, scale in enumerate(scales):
        obj = bpy.data.objects.new(f"Smooth {index}", smooth_mesh)
        obj.matrix_world = Matrix.LocRotScale((index * 1.5 - 2.25, 0.0, 0.0), None, scale) @ shears[index != 3]
        scene.collection.objects.link(obj)
    check(scene, objects=5)


def test_an_object_flattened_by_a_zero_scale(scene) -> None:
    # Open, so that no two of its triangles coincide once it is flat; Cycles shows it only if its mesh has one user.
    hill = add("Hill", bpy.ops.mesh.primitive_grid_add, x_subdivisions=9, y_subdivisions=9, size=5.0)
    for vertex in hill.data.vertices:
        vertex.co.z = 2.0 - 0.2 * vertex.co.xy.length_squared
    hill.data.shade_smooth()
    hill.scale, hill.rotation_euler = (1.0, 0.7, 0.0), (0.9, 0.2, 0.3)
    check(scene, objects=1)


def test_normals_of_backs_sharp_edges_and_custom_ones(scene) -> None:
    def make(x: float) -> bpy.types.Object:
        return add("Cylinder", bpy.ops.mesh.primitive_cylinder_add, radius=0.8, depth=1.5, location=(x, 0.0, 0.0))

    inside_out, sharp, custom, tilted = add_row(4, make)
    inside_out.data.flip_normals()
    sharp.data.shade_smooth()
    sharp.data.set_sharp_from_angle(angle=0.7)
    custom.data.shade_smooth()
    custom.data.normals_split_custom_set([(0.3, -0.8, 0.5)] * len(custom.data.loops))
    tilted.data.shade_smooth()
    tilted.rotation_euler = (0.4, 0.9, 0.2)
    check(scene, objects=4)


def test_every_kind_of_object(scene) -> None:
    makers = (
        lambda x: add("Curve", bpy.ops.curve.primitive_bezier_circle_add, radius=0.7, location=(x, 0.0, 0.0)),
        lambda x: add("Surface", bpy.ops.surface.primitive_nurbs_surface_sphere_add, radius=0.7, location=(x, 0, 0)),
        lambda x: add("Text", bpy.ops.object.text_add, radius=1.5, location=(x, 0.0, 0.0)),
        lambda x: add("Ball", bpy.ops.object.metaball_add, type="BALL", radius=1.0, location=(x, 0.0, 0.0)),
    )
    positions = iter(makers)
    curve, _, text, _ = add_row(4, lambda x: next(positions)(x))
    curve.data.bevel_depth = 0.2
    text.data.body, text.data.extrude, text.rotation_euler = "Bvh", 0.2, (1.2, 0.0, 0.0)
    check(scene, objects=4)


def test_several_materials_and_slots_of_the_object(scene) -> None:
    materials = [bpy.data.materials.new(f"Material {index}") for index in range(4)]
    ball = add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, radius=1.5, location=(-2.0, 0.0, 0.0))
    for material in materials[:3]:
        ball.data.materials.append(material)
    for polygon in ball.data.polygons:
        polygon.material_index = polygon.index // 7 % 5  # two more than there are slots
    other = bpy.data.objects.new("Other", ball.data)
    other.location.x = 2.0
    scene.collection.objects.link(other)
    other.material_slots[1].link = "OBJECT"
    other.material_slots[1].material = materials[3]
    result = check(scene, objects=2)
    assert {1.0, 2.0, 3.0, 4.0} <= set(np.unique(result.theirs.material_index))


@pytest.mark.parametrize("threshold", [0.0, 0.5, 1.0])
def test_passes_are_without_what_has_less_alpha_than_the_threshold(scene, threshold: float) -> None:
    """With alpha above 0 and below the threshold, chance decides if Cycles' pixel has the pane; ours never has it."""
    wall, alphas = (
        add("Wall", bpy.ops.mesh.primitive_cube_add, size=8.0, location=(0.0, 8.0, 0.0)),
        (0.0, 0.3, 0.5, 0.9),
    )
    panes = iter(alphas)

    def make(x: float) -> bpy.types.Object:
        pane = add("Pane", bpy.ops.mesh.primitive_plane_add, location=(x, 0.0, 0.0), rotation=(1.5, 0.0, 0.0))
        pane.data.materials.append(bpy.data.materials.new("Pane"))
        pane.active_material.use_nodes = True
        pane.active_material.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = next(panes)
        return pane

    rows = [wall, *add_row(len(alphas), make)]
    for number, obj in enumerate(rows):
        obj.pass_index = number + 10
    scene.render.resolution_x, scene.render.resolution_y = 80, 45
    scene.perfect_bvh.samples = 1
    layer = bpy.context.view_layer
    shown = {}
    for limit in (0.0, threshold):
        with preserved((layer, "pass_alpha_threshold", limit)):
            shown[limit] = render_passes(scene, "PERFECT_BVH"), render_cycles(scene)
    at, away = shown[0.0][1].object_index, ~index_edges(shown[0.0][1].object_index)
    ours, theirs = shown[threshold]
    for alpha, obj in zip(alphas, rows[1:], strict=True):
        inside = (at == obj.pass_index) & away
        assert inside.sum() > 20
        passed = alpha < threshold
        np.testing.assert_array_equal(ours.object_index[inside] == obj.pass_index, not passed)
        alike = inside & (theirs.object_index == ours.object_index)
        assert alike.sum() > (0 if 0.0 < alpha < threshold else inside.sum() - 1)
        np.testing.assert_allclose(ours.depth[alike], theirs.depth[alike], rtol=DEPTH_TOLERANCE)


def test_collection_instances_and_their_indices(scene) -> None:
    inner = bpy.data.collections.new("Inner")
    cube = add("Cube", bpy.ops.mesh.primitive_cube_add, size=0.8)
    ball = add("Ball", bpy.ops.mesh.primitive_ico_sphere_add, radius=0.5, subdivisions=3, location=(0.0, 0.0, 1.0))
    for obj in (cube, ball):
        scene.collection.objects.unlink(obj)
        inner.objects.link(obj)
    ball.data.shade_smooth()

    def make(x: float) -> bpy.types.Object:
        instancer = bpy.data.objects.new("Instancer", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", inner
        instancer.location, instancer.rotation_euler = (x, x * 0.2, 0.0), (0.1 * x, 0.2, x)
        scene.collection.objects.link(instancer)
        return instancer

    add_row(4, make)
    check(scene, objects=2)


def test_what_cameras_do_not_see_is_missing(scene) -> None:
    def make(x: float) -> bpy.types.Object:
        return add("Cube", bpy.ops.mesh.primitive_cube_add, size=1.2, location=(x, 0.0, 0.0), rotation=(0, 0, 0.5))

    shown, unseen, unrendered, _ = add_row(4, make)
    shown.hide_viewport = True  # of no consequence to a render
    unseen.visible_camera = False
    unrendered.hide_render = True
    result = check(scene, objects=2)
    names = {obj.pass_index: obj.name for obj in scene.objects}
    assert {names[int(index)] for index in np.unique(result.ours.object_index) if index} == {"Cube", "Cube.003"}


def test_modifiers_take_their_render_settings(scene) -> None:
    ball = add("Ball", bpy.ops.mesh.primitive_cube_add, size=3.0)
    subdivision = ball.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels, subdivision.render_levels = 0, 3
    check(scene, objects=1)
    ball.data.shade_smooth()
    check(scene, objects=1)


def depths_of_views(scene: bpy.types.Scene, engine: str, folder: Path) -> dict[str, npt.NDArray[np.float32]]:
    """Return (H, W) by the end of the file's name; Blender writes one file for each view."""
    with preserved(
        (scene.cycles, "samples", 1), (scene.cycles, "use_denoising", False), (scene.cycles, "filter_width", 0.01)
    ):
        write_multilayer(folder / f"{engine}.exr", scene, engine)
    files = {path.stem.removeprefix(engine): read_exr(path) for path in folder.glob(f"{engine}*")}
    return {name: next(plane for key, plane in file.items() if ".Depth" in key) for name, file in files.items()}


@pytest.mark.parametrize("mode", ["OFFAXIS", "PARALLEL", "TOE", "CAMERAS"])
def test_each_eye_sees_what_it_sees_in_cycles(scene, tmp_path: Path, mode: str) -> None:
    add("Floor", bpy.ops.mesh.primitive_plane_add, size=30.0)
    add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, radius=2.0, location=(0.0, 0.0, 1.0))
    scene.render.resolution_x, scene.render.resolution_y, scene.perfect_bvh.samples = 96, 64, 1
    scene.render.use_multiview = True
    left, right = (scene.render.views[name] for name in ("left", "right"))
    if mode == "CAMERAS":
        scene.render.views_format = "MULTIVIEW"
        left.camera_suffix, right.camera_suffix = "_left", "_right"
        scene.camera.name = "Eye_left"
        other = scene.camera.copy()
        other.name, other.data = "Eye_right", scene.camera.data.copy()
        other.location.x, other.data.lens = 5.0, 70.0
        scene.collection.objects.link(other)
    else:
        stereo = scene.camera.data.stereo
        stereo.convergence_mode, stereo.interocular_distance, stereo.convergence_distance = mode, 0.8, 9.0
    ours, theirs = (depths_of_views(scene, engine, tmp_path) for engine in ("PERFECT_BVH", "CYCLES"))
    assert sorted(ours) == sorted(theirs)
    assert len(ours) == 2
    first, second = (np.minimum(plane, 100.0) for plane in ours.values())
    assert (np.abs(first - second) > 0.01).mean() > 0.2
    for name, plane in ours.items():
        assert (np.abs(plane - theirs[name]) > 1e-3 * theirs[name]).mean() < 0.02, name
