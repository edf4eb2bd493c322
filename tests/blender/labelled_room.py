"""A small scene whose objects, data, instancers and materials have labels, each at a separate position."""

from __future__ import annotations

from typing import Any

import bpy
from blender.builders import SQUARE, camera_object, collection, collection_instance, mesh_data

# Label `part` of the surface that a ray straight down hits at each x. The value names the label's source.
PARTS = {
    0.0: "own",  # the object, before its data and material
    3.0: "of data",
    6.0: "of instancer",  # before the instanced object's data
    9.0: "of instancer's data",
    12.0: "of material",
    15.0: None,
}


def square(name: str, x: float, data: Any = None, into: Any = None) -> Any:
    data = mesh_data(name, *SQUARE) if data is None else data
    obj = bpy.data.objects.new(name, data)
    obj.location.x = x
    (into or bpy.context.scene.collection).objects.link(obj)
    return obj


def make_labelled_room() -> Any:
    """Build squares at z = 0 along x, and a camera above that sees all of them; return the scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.camera = camera_object("camera", type="ORTHO", ortho_scale=20.0)
    scene.camera.location = (7.5, 0.0, 10.0)
    painted = bpy.data.materials.new("painted")
    painted["part"], painted["weight"] = "of material", 0.5
    own = square("Own", 0.0)
    own.data.materials.append(painted)
    own["part"], own["categoryID"], own["weight"] = "own", 7, 2
    own.data["part"] = "of data"
    square("Data", 3.0).data["part"] = "of data"
    boxes = collection("Boxes", linked=False)
    inner = square("Inner", 0.0, into=boxes)
    inner.data["part"] = "of data"
    shown = collection_instance("Shown", boxes, location=(6.0, 0.0, 0.0))
    shown["part"], shown["categoryID"] = "of instancer", 70_000
    parent = bpy.data.objects.new("Parent", mesh_data("parent", ((0, 0, 1),), ()))
    parent.location, parent.instance_type = (9.0, 0.0, 0.0), "VERTS"
    parent.data["part"] = "of instancer's data"
    collection("Parents").objects.link(parent)
    # The child is shown at its parent's vertex, and below that as itself.
    square("Child", 0.0, into=bpy.data.collections["Parents"]).parent = parent
    square("Painted", 12.0).data.materials.append(painted)
    plain = square("Plain", 15.0)
    plain.data.materials.append(bpy.data.materials.new("plain"))
    for name in ("Alpha", "Zulu"):
        collection(name).objects.link(plain)
    scene.collection.objects.unlink(plain)
    bpy.context.view_layer.update()
    return scene
