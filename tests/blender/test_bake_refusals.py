"""Bakes that are refused: objects, settings and attributes that have no place for values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.baked_scenes import UP, ground, made  # noqa: E402
from blender.builders import camera_object, mesh_object  # noqa: E402
from perfect_bvh_addon import Bake, DirectionTable, bake_rays  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene")


def refused(match: str, *objects: Any, **how: Any) -> None:
    before = [obj.name for obj in bpy.data.objects], [mesh.name for mesh in bpy.data.meshes]
    with pytest.raises(ValueError, match=match):
        bake_rays(objects, **({"kind": "SKY_VIEW", "rays": 4} | how))
    assert ([obj.name for obj in bpy.data.objects], [mesh.name for mesh in bpy.data.meshes]) == before
    assert all("sky_view" not in mesh.attributes for mesh in bpy.data.meshes)


def test_objects_without_a_place_for_values_are_named(scene: Any) -> None:
    floor = ground("Floor", (1.0, 1.0), (1, 1))
    refused("no objects: select the meshes")
    for wrong in (floor, "Floor", ["Floor"], 3):
        with pytest.raises(ValueError, match="bake_rays: objects must be a sequence of bpy"):
            bake_rays(wrong, kind="SKY_VIEW")  # type: ignore[arg-type]
    refused("object 'Eye' is of type CAMERA, not a mesh", floor, camera_object("Eye"))
    refused("object 'Dust' has no faces", floor, made("Dust", [(0, 0, 0)], []))
    refused("object 'Loose' is not in scene", floor, mesh_object("Loose", collection=False))
    hidden = ground("Hidden", (1.0, 1.0), (1, 1))
    hidden.hide_render = True
    refused("object 'Hidden' is not in the evaluated scene", hidden)
    flat = ground("Flat", (1.0, 1.0), (1, 1))
    flat.scale.z = 0.0
    refused("object 'Flat' is flattened by a scale of 0", flat)
    round_one = ground("Round", (1.0, 1.0), (1, 1))
    round_one.modifiers.new("Smoother", "SUBSURF")
    refused("object 'Round' has 1 faces, but 16 or others after 'Smoother'", round_one)
    bpy.context.view_layer.objects.active = floor
    bpy.ops.object.mode_set(mode="EDIT")
    refused("object 'Floor' is in Edit Mode", floor)
    bpy.ops.object.mode_set(mode="OBJECT")
    bare = made("Bare", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    refused("object 'Bare' has no UV map", bare, domain="TEXEL")
    refused("object 'Floor' has no UV map 'Other'", floor, domain="TEXEL", uv_map="Other")


@pytest.mark.parametrize(
    ("match", "how"),
    [
        ("kind must be one of SUN_HOURS, .*; got 'MOON'", {"kind": "MOON"}),
        ("domain must be one of FACE, .*; got 'EDGE'", {"domain": "EDGE"}),
        ("rays must be an integer from 1", {"rays": 0}),
        ("distance must be a finite number above 0", {"distance": 0.0}),
        ("distance must be a finite number above 0, got 'far'", {"distance": "far"}),
        ("cosine must be True or False, got 'no'", {"cosine": "no"}),
        ("image_size must be .width, height., got 3", {"image_size": 3}),
        ("frames must be a sequence of integers, got 5", {"frames": 5}),
        ("frames must be an integer from -1048574 .*, got 1.5", {"frames": [1.5]}),
        ("threads must be an integer from 0 .*, got 'all'", {"threads": "all"}),
        ("previous must be a Bake, an earlier result, got 'last'", {"previous": "last"}),
        ("progress must be a function of the share done, got 3", {"progress": 3}),
        (
            "viewers must be an object, or finite positions, .*nan",
            {"kind": "EXPOSURE", "viewers": [[0.0, 0.0, math.nan]]},
        ),
        ("viewers must have shape .N, 3., got ..", {"kind": "EXPOSURE", "viewers": "Camera"}),
        ("falloff needs a distance", {"falloff": 1.0}),
        ("needs directions", {"kind": "SUN_HOURS"}),
        ("frames must be one, or more for the kind 'EXPOSURE'", {"frames": (1, 2)}),
        ("scene 'Scene' has no camera", {"kind": "EXPOSURE"}),
        ("viewers must have shape .N, 3., got .2,.", {"kind": "EXPOSURE", "viewers": [1.0, 2.0]}),
        ("viewers must be an object, or finite positions", {"kind": "EXPOSURE", "viewers": np.zeros((0, 3))}),
    ],
)
def test_settings_that_make_no_bake_are_named(match: str, how: dict[str, Any]) -> None:
    refused(f"^bake_rays: .*{match}", ground("Floor", (1.0, 1.0), (1, 1)), **how)


@pytest.mark.parametrize(
    ("match", "how"),
    [
        ("directions must have shape .N, 3., got ..", {"directions": "up"}),
        ("directions must be float64, got <U1", {"directions": [["x", "y", "z"]]}),
        ("directions must have shape .N, 3., got .3,.", {"directions": UP[0]}),
        ("directions must be unit vectors, got .* in row 1", {"directions": [[0, 0, 1], [0, 0, 2]]}),
        ("weights must be 1 finite numbers, got .nan.", {"directions": UP, "weights": [math.nan]}),
        ("weights must be 1 finite numbers, got .1, 2.", {"directions": UP, "weights": [1, 2]}),
        ("unit must be of the type str, got 3", {"directions": UP, "unit": 3}),
    ],
)
def test_tables_that_are_none_are_named(match: str, how: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"^DirectionTable: {match}"):
        DirectionTable(**how)


def test_an_unknown_argument_is_named() -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'ray'"):
        bake_rays(kind="SKY_VIEW", ray=3)


def test_faces_without_an_area_are_named_and_have_no_value() -> None:
    obj = made("Odd", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)], [(0, 1, 2), (0, 1, 3)])
    bake = bake_rays([obj], kind="SUN_HOURS", directions=UP)
    assert bake["Odd"].values.tolist()[0] == 1.0
    assert np.isnan(bake["Odd"].values[1])
    assert "Odd: 1 faces without an area have no value: 1" in bake.warnings
    vertices = bake_rays([obj], kind="SUN_HOURS", domain="POINT", directions=UP)["Odd"].values
    assert np.isnan(vertices).tolist() == [False, False, False, True]


def test_an_object_of_flat_faces_has_no_values() -> None:
    obj = made("Line", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])
    for domain in ("FACE", "CORNER", "POINT"):
        baked = bake_rays([obj], kind="SKY_VIEW", domain=domain, rays=2)["Line"]
        assert np.isnan(baked.values).all()
        assert len(baked.values) == (1 if domain == "FACE" else 3)


def test_viewports_have_their_own_scene() -> None:
    floor, roof = ground("Floor", (1.0, 1.0), (1, 1)), ground("Roof", (2.0, 2.0), (1, 1), location=(0.0, 0.0, 1.0))
    roof.hide_render = True
    for for_viewport, hours in ((False, 1.0), (True, 0.0)):
        bake = bake_rays([floor], kind="SUN_HOURS", directions=UP, for_viewport=for_viewport)
        assert bake["Floor"].values.tolist() == [hours]


def written(bake: Bake, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        bake.write_attributes()
    assert all("sun_hours" not in obj.data.attributes for obj in bpy.data.objects if obj.name == "Floor")


def test_attributes_are_all_written_or_none() -> None:
    floor, other = ground("Floor", (1.0, 1.0), (1, 1)), ground("Other", (1.0, 1.0), (1, 1), location=(5.0, 0.0, 0.0))
    bake = bake_rays([floor, other], kind="SUN_HOURS", directions=UP)
    other.data.attributes.new("sun_hours", "INT", "POINT")
    written(bake, "'Other' has an attribute 'sun_hours', a INT of the domain POINT")
    other.data.attributes.remove(other.data.attributes["sun_hours"])
    own, other.data = other.data, floor.data
    written(bake, "shares its mesh with '(Floor|Other)': make it single-user")
    written(bake_rays([other], kind="SUN_HOURS", directions=UP), "'Other' shares its mesh with 'Floor'")
    other.data = made("More", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], [(0, 1, 2), (1, 3, 2)]).data
    written(bake, "the mesh of object 'Other' has other elements")
    other.data = own
    other.vertex_groups.new(name="sun_hours")
    written(bake, "'Other' has a vertex group 'sun_hours': choose a name")
    other.vertex_groups.clear()
    for name in ("", "material_index", "long" * 20):
        with pytest.raises(ValueError, match=f"an attribute cannot have the name '{name}'"):
            bake.write_attributes(name)
    with pytest.raises(ValueError, match="name must be a text, got 3"):
        bake.write_attributes(3)  # type: ignore[arg-type]
    evaluated = bake_rays([floor, other], kind="SUN_HOURS", directions=UP, evaluated=True)
    written(evaluated, "the elements are not those of the meshes: bake without evaluated=True")
    bpy.context.view_layer.objects.active = other
    bpy.ops.object.mode_set(mode="EDIT")
    written(bake, "'Other' is in Edit Mode")
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.data.objects.remove(other)
    written(bake, "object 'Other' was deleted since the bake")
