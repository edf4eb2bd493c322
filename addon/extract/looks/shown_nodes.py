"""Which shader nodes are shown, and what is shown in place of the others: the one table, and its notes to users.

A node type that stands nowhere here is not shown at all. The README's list of nodes is compared with this one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ...sync.not_shown import Kind, NotShown
from .node_graph import Scope, trace_back

FLAT = "its flat colour is"
DIFFUSE = "a diffuse surface is"

# By `bpy.types.Node.type`.
SHADERS = ("BSDF_PRINCIPLED", "BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_GLASS", "BSDF_REFRACTION")
SHADERS += (
    "BSDF_HAIR_PRINCIPLED",
    "BSDF_TRANSLUCENT",
    "BSDF_TRANSPARENT",
    "EMISSION",
    "BACKGROUND",
    "HOLDOUT",
    "MIX_SHADER",
    "ADD_SHADER",
)
TEXTURES = ("TEX_IMAGE", "TEX_ENVIRONMENT", "TEX_SKY", "MAPPING", "UVMAP", "TEX_COORD", "ATTRIBUTE", "VERTEX_COLOR")
TEXTURES += ("OBJECT_INFO",)
VALUES = ("RGB", "VALUE", "BLACKBODY", "MIX", "MIX_RGB", "VALTORGB", "CURVE_RGB", "HUE_SAT", "MATH", "GAMMA", "INVERT")
VALUES += ("BRIGHTCONTRAST", "RGBTOBW", "SEPARATE_COLOR", "SEPRGB", "COMBINE_COLOR", "COMBRGB", "LIGHT_FALLOFF")
TREES = ("GROUP", "GROUP_INPUT", "GROUP_OUTPUT", "REROUTE", "FRAME", "OUTPUT_MATERIAL", "OUTPUT_WORLD", "OUTPUT_LIGHT")
SHOWN_NODES = frozenset({*SHADERS, *TEXTURES, *VALUES, *TREES})

# What is shown of nodes that are read, but not as they are.
SIMPLIFIED_NODES: dict[str, str] = {
    "TEX_CHECKER": "the middle of its colours is",
    "TEX_BRICK": "the middle of its colours is",
    "LIGHT_PATH": "what the camera sees is, for all rays",
    "NEW_GEOMETRY": "its front is, on both sides",
    "FRESNEL": "one share is, at all angles",
    "LAYER_WEIGHT": "one share is, at all angles",
    "BSDF_HAIR": "a diffuse surface is, or a translucent one",
    "BSDF_TOON": DIFFUSE,
    "BSDF_SHEEN": DIFFUSE,
    "SUBSURFACE_SCATTERING": DIFFUSE,
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


NORMAL_INPUT = IgnoredInput("Normal", None, "", "the mesh's own normals are")

IGNORED_INPUTS: dict[str, tuple[IgnoredInput, ...]] = {
    "BSDF_PRINCIPLED": (
        NORMAL_INPUT,
        IgnoredInput("Diffuse Roughness", 0.0, "Diffuse Roughness", "a smooth one is"),
        IgnoredInput("Subsurface Weight", 0.0, "Subsurface", "a diffuse surface is"),
        IgnoredInput("Anisotropic", 0.0, "Anisotropic", "an even reflection is"),
        IgnoredInput("Coat Weight", 0.0, "Coat", "what it covers is"),
        IgnoredInput("Sheen Weight", 0.0, "Sheen", "what it covers is"),
        IgnoredInput("Thin Film Thickness", 0.0, "Thin Film", "what it covers is"),
    ),
    "BSDF_DIFFUSE": (NORMAL_INPUT, IgnoredInput("Roughness", 0.0, "Roughness of the Diffuse BSDF", "a smooth one is")),
    "BSDF_GLOSSY": (NORMAL_INPUT, IgnoredInput("Anisotropy", 0.0, "Anisotropy", "an even reflection is")),
    "BSDF_METALLIC": (
        NORMAL_INPUT,
        IgnoredInput("Anisotropy", 0.0, "Anisotropy", "an even reflection is"),
        IgnoredInput("Thin Film Thickness", 0.0, "Thin Film", "what it covers is"),
    ),
    "BSDF_GLASS": (NORMAL_INPUT, IgnoredInput("Thin Film Thickness", 0.0, "Thin Film", "what it covers is")),
    "BSDF_REFRACTION": (NORMAL_INPUT,),
    "BSDF_TRANSLUCENT": (NORMAL_INPUT,),
    "BSDF_TRANSPARENT": (IgnoredInput("Color", 1.0, "Color of the Transparent BSDF", "white is"),),
}


def name_of(node: Any, output: Any = None) -> str:
    """What users know a node by. output: the socket that is asked for, if it may be one of several."""
    name = f"{node.label} ({node.bl_label})" if node.label else str(node.bl_label)
    return f"{name} {output.name}" if output is not None and node.type in _MANY_SIDED else name


_CONSTANTS = frozenset({"VALUE", "RGB"})


class Omissions:
    """What of one material, light or world is not shown, noted while its nodes are read: each thing once.

    count: how often anything was noted or met again so far. kind: what the nodes are of.
    """

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
