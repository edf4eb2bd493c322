"""Shader nodes as programs: material properties that vary over a surface.

A program consists of small instructions, which the renderer runs over batches of hits. `NodeBuilder` makes them:

    nodes = NodeBuilder()
    uv = nodes.add("input", mode="UV", layer="UVMap")
    image = nodes.add("image", uv, mode="FLAT", numbers=[0])  # row 0 of the appearance's images
    red = nodes.add("math", channels_of(image, 0), 0.5, 0.0, mode="MULTIPLY")
    program = nodes.program(COLOR=image, ROUGHNESS=red)

`NODE_SHAPES` lists the instructions with their inputs, outputs and modes, by Blender's names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core

Float32Array = npt.NDArray[np.float32]


class NodeShape(NamedTuple):
    """A kind of instruction.

    Attributes:
        operands: The width of each operand, 1 or 3 channels.
        channels: The number of channels that it writes.
        numbers: The number of settings it has, -1 for any number of them.
        modes: The names of its variants; a single "" if it has none.
    """

    row: int
    operands: tuple[int, ...]
    channels: int
    numbers: int
    modes: dict[str, int]


NODE_SHAPES: Mapping[str, NodeShape] = {
    name: NodeShape(
        row,
        tuple(int(width) for width in operands),
        *(channels, numbers),
        {mode: number for number, mode in enumerate(modes.split(" "))},
    )
    for row, (name, operands, channels, numbers, modes) in enumerate(_core.NODE_SHAPES)
}
# Inputs that name a layer of the mesh, with the attribute of `MeshAppearance` that holds these layers.
LAYER_INPUTS = {"UV": "uvs", "TANGENT": "tangents", "COLOR": "colors"}
# Inputs that are the same at all positions of a hit, or that are not known at positions next to it.
_EVERYWHERE = frozenset({"NORMAL", "TRUE_NORMAL", "INCOMING", "REFLECTION", "BACKFACING", "OBJECT_NORMAL"})
_EVERYWHERE |= {"TANGENT", "SIDE", "INSTANCE", "GIVEN"}
# Instructions that are never folded into constants, for any operands.
_OF_PLACES = frozenset({"input", "image", "box_image", "vector_transform"})
_MOST_INSTRUCTIONS, _MOST_CHANNELS = 10_000, 65_536
_PLACES = 1024


class ProgramTooLargeError(ValueError):
    """A program has more than 10,000 instructions or 65,536 channels."""


class Output(NamedTuple):
    """The output of an instruction: `width` channels, beginning at its channel `first`. row: the instruction's row."""

    row: int
    first: int
    width: int


# An instruction's output, or a constant: a number, or several channels.
Operand = Output | float | tuple[float, ...]


def width_of(operand: Operand) -> int:
    """Returns the number of channels of an operand."""
    if isinstance(operand, Output):
        return operand.width
    return len(operand) if isinstance(operand, tuple) else 1


def channels_of(operand: Operand, first: int, width: int = 1) -> Operand:
    """Returns some of an operand's channels; a number stays a number."""
    if isinstance(operand, Output):
        return Output(operand.row, operand.first + first, width)
    if isinstance(operand, tuple):
        return operand[first] if width == 1 else operand[first : first + width]
    return operand if width == 1 else (operand,) * width


@dataclass(frozen=True, slots=True, eq=False)
class NodeProgram:
    """Instructions as the engine takes them; made by `NodeBuilder.program`.

    Attributes:
        codes: int32
        numbers: float32.
        layers: The positions in `numbers` that receive a layer's number, with the layer's kind and name.
        key: Equal for programs that do the same.
    """

    codes: npt.NDArray[np.int32]
    numbers: Float32Array
    layers: tuple[tuple[int, str, str], ...] = ()

    @property
    def key(self) -> tuple[bytes, bytes, tuple[tuple[int, str, str], ...]]:
        """Returns the program's full content, for comparisons."""
        return self.codes.tobytes(), self.numbers.tobytes(), self.layers

    def __eq__(self, other: object) -> bool:
        return isinstance(other, NodeProgram) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    def asks(self, mode: str) -> bool:
        """Whether it has an input of this mode."""
        shape, at = NODE_SHAPES["input"], 0
        shapes = list(NODE_SHAPES.values())
        while at < len(self.codes):
            kind = int(self.codes[at])
            if kind == shape.row and self.codes[at + 1] == shape.modes[mode]:
                return True
            at += 3 + 2 * len(shapes[kind].operands)
        return False

    def layer_names(self, kind: str) -> set[str]:
        """The names of the "uvs", "tangents" or "colors" layers that it reads."""
        return {name for _, layer, name in self.layers if layer == kind}


