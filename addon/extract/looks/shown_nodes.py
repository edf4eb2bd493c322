"""Which shader nodes are shown, and what is shown in place of the others: the one table that tells, and tells users.

A node type that stands nowhere here is not shown at all. The README's list of nodes is compared with this one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

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
    "BSDF_HAIR": DIFFUSE,
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
