"""The way from a socket back to what feeds it, through reroutes, muted nodes and the walls of node groups."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import bpy

from ...sync.not_shown import Kind, NotShown

# Whether all materials and worlds have nodes: to ask each of them takes long where it is out of date to ask.
USES_NODES = bpy.app.version >= (5, 0, 0)
# The type of nodes that Blender does not have: those of other render engines, even where their add-on is missing.
FOREIGN = "CUSTOM"
GROUPS = frozenset({"GROUP", "CUSTOM GROUP"})
# Of nodes that only pass on, and of groups one in another. Trees may hold loops.
_LONGEST_WAY = 1000


@dataclass(frozen=True, slots=True)
class Scope:
    """The group that contains a node. node: its group node, which is in the scope `outer`, None at the top."""

    node: Any
    outer: Scope | None

    @property
    def key(self) -> tuple[int, ...]:
        """Distinguishes two uses of one group."""
        return (self.node.as_pointer(), *(self.outer.key if self.outer is not None else ()))


# By a node's type, as these are the same for all nodes of a type.
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
    """Find the source of an input socket's value: another node's output, or an input with an unlinked value.

    As in Cycles, if the link leads nowhere (muted nodes without a link inside, links that are muted or invalid, foreign
    nodes), the value is that of the last socket on the way that does not belong to a muted node or a reroute.

    Args:
        socket: An input.
        scope: The group that contains its node.
        note_foreign: Receives nodes of another render engine, which Cycles ignores.
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
    """Find the output node that Cycles shows and the group that contains it, None without one.

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


# Shown nodes ---------------------------------------------------------------------------------------------------------
# The supported shader nodes, and the replacements of the others: the only table, and its notes to users.
#
# A node type that is missing here is not shown at all. The list in docs/preview.md is compared with this one.


FLAT = "its flat colour is used"
DIFFUSE = "a diffuse surface is used"
_OF_SHADERS = "Choose another surface shader, such as the Principled BSDF, or ignore this message"

# By `bpy.types.Node.type`.
SHADERS = ("BSDF_PRINCIPLED", "BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_GLASS", "BSDF_REFRACTION")
SHADERS += (
    "BSDF_HAIR_PRINCIPLED",
    "BSDF_TRANSLUCENT",
    "BSDF_SHEEN",
    "BSDF_TRANSPARENT",
    "EMISSION",
    "BACKGROUND",
    "HOLDOUT",
    "VOLUME_ABSORPTION",
    "MIX_SHADER",
    "ADD_SHADER",
)
TEXTURES = ("TEX_IMAGE", "TEX_ENVIRONMENT", "TEX_SKY", "MAPPING", "UVMAP", "TEX_COORD", "ATTRIBUTE", "VERTEX_COLOR")
TEXTURES += ("OBJECT_INFO", "NEW_GEOMETRY", "NORMAL_MAP", "BUMP", "FRESNEL", "LAYER_WEIGHT")
TEXTURES += ("TEX_NOISE", "TEX_VORONOI", "TEX_CHECKER", "TEX_BRICK", "TEX_GRADIENT", "TEX_MAGIC", "TEX_WAVE")
TEXTURES += ("TEX_WHITE_NOISE", "TEX_GABOR", "CAMERA", "VECT_TRANSFORM", "TANGENT", "NORMAL", "WAVELENGTH")
VALUES = ("RGB", "VALUE", "BLACKBODY", "MIX", "MIX_RGB", "VALTORGB", "CURVE_RGB", "CURVE_VEC", "CURVE_FLOAT", "HUE_SAT")
VALUES += ("MATH", "VECT_MATH", "VECTOR_ROTATE", "MAP_RANGE", "CLAMP", "GAMMA", "INVERT", "BRIGHTCONTRAST", "RGBTOBW")
VALUES += ("SEPARATE_COLOR", "SEPRGB", "SEPHSV", "SEPXYZ", "COMBINE_COLOR", "COMBRGB", "COMBHSV", "COMBXYZ")
VALUES += ("LIGHT_FALLOFF",)
TREES = ("GROUP", "GROUP_INPUT", "GROUP_OUTPUT", "REROUTE", "FRAME", "OUTPUT_MATERIAL", "OUTPUT_WORLD", "OUTPUT_LIGHT")
SHOWN_NODES = frozenset({*SHADERS, *TEXTURES, *VALUES, *TREES})

# Replacements of parts of nodes that are simplified.
SIMPLIFIED_NODES: dict[str, str] = {
    "LIGHT_PATH": "its values for camera rays are used for all rays",
    "BSDF_HAIR": "a diffuse or translucent surface is used",
    "BSDF_TOON": DIFFUSE,
    "SUBSURFACE_SCATTERING": "a diffuse surface of its mean colour is used",
    "EEVEE_SPECULAR": DIFFUSE,
    "BSDF_RAY_PORTAL": DIFFUSE,
}

# Nodes of several outputs, each of which is named with the node.
_MANY_SIDED = frozenset(
    ("NEW_GEOMETRY", "LIGHT_PATH", "TEX_COORD", "OBJECT_INFO", "PARTICLE_INFO", "HAIR_INFO", "POINT_INFO", "CAMERA")
)


class IgnoredInput(NamedTuple):
    """An input that is not shown unless it has the value that changes nothing; None: unless nothing is linked to it."""

    identifier: str
    neutral: float | None
    name: str
    instead: str


IGNORED_INPUTS: dict[str, tuple[IgnoredInput, ...]] = {
    "BSDF_PRINCIPLED": (
        IgnoredInput("Subsurface Weight", 0.0, "Subsurface", "a diffuse surface of its mean colour is used"),
        IgnoredInput("Thin Film Thickness", 0.0, "Thin Film", "the surface without it is used"),
    ),
    "BSDF_METALLIC": (IgnoredInput("Thin Film Thickness", 0.0, "Thin Film", "the surface without it is used"),),
    "BSDF_GLASS": (IgnoredInput("Thin Film Thickness", 0.0, "Thin Film", "the surface without it is used"),),
    "BSDF_TRANSPARENT": (IgnoredInput("Color", 1.0, "Color of the Transparent BSDF", "white is used"),),
}


def name_of(node: Any, output: Any = None) -> str:
    """Return the name by which users know a node. output: the requested socket, if there may be several."""
    name = f"{node.label} ({node.bl_label})" if node.label else str(node.bl_label)
    return f"{name} {output.name}" if output is not None and node.type in _MANY_SIDED else name


_CONSTANTS = frozenset({"VALUE", "RGB"})


class Omissions:
    """The unsupported parts of one material, light or world, noted while its nodes are read: each part once.

    count: how often anything was noted, including repetitions. kind: the kind of data that has the nodes.
    """

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.count = 0
        self._instead: dict[str, str] = {}
        self._advice: dict[str, str] = {}

    def note(self, what: str, instead: str = FLAT) -> None:
        """Note that `what` is not shown, and that `instead` is."""
        self.count += 1
        self._instead.setdefault(what, instead)

    def note_node(self, node: Any, output: Any = None, instead: str = FLAT) -> None:
        """The same of a node, one of whose outputs is asked for."""
        self.note(name_of(node, output), instead)

    def note_foreign(self, node: Any) -> None:
        """Note a node of another render engine, which Cycles does not show either."""
        self.note_node(node, instead="it is ignored, as in Cycles")

    def note_shader(self, node: Any, instead: str) -> None:
        """Note a surface shader, whose advice is not about textures."""
        self.note_node(node, instead=instead)
        self._advice[name_of(node, None)] = _OF_SHADERS

    def note_no_output(self, instead: str) -> None:
        """Note that Cycles looks at no output node of a tree."""
        self.note("a tree without an output for Cycles", instead)

    def note_too_large(self, instead: str) -> None:
        """Note that the nodes exceed the limit of a program, and the replacement of all of them."""
        self._instead.clear()
        self.note("a node tree of more than 10,000 instructions or 65,536 channels", instead)

    def note_simplified(self, node: Any, output: Any = None) -> None:
        """A node that the table says is shown as something plainer, if this one is."""
        instead = SIMPLIFIED_NODES.get(node.type)
        if instead is not None:
            self.note_node(node, output, instead)

    @property
    def mark(self) -> int:
        """Return a mark for `since`."""
        return len(self._instead)

    def since(self, mark: int, instead: str) -> None:
        """Set the replacement for everything that was noted since the mark."""
        for what in list(self._instead)[mark:]:
            self._instead[what] = instead

    def note_ignored(self, kind: str, inputs: Mapping[str, Any], scope: Scope | None) -> None:
        """Note the inputs of a shader node of this type that affect its look and are not shown."""
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
        """Returns a row for each unsupported part. block: the evaluated material, light or world."""
        uid = block.original.session_uid
        rows = self._instead.items()
        return [
            NotShown(self.kind, block.name, uid, f"{what} is unsupported; {instead}", self._advice.get(what, ""))
            for what, instead in rows
        ]


def _is_neutral(socket: Any, wanted: IgnoredInput) -> bool:
    """Whether the value of a socket that nothing is linked to changes nothing."""
    if wanted.neutral is None:
        return True
    value = getattr(socket, "default_value", wanted.neutral)
    channels = value[:3] if hasattr(value, "__len__") else (value,)
    return all(channel == wanted.neutral for channel in channels)
