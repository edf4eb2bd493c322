"""Shared helpers for tests of a sensor's light: upright plates before a mount that looks along +Y, and materials."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from perfect_bvh_addon import PointCloud, Raster

ONE_RAY = Raster(width=1, height=1, horizontal=1.0, vertical=1.0)


def empty_scene() -> Any:
    """A mount at the origin, and nothing else."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    head = bpy.data.objects.new("Head", None)
    bpy.context.scene.collection.objects.link(head)
    bpy.context.view_layer.update()
    return head


def add_plate(y: float, material: Any = None, size: float = 10.0, x: float = 0.0, turn: float = 0.0) -> Any:
    """A square that faces the mount, turned about the vertical axis by `turn` radians."""
    bpy.ops.mesh.primitive_plane_add(size=size, location=(x, y, 0.0), rotation=(math.pi / 2, 0.0, turn))
    made = bpy.context.object
    if material is not None:
        made.data.materials.append(material)
    return made


def principled(**values: Any) -> Any:
    """Make a Principled BSDF; keywords are names of inputs with _ for spaces."""
    material = bpy.data.materials.new("principled")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return material


def simple(kind: str, **values: Any) -> Any:
    """Make a single shader node, such as ShaderNodeBsdfDiffuse."""
    material = principled()
    tree = material.node_tree
    node = tree.nodes.new(kind)
    for name, value in values.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return material


def diffuse(gray: float) -> Any:
    """A material with Lambertian reflection only."""
    return simple("ShaderNodeBsdfDiffuse", Color=(gray, gray, gray, 1.0))


def names_of(cloud: PointCloud) -> list[str]:
    """Return the names of the objects that were hit, (N,)."""
    return [cloud.object_names[row] for row in cloud.object_ids]


def lobe(cosine: float, roughness: float, mirrored: float) -> float:
    """The reflectivity straight back of GGX facets, from its definition: pi * D * G * F / (4 cos)."""
    alpha = max(roughness**2, 0.01)
    tangent = math.sqrt(1.0 / cosine**2 - 1.0)
    facets = 1.0 / (math.pi * alpha**2 * cosine**4 * (1.0 + (tangent / alpha) ** 2) ** 2)
    masked = 1.0 / (1.0 + 2.0 * (math.sqrt(1.0 + (alpha * tangent) ** 2) - 1.0) / 2.0)
    return math.pi * facets * masked * mirrored / (4.0 * cosine)


def fresnel(ior: float, cosine: float) -> float:
    """Fresnel reflectance of unpolarised light from air, by Snell's angles."""
    inner = math.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    upright = (cosine - ior * inner) / (cosine + ior * inner)
    flat = (inner - ior * cosine) / (inner + ior * cosine)
    return 0.5 * (upright**2 + flat**2)


def rows_by_distance(cloud: PointCloud) -> np.ndarray:
    """Return distances and intensities of the points, (N, 2), sorted by distance."""
    return np.column_stack([cloud.distances, cloud.intensities])
