"""Random edits of a scene, one after the other, and after each the proof that the synced scene is Blender's.

A `Soak` edits a small scene that holds every kind of thing: plain, linked and modified meshes, text, curves, nodes,
collection instances, keyframes. `step()` edits, syncs, and compares with a reading that uses no cache, no view and no
bulk path, and every ray with a scene that has never seen anything else. The same seed makes the same edits.

    python tests/blender/soak.py --steps 20000 --json soak.json
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import bpy
import numpy as np
import perfect_bvh
from blender.builders import (
    SQUARE,
    TETRAHEDRON,
    camera_object,
    collection,
    collection_instance,
    in_render,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
    object_info,
)
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import geometry_instances, read_scene
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.sync.lookup import SceneLookup
from perfect_bvh_addon.sync.records import AttributeRequest, SceneRecord
from perfect_bvh_addon.sync.state import SceneState
from perfect_bvh_addon.sync.verify import find_mismatches

MOST_OBJECTS = 14
ALL_ATTRIBUTES = AttributeRequest(material_slots=True, corner_normals=True, corner_uvs=True)
MODIFIERS = ("SUBSURF", "ARRAY", "MIRROR", "WAVE", "SOLIDIFY", "TRIANGULATE", "DECIMATE")
FIELDS = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals")


class DifferenceError(AssertionError):
    """The synced scene is not Blender's."""


class Soak:
    """One scene, one sync of its viewport and one of its renders.

    watches: whether Blender's handlers tell what was evaluated; without them everything is read at every update.
    is_plain: only with such instances as can be read from their geometry, so that they are.
    """

    def __init__(self, seed: int, *, watches: bool, is_plain: bool = False) -> None:
        self.seed = seed
        self.is_plain = is_plain
        self.done: list[str] = []
        self.counts: Counter[str] = Counter()
        self._random = np.random.default_rng(seed)
        self._made = 0
        bpy.ops.wm.read_factory_settings(use_empty=True)
        _fill(is_plain)
        bpy.ops.ed.undo_push(message="start")
        self.sync = SceneSync(ALL_ATTRIBUTES, watch=watches)
        self.render_sync = SceneSync(ALL_ATTRIBUTES, watch=False)
        self._rays = _rays(self._random)

    def close(self) -> None:
        self.sync.close()
        self.render_sync.close()

    def step(self) -> None:
        """One edit or a few, then the proof. Raises DifferenceError."""
        for _ in range(self._random.choice((1, 1, 1, 2, 4))):
            self._edit()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        self._check(self.sync, depsgraph)
        if self._random.random() < 0.04:
            self.counts["render"] += 1
            in_render(lambda made: self._check(self.render_sync, made))

    def _edit(self) -> None:
        name = str(self._random.choice(tuple(EDITS)))
        try:
            EDITS[name](self)
        except (_NothingToEditError, RuntimeError):  # an operator without the context that it wants
            return
        finally:
            if bpy.context.mode != "OBJECT":
                bpy.ops.object.mode_set(mode="OBJECT")
        self.done.append(name)
        self.counts[name] += 1
        if name not in {"undo", "redo"}:  # Blender crashes when it goes back past edits that were not pushed
            bpy.ops.ed.undo_push(message=name)

    def _check(self, sync: SceneSync, depsgraph: Any) -> None:
        report = sync.update(depsgraph)
        self.counts["meshes passed over"] += sum(mesh.reason.startswith("Blender did not") for mesh in report.meshes)
        self.counts["meshes"] += len(report.meshes)
        self.counts["instances read from geometry"] += self._reads_geometry(depsgraph)
        certain = read_scene(depsgraph, ALL_ATTRIBUTES, reader=ArrayReader(use_views=False))
        found = [*find_mismatches(sync.record, certain), *_different_answers(sync, certain, self._rays)]
        if found:
            raise DifferenceError(f"seed {self.seed}, after {len(self.done)} edits: {found}; last: {self.done[-8:]}")

    def _reads_geometry(self, depsgraph: Any) -> int:
        """How many instances can do without Blender's list now."""
        surveyed = geometry_instances.survey(depsgraph)
        return sum(len(instancer.points.points) for _, instancer in surveyed or () if instancer is not None)

    # What edits choose among ------------------------------------------------------------------------------------------

    def number(self, low: float = -3.0, high: float = 3.0) -> float:
        return float(self._random.uniform(low, high))

    def vector(self, low: float = -3.0, high: float = 3.0) -> tuple[float, float, float]:
        return self.number(low, high), self.number(low, high), self.number(low, high)

    def pick(self, things: Any) -> Any:
        things = list(things)
        if not things:
            raise _NothingToEditError
        return things[self._random.integers(len(things))]

    def an_object(self, kind: str | None = None) -> Any:
        return self.pick(obj for obj in bpy.data.objects if obj.type != "CAMERA" and kind in (None, obj.type))

    def name(self, kind: str) -> str:
        self._made += 1
        return f"{kind} {self._made}"


