"""Effects of light on a sensor's beams by closed forms: glass, alpha, mirrors, echoes, Lambert's falloff, detection."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.light_scenes import (  # noqa: E402
    ONE_RAY,
    add_plate,
    diffuse,
    empty_scene,
    fresnel,
    lobe,
    names_of,
    principled,
    rows_by_distance,
    simple,
)
from perfect_bvh_addon import (  # noqa: E402
    Beam,
    CameraGrid,
    DepthCamera,
    Detection,
    Light,
    Optics,
    Raster,
    Sensor,
    SpinningLidar,
    scan,
)
from perfect_bvh_addon.scanning.light.model import disc_places  # noqa: E402

ALL = Beam(returns=8)
TIGHT = {"rel": 2e-6}  # materials and intensities are float32


def clear_glass(ior: float = 1.5) -> Any:
    return simple("ShaderNodeBsdfGlass", Color=(1.0, 1.0, 1.0, 1.0), Roughness=0.0, IOR=ior)


@pytest.fixture
def head() -> Any:
    return empty_scene()


def test_what_scans_leave_out_of_a_surface_is_named(head) -> None:
    material = principled(Base_Color=(0.5, 0.5, 0.5, 1.0))
    add_plate(2.0, material)
    assert not any("scans ignore" in warning for warning in scan(ONE_RAY, head, light=Light(ALL)).warnings)
    node = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    node.inputs["Coat Weight"].default_value = 1.0
    (told,) = [warning for warning in scan(ONE_RAY, head, light=Light(ALL)).warnings if "scans ignore" in warning]
    assert told == f"{material.name}: scans ignore its sheen, coat, anisotropy and absorption"


# Glass and alpha -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_pane_returns_its_share_and_lets_the_rest_pass_twice(head, turn: float) -> None:
    add_plate(2.0, clear_glass(), turn=turn)
    add_plate(5.0, diffuse(0.5))
    cloud = scan(ONE_RAY, head, light=Light(ALL))
    cosine = math.cos(turn)
    passed = 1.0 - fresnel(1.5, cosine)
    expected = [(2.0, lobe(cosine, 0.0, 0.04) / 4.0), (5.0, passed**2 * 0.5 / 25.0)]
    assert rows_by_distance(cloud) == pytest.approx(np.array(expected), **TIGHT)
    assert names_of(cloud) == ["Plane", "Plane.001"]
    assert cloud.positions == pytest.approx(np.array([(0.0, 2.0, 0.0), (0.0, 5.0, 0.0)]), abs=1e-6)
    assert cloud.return_ids.tolist() == [0, 1] and cloud.return_counts.tolist() == [2, 2]
    assert cloud.ray_ids.tolist() == [0, 0] and cloud.ray_count == 1
    assert cloud.warnings == ()


def test_a_slab_that_refracts_shifts_the_beam_by_snells_law(head) -> None:
    """A slab of thickness h at an angle moves the ray by h sin(a - b) / cos b, and slows it inside."""
    turn, ior, thick = 0.5, 1.5, 0.4
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 3.0, 0.0), rotation=(0.0, 0.0, turn))
    slab = bpy.context.object
    slab.scale = (20.0, thick, 20.0)
    slab.data.materials.append(clear_glass(ior))
    inner = math.asin(math.sin(turn) / ior)
    aside = thick * math.sin(turn - inner) / math.cos(inner)
    in_glass = thick / math.cos(inner)
    # Where the ray arrives on the wall there is a strip as thin as a hair; the wall is a little behind it.
    strip = add_plate(8.0, diffuse(0.5), size=2e-5, x=-aside)
    wall = add_plate(9.0, diffuse(0.5), size=40.0)
    strongest = Beam(keep=("strongest",))  # there are ghosts of light that is reflected back and forth in the slab
    cloud = scan(ONE_RAY, head, light=Light(strongest, Optics(refract=True)))
    assert names_of(cloud) == [strip.name]
    expected = 8.0 - in_glass * math.cos(turn - inner) + ior * in_glass
    assert cloud.distances == pytest.approx([expected], rel=1e-6)
    passed = (1.0 - fresnel(ior, math.cos(turn))) ** 2  # the same on the way out
    assert cloud.intensities == pytest.approx([passed**2 * 0.5 / expected**2], rel=1e-5)
    assert cloud.positions == pytest.approx(np.array([(0.0, expected, 0.0)]), abs=1e-5)
    # Thin glass does not shift the ray.
    thin = scan(ONE_RAY, head, light=Light(strongest))
    assert names_of(thin) == [wall.name] and thin.distances == pytest.approx([9.0])


def test_light_that_cannot_leave_glass_is_mirrored_in_it(head) -> None:
    """The cut of a prism is at 45 degrees to the ray, beyond glass's critical angle: all light goes to the side."""
    corners = [(x, y, z) for z in (-1.0, 1.0) for x, y in ((-1.0, 2.0), (1.0, 2.0), (-1.0, 4.0))]
    faces = [(0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5), (0, 2, 1), (3, 4, 5)]
    mesh = bpy.data.meshes.new("Prism")
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(clear_glass())
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Prism", mesh))
    bpy.ops.mesh.primitive_plane_add(size=3.0, location=(-5.0, 3.0, 0.0), rotation=(0.0, math.pi / 2, 0.0))
    bpy.context.object.data.materials.append(diffuse(0.8))
    add_plate(9.0, diffuse(0.8), size=3.0)
    cloud = scan(ONE_RAY, head, light=Light(Beam(keep=("last",)), Optics(refract=True, bounces=3)))
    # 2 in air, 1 to the cut and 1 to the side in glass, 4 in air.
    expected = 2.0 + 2.0 * 1.5 + 4.0
    assert names_of(cloud) == ["Plane"]
    assert cloud.distances == pytest.approx([expected], rel=1e-6)
    assert cloud.intensities == pytest.approx([0.96**4 * 0.8 / expected**2], rel=1e-5)


