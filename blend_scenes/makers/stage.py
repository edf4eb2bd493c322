"""Puts shapes, materials, lights and cameras into a Blender scene, and saves it."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import ArrayLike, NDArray

from .shapes import Shape

Colour = tuple[float, float, float]
Place = Sequence[float] | NDArray[np.float64]

# From 5.0 on every material and world has nodes, and to ask is deprecated.
HAS_NODES_ALWAYS = bpy.app.version >= (5, 0, 0)


def open_stage(name: str, last_frame: int = 1, exposure: float = 0.0) -> Any:
    """An empty scene of 960x540 pixels, lit by nothing yet. Returns the scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.name = name
    scene.frame_start, scene.frame_end = 1, last_frame
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.render.fps = 24
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 32
    scene.cycles.seed = 0
    scene.render.dither_intensity = 0.0  # its noise would only make the PNG files larger
    scene.view_settings.exposure = exposure
    scene.display.shading.color_type = "MATERIAL"
    scene.display.shading.show_cavity = True
    return scene


def save_stage(path: Path, frame: int = 1) -> None:
    """Writes the file compressed, at a frame, without a backup file."""
    bpy.context.scene.frame_set(frame)
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)


def paint(name: str, colour: Colour, roughness: float = 0.75, metallic: float = 0.0, emission: float = 0.0) -> Any:
    """A material whose viewport colour and Principled base colour are the same scene-linear rgb."""
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 1.0)
    material.roughness, material.metallic = roughness, metallic
    if not HAS_NODES_ALWAYS:
        material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*colour, 1.0)
    inputs["Roughness"].default_value = roughness
    inputs["Metallic"].default_value = metallic
    if emission:
        inputs["Emission Color"].default_value = (*colour, 1.0)
        inputs["Emission Strength"].default_value = emission
    return material


def light_world(colour: Colour, strength: float = 1.0) -> None:
    world = bpy.data.worlds.new("World")
    world.color = colour
    if not HAS_NODES_ALWAYS:
        world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*colour, 1.0)
    background.inputs["Strength"].default_value = strength
    bpy.context.scene.world = world


def make_collection(name: str, parent: Any = None, instanced: bool = False) -> Any:
    """A collection in the scene, or one that only instances show."""
    collection = bpy.data.collections.new(name)
    if not instanced:
        (parent or bpy.context.scene.collection).children.link(collection)
    elif parent:
        parent.children.link(collection)
    return collection


