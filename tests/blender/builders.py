"""Small objects for test scenes, and helpers that inspect the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from perfect_bvh_addon.sync.records import SceneRecord

TETRAHEDRON = (
    ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
)
SQUARE = (((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), ((0, 1, 2, 3),))


def mesh_data(
    name: str, vertices: Sequence[Sequence[float]] = TETRAHEDRON[0], faces: Sequence[Sequence[int]] = TETRAHEDRON[1]
) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    return mesh


def mesh_object(name: str, data: Any = None, collection: Any = None, location: Sequence[float] = (0, 0, 0)) -> Any:
    """Link a new object; its mesh is a tetrahedron unless data is given. collection False: it is in no collection."""
    obj = bpy.data.objects.new(name, mesh_data(name) if data is None else data)
    obj.location = location
    if collection is not False:
        (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def collection(name: str, parent: Any = None, *, linked: bool = True) -> Any:
    made = bpy.data.collections.new(name)
    if linked:
        (parent or bpy.context.scene.collection).children.link(made)
    return made


def collection_instance(name: str, instanced: Any, into: Any = None, location: Sequence[float] = (0, 0, 0)) -> Any:
    empty = bpy.data.objects.new(name, None)
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", instanced, location
    (into or bpy.context.scene.collection).objects.link(empty)
    return empty


def camera_object(name: str = "camera", **settings: Any) -> Any:
    data = bpy.data.cameras.new(name)
    for key, value in settings.items():
        setattr(data, key, value)
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.camera = obj
    return obj


class NodeGroup:
    """A geometry node group under construction, for the modifier of one object."""

    def __init__(self, name: str) -> None:
        self.tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        self.tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        self.tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        self.input = self.tree.nodes.new("NodeGroupInput")
        self.output = self.tree.nodes.new("NodeGroupOutput")

    def node(self, kind: str, **inputs: Any) -> Any:
        node = self.tree.nodes.new(kind)
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node

    def link(self, source: Any, target: Any) -> None:
        self.tree.links.new(source, target)

    def show(self, *geometries: Any) -> NodeGroup:
        join = self.tree.nodes.new("GeometryNodeJoinGeometry")
        for geometry in geometries:
            self.link(geometry, join.inputs[0])
        self.link(join.outputs[0], self.output.inputs[0])
        return self

    def apply_to(self, obj: Any) -> Any:
        modifier = obj.modifiers.new("nodes", "NODES")
        modifier.node_group = self.tree
        return modifier


def instances_on_grid(name: str, shown: Callable[[NodeGroup], Any], count: int = 2, *, keep_own: bool = False) -> Any:
    """An object whose nodes show a geometry at the points of a grid of count x count points, 10 units wide."""
    group = NodeGroup(name)
    grid = group.node("GeometryNodeMeshGrid", Size_X=10.0, Size_Y=10.0, Vertices_X=count, Vertices_Y=count)
    on_points = group.node("GeometryNodeInstanceOnPoints")
    group.link(grid.outputs["Mesh"], on_points.inputs["Points"])
    group.link(shown(group), on_points.inputs["Instance"])
    own = [group.input.outputs[0]] if keep_own else []
    group.show(*own, on_points.outputs["Instances"])
    obj = mesh_object(name)
    group.apply_to(obj)
    return obj


def made_cube(group: NodeGroup) -> Any:
    return group.node("GeometryNodeMeshCube").outputs["Mesh"]


def object_info(obj: Any) -> Callable[[NodeGroup], Any]:
    def add(group: NodeGroup) -> Any:
        return group.node("GeometryNodeObjectInfo", Object=obj, As_Instance=True).outputs["Geometry"]

    return add


def evaluated() -> Any:
    """Return the viewport's depsgraph, brought up to date."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    depsgraph.update()
    return depsgraph


class _ProbeEngine(bpy.types.RenderEngine):
    bl_idname = "PERFECT_BVH_TEST_PROBE"
    bl_label = "Probe"
    visit: Callable[[Any], Any] | None = None
    result: Any = None
    error: Exception | None = None

    def render(self, depsgraph: Any) -> None:
        cls = type(self)
        assert cls.visit is not None
        try:
            cls.result = cls.visit(depsgraph)
        except Exception as error:  # noqa: BLE001 - Blender swallows it; in_render raises it again
            cls.error = error


def in_render(visit: Callable[[Any], Any]) -> Any:
    """Return the result of `visit` for the depsgraph of a final render."""
    if bpy.context.scene.camera is None:
        camera_object("probe camera")
    bpy.utils.register_class(_ProbeEngine)
    engine = bpy.context.scene.render.engine
    try:
        _ProbeEngine.visit, _ProbeEngine.error = staticmethod(visit), None
        bpy.context.scene.render.engine = _ProbeEngine.bl_idname
        bpy.ops.render.render()
    finally:
        bpy.context.scene.render.engine = engine
        bpy.utils.unregister_class(_ProbeEngine)
    if _ProbeEngine.error is not None:
        raise _ProbeEngine.error
    return _ProbeEngine.result


Soup = list[tuple[str, str, int, tuple[float, ...]]]


def soup_of(record: SceneRecord) -> Soup:
    """Return every triangle in world space: (object, instancer, polygon, nine coordinates), sorted."""
    soup: Soup = []
    instances = record.instances
    for row in range(len(instances)):
        mesh = record.meshes[instances.mesh_indices[row]]
        obj = record.objects[instances.object_indices[row]]
        parent = instances.parent_indices[row]
        matrix = instances.transforms[row]
        corners = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        soup += _triangles(
            obj.name, record.objects[parent].name if parent >= 0 else "", mesh.polygon_ids, corners[mesh.triangles]
        )
    return sorted(soup)


def reference_soup(depsgraph: Any) -> Soup:
    """Return the same as `soup_of`, read element by element through Blender's accessors."""
    soup: Soup = []
    for instance in depsgraph.object_instances:
        data = instance.object.data
        if not isinstance(data, bpy.types.Mesh) or not instance.show_self:
            continue
        data.calc_loop_triangles()
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        corners = np.array(
            [[data.vertices[vertex].co for vertex in triangle.vertices] for triangle in data.loop_triangles],
            dtype=np.float64,
        ).reshape(-1, 3, 3)
        soup += _triangles(
            instance.object.name,
            instance.parent.name if instance.is_instance else "",
            [triangle.polygon_index for triangle in data.loop_triangles],
            corners @ matrix[:3, :3].T + matrix[:3, 3],
        )
    return sorted(soup)


def _triangles(name: str, parent: str, polygons: Sequence[int], corners: npt.NDArray[np.float64]) -> Soup:
    return [
        (name, parent, int(polygon), tuple(np.round(triangle.reshape(-1), 5) + 0.0))
        for polygon, triangle in zip(polygons, corners, strict=True)
    ]


def shown_names(record: SceneRecord) -> set[str]:
    """Return the names of all visible instances: `object`, or `instancer/object`."""
    instances = record.instances
    names = set()
    for row in range(len(instances)):
        parent = instances.parent_indices[row]
        name = record.objects[instances.object_indices[row]].name
        names.add(f"{record.objects[parent].name}/{name}" if parent >= 0 else name)
    return names


def layer_of(name: str) -> Any:
    return bpy.context.view_layer.layer_collection.children[name]
