"""The way from a socket back to what feeds it, through reroutes, muted nodes and the walls of node groups."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

# Whether all materials and worlds have nodes: to ask each of them takes long where it is out of date to ask.
USES_NODES = bpy.app.version >= (5, 0, 0)
# Of nodes that only pass on, and of groups one in another. Trees may hold loops.
_LONGEST_WAY = 1000


@dataclass(frozen=True, slots=True)
class Scope:
    """The group that a node stands in. node: its group node, which stands in the scope `outer`, None at the top."""

    node: Any
    outer: Scope | None

    @property
    def key(self) -> tuple[int, ...]:
        """What tells two uses of one group apart."""
        return (self.node.as_pointer(), *(self.outer.key if self.outer is not None else ()))


# By a node's type. What is written here is the same for all nodes of a type.
_identifiers: dict[str, list[str]] = {}


def inputs_of(node: Any) -> dict[str, Any]:
    """The inputs of a node that always has the same ones, by identifier: the quickest way to more than a few."""
    identifiers = _identifiers.get(node.type)
    if identifiers is None:
        identifiers = _identifiers[node.type] = [socket.identifier for socket in node.inputs]
    return dict(zip(identifiers, node.inputs.values(), strict=True))


def trace_back(socket: Any, scope: Scope | None) -> tuple[Any, Scope | None]:
    """What an input socket's value comes from: another node's output, or an input that has a value of its own."""
    for _ in range(_LONGEST_WAY):
        link = socket.links[0] if socket.is_linked and socket.links else None
        if link is None or link.is_muted:
            return socket, scope
        node, output = link.from_node, link.from_socket
        if node.type == "REROUTE":
            passed_on = node.inputs[0]
        elif node.mute:
            passed_on = next((way.from_socket for way in node.internal_links if way.to_socket == output), None)
        elif node.type == "GROUP" and node.node_tree is not None:
            passed_on, scope = _find(_output_of(node.node_tree), output), Scope(node, scope)
        elif node.type == "GROUP_INPUT" and scope is not None:
            passed_on, scope = _find(scope.node.inputs, output), scope.outer
        else:
            return output, scope
        if passed_on is None:  # nothing is led through
            return output, scope
        socket = passed_on
    return socket, scope


def _output_of(tree: Any) -> Any:
    nodes = [node for node in tree.nodes if node.type == "GROUP_OUTPUT"]
    active = next((node for node in nodes if node.is_active_output), None)
    return () if active is None else active.inputs


def _find(sockets: Any, wanted: Any) -> Any:
    return next((socket for socket in sockets if socket.identifier == wanted.identifier), None)