def make_mesh(name: str, form: Shape, materials: Sequence[Any], sharp_degrees: float | None = 35.0) -> Any:
    """A mesh: smooth, except edges sharper than `sharp_degrees`; None: flat faces."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(form.vertices, [], form.faces)
    for material in materials:
        mesh.materials.append(material)
    if any(form.slots):
        mesh.polygons.foreach_set("material_index", np.asarray(form.slots, dtype=np.int32))
    if sharp_degrees is None:
        mesh.shade_flat()
    else:
        mesh.shade_smooth()
        mesh.set_sharp_from_angle(angle=radians(sharp_degrees))
    mesh.update()
    if mesh.validate():
        raise ValueError(f"make_mesh: {name!r} has faces that Blender had to repair")
    return mesh


def make_profile(name: str, profile: ArrayLike, material: Any) -> Any:
    """A mesh of edges only, through rows of (radius, z), for `spin` to turn about Z."""
    rows = np.asarray(profile, dtype=np.float64)
    mesh = bpy.data.meshes.new(name)
    points = np.column_stack([rows[:, 0], np.zeros(len(rows)), rows[:, 1]])
    mesh.from_pydata(points, [(k, k + 1) for k in range(len(rows) - 1)], [])
    mesh.materials.append(material)
    return mesh


def place(
    name: str,
    data: Any,
    collection: Any,
    at: Place = (0.0, 0.0, 0.0),
    turn: Place = (0.0, 0.0, 0.0),
    size: float | Place = 1.0,
    parent: Any = None,
) -> Any:
    """An object of some data (None: an empty) in a collection; turn: Euler angles in degrees."""
    item = bpy.data.objects.new(name, data)
    item.location = at
    item.rotation_euler = [radians(angle) for angle in turn]
    item.scale = (size,) * 3 if isinstance(size, int | float) else size
    item.parent = parent
    collection.objects.link(item)
    return item


def instance(name: str, source: Any, collection: Any, at: Place, turn: float = 0.0, size: float | Place = 1.0) -> Any:
    """An empty that shows a collection, turned about Z by `turn` degrees."""
    item = place(name, None, collection, at, (0.0, 0.0, turn), size)
    item.instance_type = "COLLECTION"
    item.instance_collection = source
    item.empty_display_size = 0.25
    return item


def repeat(item: Any, count: int, step: Place) -> Any:
    """An array modifier with a constant offset."""
    modifier = item.modifiers.new("Array", "ARRAY")
    modifier.count = count
    modifier.use_relative_offset = False
    modifier.use_constant_offset = True
    modifier.constant_offset_displace = step
    return modifier


def spin(item: Any, segments: int, sharp_degrees: float = 40.0) -> Any:
    """Turns a profile about Z into a vessel: far smaller in the file than its surface is."""
    modifier = item.modifiers.new("Screw", "SCREW")
    modifier.steps = modifier.render_steps = segments
    modifier.use_normal_calculate = False
    modifier.use_normal_flip = True
    modifier.use_merge_vertices, modifier.merge_threshold = True, 1e-4
    split = item.modifiers.new("Edge split", "EDGE_SPLIT")
    split.split_angle = radians(sharp_degrees)
    return item


def bevel(item: Any, width: float, segments: int = 2, degrees: float = 40.0) -> Any:
    """Rounds the sharp edges; the flat faces keep their flat shading."""
    modifier = item.modifiers.new("Bevel", "BEVEL")
    modifier.width, modifier.segments = width, segments
    modifier.limit_method = "ANGLE"
    modifier.angle_limit = radians(degrees)
    modifier.harden_normals = True
    return modifier


def subdivide(item: Any, levels: int, simple: bool = False) -> Any:
    """A subdivision surface of the same level in viewport and render."""
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = levels
    modifier.subdivision_type = "SIMPLE" if simple else "CATMULL_CLARK"
    return modifier


def solidify(item: Any, thickness: float) -> Any:
    modifier = item.modifiers.new("Solidify", "SOLIDIFY")
    modifier.thickness = thickness
    modifier.offset = 0.0
    return modifier


def make_curve(name: str, paths: Sequence[Sequence[Place]], radius: float, material: Any, resolution: int = 2) -> Any:
    """A round cord along each path, smooth through its points (Bezier)."""
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth, curve.bevel_resolution = radius, resolution
    curve.resolution_u = 6
    curve.use_fill_caps = True
    curve.materials.append(material)
    for path in paths:
        spline = curve.splines.new("BEZIER")
        spline.bezier_points.add(len(path) - 1)
        for point, position in zip(spline.bezier_points, path, strict=True):
            point.co = position
            point.handle_left_type = point.handle_right_type = "AUTO"
    return curve


def make_text(name: str, body: str, size: float, depth: float, material: Any) -> Any:
    """Centred raised letters in Blender's own font, in the XY plane, facing +Z."""
    text = bpy.data.curves.new(name, "FONT")
    text.body = body
    text.size, text.extrude = size, depth
    text.bevel_depth = depth * 0.3
    text.align_x, text.align_y = "CENTER", "CENTER"
    text.resolution_u = 3
    text.bevel_resolution = 0
    text.materials.append(material)
    return text


def add_camera(at: Place, target: Place, lens: float, clip_end: float = 200.0) -> Any:
    """The scene's camera, looking from one point at another, upright."""
    data = bpy.data.cameras.new("Camera")
    data.lens, data.clip_end = lens, clip_end
    camera = place("Camera", data, bpy.context.scene.collection, at)
    camera.rotation_euler = aim(at, target)
    bpy.context.scene.camera = camera
    return camera


def add_light(kind: str, name: str, at: Place, target: Place, energy: float, colour: Colour, size: float) -> Any:
    """A lamp that looks at a target. size: metres, for a sun degrees."""
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = energy, colour
    if kind == "SUN":
        data.angle = radians(size)
    elif kind == "AREA":
        data.size = size
    else:
        data.shadow_soft_size = size
    lamp = place(name, data, bpy.context.scene.collection, at)
    lamp.rotation_euler = aim(at, target)
    return lamp


def aim(at: Place, target: Place) -> Any:
    """Euler angles that turn -Z towards the target and keep Y up."""
    return (Vector(target) - Vector(at)).to_track_quat("-Z", "Y").to_euler()


def animation_curves(data: Any) -> list[Any]:
    """A data-block's animation curves; 4.4 moved them into layers and 5.0 took the old door away."""
    action = data.animation_data.action
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    return [
        curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves
    ]