class Instruction(NamedTuple):
    """One instruction of a program: its operands and its settings."""

    kind: str
    mode: str
    operands: tuple[Operand, ...]
    numbers: tuple[float, ...]
    layer: str


class NodeBuilder:
    """Collects instructions. Equal instructions are stored once; those with constant operands are evaluated at once."""

    def __init__(self) -> None:
        self._instructions: list[Instruction] = []
        self._known: dict[Instruction, int] = {}

    def add(
        self, kind: str, *operands: Operand, mode: str = "", numbers: Iterable[float] = (), layer: str = ""
    ) -> Operand:
        """Add an instruction.

        Args:
            kind: One of `NODE_SHAPES`.
            operands: Outputs of other instructions, numbers, or vectors. A number in place of a vector means three
                equal numbers.
            mode: The variant of the instruction.
            numbers: Its settings. For inputs they follow from `layer`, or are the row and the side.
            layer: Of the inputs "UV", "TANGENT" and "COLOR", the name of the mesh's layer.

        Returns:
            The instruction's output; a number or a vector if it is constant.

        Raises:
            ValueError: There is no such instruction or mode, or an operand is too narrow or too wide.
            ProgramTooLargeError: There are 10,000 instructions.
        """
        settings = tuple([float(number) for number in numbers])
        if kind == "input":
            settings = (*settings, 0.0, 0.0)[:2]
        made = Instruction(kind, mode, operands, settings, layer)
        _check(made)
        if kind not in _OF_PLACES and not any(isinstance(operand, Output) for operand in operands):
            return self._fold(made)
        row = self._known.get(made)
        if row is None:
            if len(self._instructions) >= _MOST_INSTRUCTIONS:
                raise ProgramTooLargeError(f"NodeBuilder.add: a program has at most {_MOST_INSTRUCTIONS} instructions")
            row = self._known[made] = len(self._instructions)
            self._instructions.append(made)
        return Output(row, 0, NODE_SHAPES[kind].channels)

    def shifted(self, operand: Operand, side: int) -> Operand:
        """Returns an operand evaluated at a position next to a hit, for bumps. side: 1 or 2."""
        if not isinstance(operand, Output):
            return operand
        made: dict[int, int] = {}
        for row in self._rows_of([operand]):
            kind, mode, operands, numbers, layer = self._instructions[row]
            if kind == "input" and mode not in _EVERYWHERE:
                numbers = (numbers[0], float(side))
            moved = [other._replace(row=made[other.row]) if isinstance(other, Output) else other for other in operands]
            output = self.add(kind, *moved, mode=mode, numbers=numbers, layer=layer)
            assert isinstance(output, Output)
            made[row] = output.row
        return operand._replace(row=made[operand.row])

    def program(self, **outputs: Operand) -> NodeProgram:
        """Make a program that computes some outputs.

        Args:
            outputs: The outputs, by the modes of the instruction "set": COLOR, ROUGHNESS, NORMAL and so on.

        Raises:
            ProgramTooLargeError: It has more than 65,536 channels.
        """
        writer = self._written(outputs.values())
        for slot, operand in outputs.items():
            writer.write(Instruction("set", slot, (operand,), (), ""))
        return writer.program()

    def mean(
        self, operand: Operand, images: Sequence[Mapping[str, Any]] = (), stand_ins: Sequence[Sequence[float]] = ()
    ) -> tuple[float, ...]:
        """Estimate the average of an operand over 1,024 evenly spread positions.

        Args:
            operand: The operand.
            images: As the engine takes them.
            stand_ins: Replacements for the instances' own values, four numbers each.

        Returns:
            A number for each channel, 0 for channels that are never finite.
        """
        if not isinstance(operand, Output):
            return operand if isinstance(operand, tuple) else (operand,)
        given = [np.tile(np.asarray(row, np.float32), (_PLACES, 1)) for row in stand_ins]
        values = self.evaluate(operand, images, given, _PLACES).astype(np.float64)
        values[~np.isfinite(values)] = 0.0
        return tuple(values.mean(axis=0).tolist())

    def evaluate(
        self, operand: Output, images: Sequence[Mapping[str, Any]], given: Sequence[Float32Array], count: int
    ) -> Float32Array:
        """Evaluate an output without a scene.

        Args:
            operand: The operand.
            images: As the engine takes them.
            given: (count, 4) each: the values of the inputs "GIVEN" and "INSTANCE", by their rows. Other inputs get
                positions spread evenly over a unit cube, whose top is seen from all sides.
            count: The number of rows.

        Returns:
            (count, width of the output) float32.
        """
        return self._written([operand]).evaluate(operand, images, given, count)

    def instruction(self, operand: Operand) -> Instruction | None:
        """Returns the instruction of an output, None for constants."""
        return self._instructions[operand.row] if isinstance(operand, Output) else None

    def _rows_of(self, operands: Iterable[Operand]) -> list[int]:
        """Returns the rows of the instructions that operands need, in order."""
        found: set[int] = set()
        open_rows = [operand.row for operand in operands if isinstance(operand, Output)]
        while open_rows:
            row = open_rows.pop()
            if row not in found:
                found.add(row)
                open_rows += [other.row for other in self._instructions[row].operands if isinstance(other, Output)]
        return sorted(found)

    def _written(self, operands: Iterable[Operand]) -> _Writer:
        writer = _Writer()
        for row in self._rows_of(operands):
            writer.firsts[row] = writer.write(self._instructions[row])
        return writer

    def _fold(self, instruction: Instruction) -> Operand:
        writer = _Writer()
        writer.firsts[0] = writer.write(instruction)
        width = NODE_SHAPES[instruction.kind].channels
        values = tuple(writer.evaluate(Output(0, 0, width), (), (), 1)[0].tolist())
        return values[0] if width == 1 else values


