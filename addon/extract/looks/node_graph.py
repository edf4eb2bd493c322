"""The way from a socket back to what feeds it, through reroutes, muted nodes and the walls of node groups."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import bpy

# Whether all materials and worlds have nodes: to ask each of them takes long where it is out of date to ask.
USES_NODES = bpy.app.version >= (5, 0, 0)
# The type of nodes that Blender does not have: those of other render engines, even where their add-on is missing.
FOREIGN = "CUSTOM"
GROUPS = frozenset({"GROUP", "CUSTOM GROUP"})
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


def trace_back(
    socket: Any, scope: Scope | None, note_foreign: Callable[[Any], None] | None = None
) -> tuple[Any, Scope | None]:
    """Find what an input socket's value comes from: another node's output, or an input that has a value of its own.

    As in Cycles, the last socket on the way that is not a muted node's or a reroute's has its own value if what is
    linked to it leads nowhere: muted nodes without a link inside, links that are muted or invalid, foreign nodes.

    Args:
        socket: An input.
        scope: The group that its node stands in.
        note_foreign: Takes a node of another render engine that is met; Cycles ignores it.
    """
    own = socket, scope
    for _ in range(_LONGEST_WAY):
        link = socket.links[0] if socket.is_linked and socket.links else None
        if link is None or link.is_muted or not link.is_valid:
            return own
        node, output = link.from_node, link.from_socket
        if node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.mute:
            within = next((way.from_socket for way in node.internal_links if way.to_socket == output), None)
            if within is None:
                return own
            socket = within
        elif node.type == FOREIGN:
            if note_foreign is not None:
                note_foreign(node)
            return own
        else:
            passed_on, inner = _beyond_wall(output, scope)
            if passed_on is None:
                return output, scope
            own = socket, scope = passed_on, inner
    return own


def is_group(node: Any) -> bool:
    """Say whether a node shows the nodes of a group."""
    return node.type in GROUPS and node.node_tree is not None


def is_fed(socket: Any, scope: Scope | None) -> bool:
    """Say whether an input's value comes from another node."""
    return bool(socket.is_linked and trace_back(socket, scope)[0].is_output)


def find_output(tree: Any) -> tuple[Any, Scope | None] | None:
    """Find the output node that Cycles shows and the group that it stands in, None without one.

    A node for Cycles alone counts before one for all engines, and then one of the tree before those of groups in it.
    """
    found = [*_outputs_in(tree, None)]
    exact = (place for place in found if place[0].target == "CYCLES")
    return next(exact, found[0] if found else None)


def _outputs_in(tree: Any, scope: Scope | None) -> Iterator[tuple[Any, Scope | None]]:
    output = tree.get_output_node("CYCLES")
    if output is not None:
        yield output, scope
    for node in tree.nodes:
        if is_group(node) and not node.mute:
            yield from _outputs_in(node.node_tree, Scope(node, scope))


def _beyond_wall(output: Any, scope: Scope | None) -> tuple[Any, Scope | None]:
    """Find what leads to a group's output, or to an output of its Group Input; None for other nodes' outputs."""
    node = output.node
    if is_group(node):
        return _find(_output_of(node.node_tree), output), Scope(node, scope)
    if node.type == "GROUP_INPUT" and scope is not None:
        return _find(scope.node.inputs, output), scope.outer
    return None, scope


def _output_of(tree: Any) -> Any:
    nodes = [node for node in tree.nodes if node.type == "GROUP_OUTPUT"]
    active = next((node for node in nodes if node.is_active_output), None)
    return () if active is None else active.inputs


def _find(sockets: Any, wanted: Any) -> Any:
    return next((socket for socket in sockets if socket.identifier == wanted.identifier), None)
