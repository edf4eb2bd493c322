"""One object of every type that evaluates to triangles."""

from __future__ import annotations

from typing import Any

import bpy
from blender.builders import evaluated
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync.records import AttributeRequest, MeshRecord

ALL_ATTRIBUTES = AttributeRequest(material_slots=True, corner_normals=True, corner_uvs=True)


def only_mesh(**options: Any) -> MeshRecord:
    (mesh,) = read_scene(evaluated(), ALL_ATTRIBUTES, **options).meshes
    return mesh


def add_mesh() -> Any:
    bpy.ops.mesh.primitive_monkey_add()
    return bpy.context.object


def add_modified_mesh() -> Any:
    obj = add_mesh()
    obj.modifiers.new("array", "ARRAY").count = 2
    obj.modifiers.new("bend", "SIMPLE_DEFORM").deform_method = "BEND"
    return obj


def add_curve() -> Any:
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.context.object.data.bevel_depth = 0.1
    return bpy.context.object


def add_surface() -> Any:
    bpy.ops.surface.primitive_nurbs_surface_torus_add()
    return bpy.context.object


def add_text() -> Any:
    bpy.ops.object.text_add()
    bpy.context.object.data.extrude = 0.1
    return bpy.context.object


def add_metaball() -> Any:
    bpy.ops.object.metaball_add(type="CAPSULE")
    return bpy.context.object


KINDS = {
    "mesh": add_mesh,
    "modified mesh": add_modified_mesh,
    "curve": add_curve,
    "surface": add_surface,
    "text": add_text,
    "metaball": add_metaball,
}