class _NothingToEditError(Exception):
    pass


def _fill(is_plain: bool) -> None:
    camera_object().location.z = 20.0
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 4
    mesh_object("box")
    shared = mesh_data("shared", *SQUARE)
    mesh_object("left", shared, location=(-3, 0, 0))
    mesh_object("right", shared, location=(3, 0, 0))
    mesh_object("smooth", location=(0, 3, 0)).modifiers.new("subsurf", "SUBSURF")
    instances_on_grid("field", made_cube, 3).location = (0, -8, 0)
    instances_on_grid("herd", object_info(bpy.data.objects["box"]), 3).location = (0, 8, 1)
    inner = collection("inner", linked=is_plain)
    mesh_object("leaf", collection=inner)
    if not is_plain:
        collection_instance("tree", inner, location=(6, 6, 0))
    collection("drawer")
    bpy.data.materials.new("red")
    moving = mesh_object("moving", location=(-6, 5, 0))
    for frame, x in ((1, -6.0), (20, 6.0)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    shaped = mesh_object("shaped", location=(-6, -3, 0))
    shaped.shape_key_add(name="Basis")
    shaped.shape_key_add(name="tall").data[3].co.z = 3.0
    for frame, value in ((1, 0.0), (20, 1.0)):
        key = shaped.data.shape_keys.key_blocks["tall"]
        key.value = value
        key.keyframe_insert("value", frame=frame)


# Edits ---------------------------------------------------------------------------------------------------------------


def add(soak: Soak) -> None:
    if len(bpy.data.objects) > MOST_OBJECTS:
        raise _NothingToEditError
    kinds = ("mesh", "linked", "field", "herd", "member")
    kind = soak.pick(kinds if soak.is_plain else (*kinds, "text", "curve", "tree"))
    name, place = soak.name(kind), soak.vector()
    if kind == "mesh":
        mesh_object(name, mesh_data(name, *soak.pick((SQUARE, TETRAHEDRON))), location=place)
    elif kind == "linked":
        mesh_object(name, soak.an_object("MESH").data, location=place)
    elif kind == "text":
        _link(bpy.data.objects.new(name, bpy.data.curves.new(name, "FONT"))).data.body = "ab"
    elif kind == "curve":
        data = bpy.data.curves.new(name, "CURVE")
        data.bevel_depth = 0.3
        data.splines.new("POLY").points.add(2)
        for point in data.splines[0].points:
            point.co = (*soak.vector(), 1.0)
        _link(bpy.data.objects.new(name, data))
    elif kind == "field":
        instances_on_grid(name, made_cube, 2, keep_own=bool(soak.number() > 0)).location = place
    elif kind == "herd":
        instances_on_grid(name, object_info(soak.an_object("MESH")), 2).location = place
    elif kind == "tree":
        collection_instance(name, bpy.data.collections["inner"], location=place)
    else:
        mesh_object(name, collection=bpy.data.collections["inner"], location=place)


def _link(obj: Any) -> Any:
    bpy.context.scene.collection.objects.link(obj)
    return obj


def delete(soak: Soak) -> None:
    if len(bpy.data.objects) < 6:
        raise _NothingToEditError
    obj = soak.an_object()
    # Blender does not evaluate nodes again when their object is deleted, and crashes over what they still show.
    for group in bpy.data.node_groups:
        for node in group.nodes:
            if node.bl_idname == "GeometryNodeObjectInfo" and node.inputs["Object"].default_value == obj:
                node.inputs["Object"].default_value = None
    bpy.data.objects.remove(obj)


def unlink(soak: Soak) -> None:
    obj = soak.an_object()
    soak.pick(obj.users_collection).objects.unlink(obj)


def relink(soak: Soak) -> None:
    obj = soak.pick(obj for obj in bpy.data.objects if not obj.users_collection)
    soak.pick((bpy.context.scene.collection, bpy.data.collections["drawer"])).objects.link(obj)


def move(soak: Soak) -> None:
    soak.an_object().location = soak.vector(-6, 6)


def turn(soak: Soak) -> None:
    soak.an_object().rotation_euler = soak.vector()


def scale(soak: Soak) -> None:
    soak.an_object().scale = soak.pick(((1, 1, 1), (-1, 1, 1), (1, 1, 0), soak.vector(0.5, 2.0)))


def deform(soak: Soak) -> None:
    data = soak.an_object("MESH").data
    points = np.empty(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_get("co", points)
    data.vertices.foreach_set("co", points * np.float32(soak.number(0.7, 1.4)))
    data.update()


def retopologise(soak: Soak) -> None:
    data = soak.an_object("MESH").data
    if data.shape_keys is not None:
        raise _NothingToEditError
    vertices, faces = TETRAHEDRON
    faces = soak.pick((faces, faces[:3], ((0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3)), ((0, 1, 3, 2),)))
    data.clear_geometry()
    data.from_pydata(vertices, [], faces)
    data.update()


def edit_in_edit_mode(soak: Soak) -> None:
    obj = soak.pick(obj for obj in bpy.context.view_layer.objects if obj.type == "MESH" and obj.visible_get())
    bpy.context.view_layer.objects.active = obj
    import bmesh  # comes with bpy, and not before it

    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    for vertex in edited.verts:
        vertex.co.z += soak.number(-0.3, 0.3)
    bmesh.update_edit_mesh(obj.data)
    soak._check(soak.sync, bpy.context.evaluated_depsgraph_get())
    bpy.ops.object.mode_set(mode="OBJECT")


def parent(soak: Soak) -> None:
    child, owner = soak.an_object(), soak.an_object()
    above = owner
    while above is not None:
        if above == child:
            raise _NothingToEditError
        above = above.parent
    child.parent = owner


def unparent(soak: Soak) -> None:
    soak.an_object().parent = None


def hide(soak: Soak) -> None:
    obj, switch = soak.an_object(), soak.pick(("hide_viewport", "hide_render", "visible_camera", "visible_shadow"))
    setattr(obj, switch, not getattr(obj, switch))


def hide_with_the_eye(soak: Soak) -> None:
    obj = soak.pick(bpy.context.view_layer.objects)
    obj.hide_set(not obj.hide_get())


def hide_an_instancer(soak: Soak) -> None:
    if soak.is_plain:
        raise _NothingToEditError
    obj = soak.an_object()
    obj.show_instancer_for_viewport = not obj.show_instancer_for_viewport


def exclude(soak: Soak) -> None:
    layer = soak.pick(bpy.context.view_layer.layer_collection.children)
    layer.exclude = not layer.exclude


def put_into_a_drawer(soak: Soak) -> None:
    obj = soak.an_object()
    if "drawer" not in {owner.name for owner in obj.users_collection}:
        bpy.data.collections["drawer"].objects.link(obj)


def link_data(soak: Soak) -> None:
    soak.an_object("MESH").data = soak.an_object("MESH").data


def make_single_user(soak: Soak) -> None:
    obj = soak.an_object("MESH")
    obj.data = obj.data.copy()


def duplicate(soak: Soak) -> None:
    if len(bpy.data.objects) > MOST_OBJECTS:
        raise _NothingToEditError
    copy = soak.an_object().copy()
    copy.name, copy.location = soak.name("copy"), soak.vector()
    _link(copy)


def add_modifier(soak: Soak) -> None:
    obj = soak.an_object("MESH")
    if len(obj.modifiers) < 3:
        obj.modifiers.new("added", soak.pick(MODIFIERS))


def remove_modifier(soak: Soak) -> None:
    obj = soak.pick(obj for obj in bpy.data.objects if obj.modifiers)
    obj.modifiers.remove(soak.pick(obj.modifiers))


def switch_modifier(soak: Soak) -> None:
    modifier = soak.pick(modifier for obj in bpy.data.objects for modifier in obj.modifiers)
    modifier.show_viewport = not modifier.show_viewport


def change_nodes(soak: Soak) -> None:
    node = soak.pick(
        node
        for group in bpy.data.node_groups
        for node in group.nodes
        if node.bl_idname in {"GeometryNodeMeshGrid", "GeometryNodeMeshCube"}
    )
    if node.bl_idname == "GeometryNodeMeshGrid":
        name = soak.pick(("Size X", "Size Y", "Vertices X"))
        node.inputs[name].default_value = int(soak.number(1, 4)) if name == "Vertices X" else soak.number(3, 12)
    else:
        name = soak.pick(("Size", "Vertices X"))
        node.inputs[name].default_value = int(soak.number(2, 4)) if name == "Vertices X" else soak.vector(0.5, 2)


def change_frame(soak: Soak) -> None:
    bpy.context.scene.frame_set(int(soak.number(1, 24)))


def undo(_: Soak) -> None:
    bpy.ops.ed.undo()


def redo(soak: Soak) -> None:
    bpy.ops.ed.undo()
    if soak.number() > 0:
        soak._check(soak.sync, bpy.context.evaluated_depsgraph_get())
    bpy.ops.ed.redo()


def rename(soak: Soak) -> None:
    soak.an_object().name = soak.name("renamed")


def paint(soak: Soak) -> None:
    obj = soak.an_object("MESH")
    if len(obj.data.materials) < 3:
        obj.data.materials.append(soak.pick((None, *bpy.data.materials)))
    bpy.data.materials["red"].diffuse_color = (*np.abs(soak.vector()), 1.0)
    for polygon in obj.data.polygons:
        polygon.material_index = int(soak.number(0, 3))


def link_material_to_the_object(soak: Soak) -> None:
    slot = soak.pick(slot for obj in bpy.data.objects for slot in obj.material_slots)
    slot.link = soak.pick(("OBJECT", "DATA"))


def look_elsewhere(soak: Soak) -> None:
    scene = bpy.context.scene
    if scene.camera is not None:
        scene.camera.location = soak.vector(5, 20)
        scene.camera.data.lens = soak.number(20, 80)
    scene.render.film_transparent = soak.number() > 0


def nothing(_: Soak) -> None:
    pass


EDITS: dict[str, Callable[[Soak], None]] = {
    function.__name__: function
    for function in (
        add,
        delete,
        unlink,
        relink,
        move,
        turn,
        scale,
        deform,
        retopologise,
        edit_in_edit_mode,
        parent,
        unparent,
        hide,
        hide_with_the_eye,
        hide_an_instancer,
        exclude,
        put_into_a_drawer,
        link_data,
        make_single_user,
        duplicate,
        add_modifier,
        remove_modifier,
        switch_modifier,
        change_nodes,
        change_frame,
        undo,
        redo,
        rename,
        paint,
        link_material_to_the_object,
        look_elsewhere,
        nothing,
    )
}

# Proof ---------------------------------------------------------------------------------------------------------------


def _rays(random: np.random.Generator, count: int = 1200) -> tuple[np.ndarray, np.ndarray]:
    """From above on a grid, and crosswise at random."""
    x, y = np.meshgrid(np.linspace(-13, 13, 40), np.linspace(-13, 13, 40))
    above = np.stack([x.ravel(), y.ravel(), np.full(x.size, 30.0)], axis=1)
    around = random.uniform((-13, -13, -4), (13, 13, 8), (count, 3))
    directions = np.concatenate([np.broadcast_to([0.0, 0.0, -1.0], above.shape), random.normal(size=(count, 3))])
    return np.concatenate([above, around]), directions


def _different_answers(sync: SceneSync, certain: SceneRecord, rays: tuple[np.ndarray, np.ndarray]) -> list[str]:
    """Which answers differ from those of a scene that knows nothing but the certain record."""
    fresh = SceneState(perfect_bvh.Scene)
    fresh.update(certain)
    lookup = SceneLookup(certain, fresh.instance_ids, fresh.mesh_ids, fresh.scene.scene_id, fresh.mesh_generations)
    one, other = (scene.cast_rays(*rays, fields=FIELDS) for scene in (sync.scene, fresh.scene))
    names = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals")
    found = [name for name in names if not np.array_equal(getattr(one, name), getattr(other, name))]
    mine, theirs = sync.describe(one.instance_ids), lookup.describe(other.instance_ids)
    found += [name for name in mine._fields if not np.array_equal(getattr(mine, name), getattr(theirs, name))]
    if not np.array_equal(sync.polygon_ids(one), lookup.polygon_ids(other)):
        found.append("polygon_ids")
    seen, expected = (scene.cast_rays(*rays, mask=1) for scene in (sync.scene, fresh.scene))
    return found + ([] if np.array_equal(seen.t_hit, expected.t_hit) else ["t_hit of camera rays"])


# Long runs -----------------------------------------------------------------------------------------------------------


def run(steps: int, *, first_seed: int = 0, steps_a_seed: int = 250) -> dict[str, Any]:
    """As many steps as asked for, over as many seeds as that takes; handlers are on for every other seed."""
    started = time.perf_counter()
    counts: Counter[str] = Counter()
    differences: list[str] = []
    done, seed = 0, first_seed
    while done < steps:
        soak = Soak(seed, watches=seed % 2 == 0, is_plain=seed // 2 % 2 == 0)
        try:
            for _ in range(min(steps_a_seed, steps - done)):
                done += 1
                soak.step()
        except DifferenceError as difference:
            differences.append(str(difference))
        finally:
            soak.close()
            counts += soak.counts
        seed += 1
    return {
        "steps": done,
        "seeds": [first_seed, seed - 1],
        "differences": differences,
        "edits": {name: counts[name] for name in (*EDITS, "render")},
        "meshes_compared": counts["meshes"],
        "meshes_passed_over": counts["meshes passed over"],
        "instances_read_from_geometry": counts["instances read from geometry"],
        "seconds": round(time.perf_counter() - started, 1),
        "blender": bpy.app.version_string,
        "perfect_bvh": perfect_bvh.__version__,
        "isa": perfect_bvh.active_isa(),
        "machine": platform.machine(),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description="Edit scenes at random and compare each synced one with Blender.")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="where to write what was done and found")
    arguments = parser.parse_args()
    result = run(arguments.steps, first_seed=arguments.first_seed)
    text = json.dumps(result, indent=2)
    if arguments.json is not None:
        arguments.json.write_text(text + "\n", encoding="utf-8")
    sys.stdout.write(text + "\n")
    return 1 if result["differences"] else 0


if __name__ == "__main__":
    sys.exit(main())
