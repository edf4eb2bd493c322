"""What of one material, light or world is not shown, noted while its nodes are read: each thing once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...sync.not_shown import Kind, NotShown
from .node_graph import Scope, trace_back
from .shown_nodes import FLAT, IGNORED_INPUTS, SIMPLIFIED_NODES, IgnoredInput, name_of

_CONSTANTS = frozenset({"VALUE", "RGB"})


class Omissions:
    """count: how often anything was noted or met again so far. kind: what the nodes are of."""

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.count = 0
        self._instead: dict[str, str] = {}

    def note(self, what: str, instead: str = FLAT) -> None:
        """That `what` is not shown, and what is instead."""
        self.count += 1
        self._instead.setdefault(what, instead)

    def note_node(self, node: Any, output: Any = None, instead: str = FLAT) -> None:
        """The same of a node, one of whose outputs is asked for."""
        self.note(name_of(node, output), instead)

    def note_foreign(self, node: Any) -> None:
        """Note a node of another render engine, which Cycles does not show either."""
        self.note_node(node, instead="what Cycles shows without it is")

    def note_no_output(self, instead: str) -> None:
        """Note that Cycles looks at no output node of a tree."""
        self.note("a tree without an output for Cycles", instead)

    def note_simplified(self, node: Any, output: Any = None) -> None:
        """A node that the table says is shown as something plainer, if this one is."""
        instead = SIMPLIFIED_NODES.get(node.type)
        if instead is not None:
            self.note_node(node, output, instead)

    @property
    def mark(self) -> int:
        """For `since`."""
        return len(self._instead)

    def since(self, mark: int, instead: str) -> None:
        """What became of all that was noted since the mark."""
        for what in list(self._instead)[mark:]:
            self._instead[what] = instead

    def note_ignored(self, kind: str, inputs: Mapping[str, Any], scope: Scope | None) -> None:
        """The inputs of a shader node of this type that change what it looks like and are not shown."""
        for wanted in IGNORED_INPUTS.get(kind, ()):
            socket = inputs.get(wanted.identifier)
            if socket is not None and (socket.is_linked or not _is_neutral(socket, wanted)):
                self._note_input(socket, wanted, scope)

    def _note_input(self, socket: Any, wanted: IgnoredInput, scope: Scope | None) -> None:
        output, _ = trace_back(socket, scope)
        is_fixed = not output.is_output or output.node.type in _CONSTANTS
        if is_fixed and _is_neutral(output, wanted):
            return
        if wanted.name:
            self.note(wanted.name, wanted.instead)
        elif not (output.node.type == "NEW_GEOMETRY" and output.identifier == "Normal"):
            self.note_node(output.node, output, wanted.instead)

    def rows(self, block: Any) -> list[NotShown]:
        """One for each thing. block: the evaluated material, light or world that it is of."""
        uid = block.original.session_uid
        rows = self._instead.items()
        return [NotShown(self.kind, block.name, uid, f"{what} is not shown; {instead}") for what, instead in rows]


def _is_neutral(socket: Any, wanted: IgnoredInput) -> bool:
    """Whether the value of a socket that nothing is linked to changes nothing."""
    if wanted.neutral is None:
        return True
    value = getattr(socket, "default_value", wanted.neutral)
    channels = value[:3] if hasattr(value, "__len__") else (value,)
    return all(channel == wanted.neutral for channel in channels)