def test_alpha_lets_light_pass_straight_on_in_either_mode(head) -> None:
    add_plate(2.0, principled(Alpha=0.25, Base_Color=(0.6, 0.6, 0.6, 1.0), IOR=1.0, Roughness=1.0), turn=0.3)
    add_plate(5.0, diffuse(0.5))
    for refract in (False, True):
        cloud = scan(ONE_RAY, head, light=Light(ALL, Optics(refract=refract)))
        expected = [(2.0, 0.25 * 0.6 * math.cos(0.3) / 4.0), (5.0, 0.75**2 * 0.5 / 25.0)]
        assert rows_by_distance(cloud) == pytest.approx(np.array(expected), **TIGHT)
        assert cloud.positions[1] == pytest.approx([0.0, 5.0, 0.0], abs=1e-6)


def test_a_leafs_alpha_texture_has_holes(head) -> None:
    """Rays pass through the pixel centres of a checked alpha of 4 x 4 pixels; the colours are the image's."""
    pixels = np.ones((4, 4, 4), np.float32)
    pixels[..., :3] = (0.2, 0.4, 0.1)
    pixels[..., 3] = (np.indices((4, 4)).sum(axis=0) % 2).astype(np.float32)
    image = bpy.data.images.new("leaf", 4, 4, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    material = principled(IOR=1.0, Roughness=1.0)
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    for output, name in (("Color", "Base Color"), ("Alpha", "Alpha")):
        tree.links.new(texture.outputs[output], tree.nodes["Principled BSDF"].inputs[name])
    add_plate(2.0, material, size=2.0)
    add_plate(4.0, diffuse(0.5), size=40.0)
    angle = 2.0 * math.degrees(math.atan(0.5))
    camera = DepthCamera(width=4, height=4, horizontal=angle, vertical=angle)
    cloud = scan(camera, head, light=Light(ALL, Optics(calibrated=True)))
    covered = pixels[::-1, :, 3].ravel() > 0.5  # the camera's rows are from the top
    assert cloud.ray_ids.tolist() == list(range(16))
    assert [name == "Plane" for name in names_of(cloud)] == covered.tolist()
    gray = 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.1
    expected = np.where(covered, gray, 0.5) * cloud.incidences
    assert cloud.intensities == pytest.approx(expected, rel=1e-5)


def test_rough_glass_hides_what_is_behind(head) -> None:
    add_plate(2.0, simple("ShaderNodeBsdfGlass", Color=(1.0, 1.0, 1.0, 1.0), Roughness=0.5, IOR=1.5))
    add_plate(5.0, diffuse(0.5))
    cloud = scan(ONE_RAY, head, light=Light(ALL))
    assert names_of(cloud) == ["Plane"]
    assert cloud.intensities == pytest.approx([lobe(1.0, 0.5, 0.04) / 4.0], **TIGHT)


# Mirrors -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("roughness", [0.05, 0.5])
def test_a_mirror_makes_a_ghost_on_the_beams_own_line(head, roughness: float) -> None:
    """A metal mirror at 45 degrees, 3 ahead, reflects half at all angles; the reflected surface is 4 to the side."""
    mirror = simple("ShaderNodeBsdfAnisotropic", Color=(0.5, 0.5, 0.5, 1.0), Roughness=roughness)
    add_plate(3.0, mirror, size=2.0, turn=math.pi / 4)
    for x in (-4.0, 4.0):
        bpy.ops.mesh.primitive_plane_add(size=3.0, location=(x, 3.0, 0.0), rotation=(0.0, math.pi / 2, 0.0))
        bpy.context.object.data.materials.append(diffuse(0.8))
    cloud = scan(ONE_RAY, head, light=Light(ALL))
    cosine = math.cos(math.pi / 4)
    expected = [(3.0, lobe(cosine, roughness, 0.5) / 9.0)]
    if roughness < 0.2:
        expected.append((7.0, 0.5**2 * 0.8 / 49.0))
        assert cloud.positions[1] == pytest.approx([0.0, 7.0, 0.0], abs=1e-6)
        assert cloud.incidences[1] == pytest.approx(1.0)
        assert names_of(cloud)[1] in ("Plane.001", "Plane.002")
    assert rows_by_distance(cloud) == pytest.approx(np.array(expected), rel=2e-5)


def test_light_between_mirrors_stops_after_so_many_bounces(head) -> None:
    """The sensor is between two mirrors that face each other."""
    mirror = simple("ShaderNodeBsdfAnisotropic", Color=(1.0, 1.0, 1.0, 1.0), Roughness=0.0)
    add_plate(2.0, mirror)
    add_plate(-1.0, mirror)
    for bounces in (0, 1, 5):
        cloud = scan(ONE_RAY, head, light=Light(Beam(returns=15), Optics(bounces=bounces)))
        assert cloud.distances == pytest.approx([2.0 + 3.0 * number for number in range(bounces + 1)])


# Echoes --------------------------------------------------------------------------------------------------------------


def test_a_beam_at_an_edge_gives_two_echoes_by_the_shares_of_its_rays(head) -> None:
    beam = Beam(divergence=20.0, rays=61, returns=3, resolution=0.1)
    half, edge = math.tan(0.01), 0.03
    plate = add_plate(10.0, diffuse(0.6), size=4.0, x=-2.0 + edge)
    add_plate(20.0, diffuse(0.9), size=40.0)
    cloud = scan(ONE_RAY, head, light=Light(beam, Optics(calibrated=True)))
    # The disc's rotation about the beam is unknown, because it depends on the choice of a perpendicular axis.
    places = disc_places(61) * half * 10.0
    share = cloud.intensities[0] / 0.6
    assert names_of(cloud) == [plate.name, "Plane.001"]
    assert share * 61 == pytest.approx(round(float(share) * 61), abs=2e-2)
    axes = ((1, 0), (-1, 0), (0, 1), (0, -1))
    assert round(float(share) * 61) in {int((places @ axis < edge).sum()) for axis in axes}
    assert cloud.intensities.sum() == pytest.approx(share * 0.6 + (1.0 - share) * 0.9, rel=1e-3)
    assert cloud.distances == pytest.approx([10.0, 20.0], abs=1e-2)
    assert 0.5 < share < 0.8


def test_the_places_in_a_beam_are_even() -> None:
    places = disc_places(400)
    radii = np.hypot(*places.T)
    assert radii[0] == 0.0 and radii.max() <= 1.0
    assert (radii < math.sqrt(0.5)).sum() == pytest.approx(200, abs=2)
    assert np.abs(places.mean(axis=0)).max() < 0.01


@pytest.mark.parametrize(
    ("keep", "returns", "kept"),
    [
        (("first",), 1, [2.0]),
        (("first",), 2, [2.0, 3.0]),
        (("last",), 1, [6.0]),
        (("strongest",), 1, [5.0]),
        (("strongest", "last"), 2, [5.0, 6.0]),
        (("first", "strongest", "last"), 3, [2.0, 5.0, 6.0]),
        (("last", "strongest"), 15, [2.0, 3.0, 5.0, 6.0]),
    ],
)
def test_rules_choose_echoes(head, keep: tuple[str, ...], returns: int, kept: list[float]) -> None:
    thin = principled(Alpha=0.1, Base_Color=(0.2, 0.2, 0.2, 1.0), IOR=1.0, Roughness=1.0)
    bright = principled(Alpha=0.5, Base_Color=(1.0, 1.0, 1.0, 1.0), IOR=1.0, Roughness=1.0)
    for y, material in ((2.0, thin), (3.0, thin), (5.0, bright), (6.0, thin)):
        add_plate(y, material)
    cloud = scan(ONE_RAY, head, light=Light(Beam(returns=returns, keep=keep)))
    assert cloud.distances == pytest.approx(kept)
    assert cloud.return_ids.tolist() == list(range(len(kept)))


# Intensity and detection ---------------------------------------------------------------------------------------------


def test_intensities_fall_with_the_cosine_and_the_square_of_the_distance(head) -> None:
    add_plate(7.0, diffuse(0.5), size=100.0)
    fan = Raster(width=41, height=1, horizontal=120.0, vertical=1.0, rate=10.0)
    for reference in (1.0, 10.0):
        cloud = scan(fan, head, light=Light(optics=Optics(reference=reference)))
        cosines = 7.0 / cloud.distances
        assert len(cloud) == 41
        assert cloud.intensities == pytest.approx(0.5 * cosines * (reference / cloud.distances) ** 2, rel=1e-5)
    cloud = scan(fan, head, light=Light(optics=Optics(calibrated=True)))
    assert cloud.intensities == pytest.approx(0.5 * 7.0 / cloud.distances, rel=1e-5)


def test_a_spectrum_weighs_colors(head) -> None:
    add_plate(1.0, simple("ShaderNodeBsdfDiffuse", Color=(0.9, 0.3, 0.0, 1.0)))
    for spectrum, expected in (((2.0, 0.0, 0.0), 0.9), ((1.0, 1.0, 0.0), 0.6)):
        cloud = scan(ONE_RAY, head, light=Light(optics=Optics(spectrum=spectrum)))
        assert cloud.intensities == pytest.approx([expected], **TIGHT)


def test_what_returns_less_than_the_table_says_is_not_detected(head) -> None:
    """With a reflectivity of 0.3, between 10 (0.1) and 50 (0.5), the last detected surface is at 30."""
    wall = add_plate(10.0, diffuse(0.3), size=400.0)
    light = Light(detection=Detection((10.0, 50.0), (0.1, 0.5)))
    for distance, count in ((5.0, 1), (29.999, 1), (30.001, 0), (200.0, 0)):
        wall.location.y = distance
        bpy.context.view_layer.update()
        assert len(scan(ONE_RAY, head, light=light)) == count


def test_an_ideal_sensor_is_as_before_but_for_its_intensities(head) -> None:
    add_plate(6.0, diffuse(0.3), turn=0.2)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1.0, 3.0, 0.2))
    for pattern in (SpinningLidar(columns=180), DepthCamera(width=40, height=30, baseline=0.4)):
        plain, lit = scan(pattern, head), scan(pattern, head, light=Light())
        for name in (
            "positions",
            "distances",
            "normals",
            "object_ids",
            "material_ids",
            "ray_ids",
            "incidences",
            "times",
        ):
            assert np.array_equal(getattr(plain, name), getattr(lit, name)), name
        assert len(plain) > 200 and set(plain.return_counts) == {1} and set(plain.return_ids) == {0}
        assert (plain.intensities != lit.intensities).any()
    one_eye = scan(DepthCamera(width=40, height=30), head, light=Light())
    assert len(one_eye) > len(lit) + 5


