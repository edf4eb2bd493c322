"""Small geometry-nodes groups, written as calls: each call adds a node, links its inputs and returns its output."""

from __future__ import annotations

from typing import Any

import bpy


class NodeTree:
    """A geometry-nodes group with one geometry in and one out."""

    def __init__(self, name: str) -> None:
        self.group = bpy.data.node_groups.new(name, "GeometryNodeTree")
        self.group.is_modifier = True
        self.group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        self.group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        self.geometry = self.group.nodes.new("NodeGroupInput").outputs[0]
        self._out = self.group.nodes.new("NodeGroupOutput")

    def add(self, kind: str, inputs: dict[Any, Any] | None = None, output: int | str = 0, **settings: Any) -> Any:
        """One node: settings are its properties, inputs its sockets (a value, or another node's output)."""
        node = self.group.nodes.new(kind)
        node.location = (190.0 * (len(self.group.nodes) - 2), 0.0)
        for setting, value in settings.items():
            setattr(node, setting, value)
        for name, value in (inputs or {}).items():
            if isinstance(value, bpy.types.NodeSocket):
                self.group.links.new(value, node.inputs[name])
            else:
                node.inputs[name].default_value = value
        return node.outputs[output]

    def math(self, operation: str, *values: Any) -> Any:
        """A number from numbers: "ADD", "SINE", "ARCTAN2" and so on."""
        return self.add("ShaderNodeMath", dict(enumerate(values)), operation=operation)

    def attribute(self, name: str, kind: str = "FLOAT") -> Any:
        """A named attribute of the geometry; kind: FLOAT, INT, BOOLEAN or FLOAT_VECTOR."""
        return self.add("GeometryNodeInputNamedAttribute", {"Name": name}, "Attribute", data_type=kind)

    def frame(self) -> Any:
        """The scene's current frame."""
        return self.add("GeometryNodeInputSceneTime", output="Frame")

    def finish(self, geometry: Any) -> Any:
        """Makes `geometry` the result. Returns the group."""
        self._out.location = (190.0 * (len(self.group.nodes) - 1), 0.0)
        self.group.links.new(geometry, self._out.inputs[0])
        return self.group


def use_group(item: Any, group: Any) -> None:
    """A modifier on an object that runs a group."""
    item.modifiers.new(group.name, "NODES").node_group = group


def add_attribute(mesh: Any, name: str, kind: str, values: Any) -> None:
    """A named attribute on a mesh's vertices, for the groups to read."""
    field = "vector" if kind == "FLOAT_VECTOR" else "value"
    mesh.attributes.new(name, kind, "POINT").data.foreach_set(field, values)
