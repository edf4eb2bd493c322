"""The value of a node's socket: a constant, or instructions of the material's program.

Values that cannot be known (of unsupported nodes) are guesses, and so are values that depend only on guesses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from perfect_bvh.nodes import Operand, Output, channels_of, width_of

from .node_graph import GROUPS, Omissions, Scope, is_fed, trace_back
from .values import (
    ImageRows,
    Nodes,
    Source,
    Value,
    constant,
)

HALF = "half of each is used"
_DEEPEST = 150
_RENAMED = {"Fac": "Factor", "Bright": "Brightness", "Color1": "Color 1", "Color2": "Color 2"}


class ValueReader:
    """Reads sockets of one node tree into `nodes`. fallback: the colour in place of unknown values.

    omissions: receives the unsupported parts of the nodes.
    is_camera: whether nodes that depend on the kind of ray get the camera's. pass_index: of the
    material. sources: returns the row of a source among the instances' values.
    """

    def __init__(
        self,
        images: ImageRows,
        fallback: Value,
        omissions: Omissions | None = None,
        is_camera: bool = True,
        pass_index: int = 0,
        sources: dict[Source, int] | None = None,
    ) -> None:
        self.nodes = Nodes()
        self.images = images
        self.omissions = omissions or Omissions("material")
        self.pass_index = float(pass_index)
        self._sources = sources
        self.fallback = Value(fallback.operand, is_guess=True)
        self.is_camera = float(is_camera)
        self.was_asked_for_rays = False
        self.bump_width: float | None = None  # pixels from a bump to the points next to it
        self.follows_objects = False  # whether values depend on where other objects are
        self._known: dict[tuple[int, ...], Value] = {}
        self._depth = 0

    def read(self, socket: Any, scope: Scope | None = None) -> Value:
        """Read the value of an input socket: a number for sockets of numbers."""
        if not socket.is_linked:  # most are not
            return own_value(socket)
        output, scope = trace_back(socket, scope, self.omissions.note_foreign)
        if not output.is_output:
            return _converted(self.nodes, own_value(output), output.type, socket.type)
        return _converted(self.nodes, self._read_output(output, scope), output.type, socket.type)

    def read_or(self, unknown: Value, instead: str, socket: Any, scope: Scope | None) -> Value:
        """Read an input socket. A guess becomes `unknown`, and users are told that `instead` is shown."""
        mark = self.omissions.mark
        value = self.read(socket, scope)
        if not value.is_guess:
            return value
        self.omissions.since(mark, instead)
        return unknown

    def number(self, socket: Any, unknown: float, scope: Scope | None = None) -> Operand:
        """Read a number, `unknown` for a guess."""
        if not socket.is_linked and socket.type == "VALUE":
            return float(socket.default_value)
        return self.read_or(constant(unknown), f"{socket.name} {unknown:.3g} is used", socket, scope).operand

    def even_number(self, socket: Any, unknown: float, scope: Scope | None = None) -> float:
        """Read a number for the whole surface: the mean of a value that varies over it."""
        operand = self.number(socket, unknown, scope)
        if isinstance(operand, Output):
            operand = self.images.mean(self.nodes, Value(operand))[0]
            self.omissions.note(f"varying {socket.name}", f"{operand:.3g} is used")
        return float(operand if isinstance(operand, float) else operand[0])

    def overall(self, value: Value) -> tuple[float, float, float]:
        """Three channels: about the mean of a value."""
        mean = self.images.mean(self.nodes, value)
        return mean[:3] if len(mean) >= 3 else (mean[0],) * 3  # type: ignore[return-value]

    def work(self, kind: str, *values: Value | Operand, mode: str = "", numbers: Sequence[float] = ()) -> Value:
        """An instruction on values; a guess if all of those that are values are guesses."""
        operands = [value.operand if isinstance(value, Value) else value for value in values]
        return Value(self.nodes.add(kind, *operands, mode=mode, numbers=numbers), all_guessed(values))

    def input(self, mode: str, layer: str = "", number: int = 0) -> Value:
        """Add an input of the hit."""
        if self.omissions.kind != "material":
            return self.fallback
        found = self.nodes.add("input", mode=mode, layer=layer, numbers=(float(number),))
        return Value(channels_of(found, 0, 1 if mode == "BACKFACING" else 3))

    def normal(self, socket: Any, scope: Scope | None) -> Operand:
        """Read a Normal input: the normal of shading where nothing is linked to it."""
        if is_fed(socket, scope):
            mark = self.omissions.mark
            value = self.read(socket, scope)
            if not value.is_guess:
                return value.operand
            self.omissions.since(mark, "the mesh's own normals are used")
        return self.input("NORMAL").operand

    def ask(self, source: Source) -> Value:
        """Add an input with the value of each instance."""
        if self._sources is None or self.omissions.kind != "material":  # lights and the world are no instances
            return self.fallback
        row = self._sources.setdefault(source, len(self._sources))
        return Value(self.nodes.add("input", mode="INSTANCE", numbers=(float(row),)))

    def inputs(self, node: Any, names: Sequence[str], scope: Scope | None) -> list[Value]:
        """Read inputs by their identifiers: what users read changes with Blender's versions and language."""
        sockets = {socket.identifier: socket for socket in node.inputs}
        found = [sockets.get(name) or sockets.get(_RENAMED.get(name, "")) for name in names]
        return [self.fallback if socket is None else self.read(socket, scope) for socket in found]

    def _read_output(self, output: Any, scope: Scope | None) -> Value:
        place = (output.as_pointer(), *(scope.key if scope is not None else ()))
        known = self._known.get(place)
        if known is not None:
            self.omissions.count += known.is_guess  # why it is one was noted at first
            return known
        self._known[place] = self.fallback  # so that loops end
        read = READERS.get(output.node.type)
        if read is None or self._depth >= _DEEPEST:
            self.omissions.note_node(output.node, output)
            return self.fallback
        self._depth += 1
        count = self.omissions.count
        value = self._known[place] = read(self, output.node, output, scope)
        self._depth -= 1
        if self.omissions.count == count and value.is_guess:  # nothing before it is to blame
            self.omissions.note_node(output.node, output)
        return value

    def vector(self, node: Any, scope: Scope | None, unlinked: str) -> Value:
        """Read the Vector input of a texture. unlinked: its value without a link, "UV" or "GENERATED"."""
        socket = node.inputs.get("Vector")
        if socket is None:
            return constant(0.0, 0.0, 0.0)
        if is_fed(socket, scope):
            value = self.read(socket, scope)
            if not value.is_guess:
                return value
        if self.omissions.kind == "world":
            return self.way()
        return self.input(unlinked)

    def way(self) -> Value:
        """The direction that is looked into, of a world."""
        return Value(channels_of(self.nodes.add("input", mode="GIVEN"), 0, 3))


def all_guessed(values: Sequence[Any]) -> bool:
    known = [value for value in values if isinstance(value, Value)]
    return bool(known) and all(value.is_guess for value in known)


def _converted(nodes: Nodes, value: Value, source: str, target: str) -> Value:
    """Convert a value between kinds of sockets as Cycles does: colours have a luminance, vectors a mean."""
    if target == "VALUE" and width_of(value.operand) != 1:
        kind = "luminance" if source == "RGBA" else "average"
        return Value(nodes.add(kind, value.operand), value.is_guess)
    return value


def own_value(socket: Any) -> Value:
    value = getattr(socket, "default_value", 0.0)
    return constant(*value) if hasattr(value, "__len__") else constant(float(value))


Reader = Callable[[ValueReader, Any, Any, Scope | None], Value]
# What reads an output of a node, by the node's type.
READERS: dict[str, Reader] = dict.fromkeys(GROUPS, lambda *_: constant(0.0))  # those that lead nothing to an output


def reads(*kinds: str) -> Callable[[Reader], Reader]:
    """Make a function the reader of nodes of these types."""

    def register(reader: Reader) -> Reader:
        READERS.update(dict.fromkeys(kinds, reader))
        return reader

    return register