def _check(instruction: Instruction) -> None:
    """Raises ValueError if this is not a valid instruction."""
    kind, mode, operands, numbers, _ = instruction
    shape = NODE_SHAPES.get(kind)
    if shape is None:
        raise ValueError(f"NodeBuilder.add: kind must be one of {', '.join(NODE_SHAPES)}, got {kind!r}")
    if mode not in shape.modes:
        raise ValueError(f"NodeBuilder.add: mode of {kind} must be one of {', '.join(shape.modes)}, got {mode!r}")
    if shape.numbers not in (-1, len(numbers)):
        raise ValueError(f"NodeBuilder.add: {kind} has {shape.numbers} numbers, got {len(numbers)}")
    if len(operands) != len(shape.operands):
        raise ValueError(f"NodeBuilder.add: {kind} reads {len(shape.operands)} operands, got {len(operands)}")
    for operand, width in zip(operands, shape.operands, strict=True):
        given = width_of(operand)
        if given != 1 and (width == 1 or given < width):
            expected = "a number" if width == 1 else f"a number or {width} channels"
            raise ValueError(f"NodeBuilder.add: {kind} reads {expected}, got {operand!r}")


class _Writer:
    """Writes instructions in order. firsts: the first channel of each instruction, by its row."""

    def __init__(self) -> None:
        self.firsts: dict[int, int] = {}
        self._constants: dict[Operand, int] = {}
        self._codes: list[int] = []
        self._numbers: list[float] = []
        self._layers: list[tuple[int, str, str]] = []
        self._channels = 0

    def write(self, instruction: Instruction) -> int:
        """Writes an instruction, and returns the first channel of its output."""
        kind, mode, operands, numbers, layer = instruction
        shape = NODE_SHAPES[kind]
        places = [self._place(operand, width) for operand, width in zip(operands, shape.operands, strict=True)]
        self._codes += [shape.row, shape.modes[mode], len(numbers)]
        for place in places:
            self._codes += place
        if kind == "input" and mode in LAYER_INPUTS:
            self._layers.append((len(self._numbers), LAYER_INPUTS[mode], layer))
        self._numbers += numbers
        first = self._channels
        self._channels += shape.channels
        if self._channels > _MOST_CHANNELS:
            raise ProgramTooLargeError(f"NodeBuilder.program: a program has at most {_MOST_CHANNELS} channels")
        return first

    def program(self) -> NodeProgram:
        codes, numbers = np.array(self._codes, np.int32), np.array(self._numbers, np.float32)
        return NodeProgram(codes, numbers, tuple(self._layers))

    def evaluate(
        self, output: Output, images: Sequence[Mapping[str, Any]], given: Sequence[Float32Array], count: int
    ) -> Float32Array:
        """Evaluates an output: (count, width of the output)."""
        program = self.program()
        channels = np.arange(output.width, dtype=np.int32) + self.firsts[output.row] + output.first
        return _core.evaluate_nodes(program.codes, program.numbers, list(images), list(given), channels, count)

    def _place(self, operand: Operand, width: int) -> tuple[int, int]:
        """Returns an operand's first channel and the step to the next one."""
        if isinstance(operand, Output):
            return self.firsts[operand.row] + operand.first, int(operand.width != 1)
        values = operand[:3] if isinstance(operand, tuple) else (operand,) * 3
        first = self._constants.get(values)
        if first is None:
            first = self._constants[values] = self.write(Instruction("constant", "", (), (*values, 0.0, 0.0)[:3], ""))
        return first, int(width != 1)