def test_light_has_to_be_light(head) -> None:
    with pytest.raises(ValueError, match="light must be a Light"):
        scan(ONE_RAY, head, light=Beam())
    with pytest.raises(ValueError, match="seed must be an integer from 0 to 2147483647, got -1"):
        scan(ONE_RAY, head, seed=-1)


def test_a_cameras_rays_and_a_sensor_of_ones_own_have_light_as_well(head) -> None:
    add_plate(2.0, clear_glass())
    add_plate(5.0, diffuse(0.5), size=40.0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.rotation_euler.x = math.pi / 2
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.view_layer.update()
    light = Light(ALL)
    grid = scan(CameraGrid(16, 9), camera, light=light)
    assert np.bincount(grid.ray_ids).tolist() == [2] * (16 * 9)
    whole = scan(Sensor("mine", "", "", ONE_RAY, light), head)
    assert whole.distances == pytest.approx([2.0, 5.0])


def test_what_materials_are_not_read_for_is_named(head) -> None:
    material = principled()
    noise = material.node_tree.nodes.new("ShaderNodeAmbientOcclusion")
    material.node_tree.links.new(noise.outputs[0], material.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    add_plate(2.0, material)
    assert scan(ONE_RAY, head).warnings == ()
    (warning,) = scan(ONE_RAY, head, light=Light()).warnings
    assert warning.startswith("principled: ") and "unsupported" in warning
