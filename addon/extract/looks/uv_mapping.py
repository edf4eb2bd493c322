"""Where an image texture looks things up: which uv map, and the Mapping nodes before it as one transform of it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ...sync.records import UNMAPPED, UvTransform
from .node_graph import Scope, trace_back
from .shown_nodes import Omissions

_MOST_MAPPINGS = 16


class SocketReader(Protocol):
    """Knows what an input socket gets: a value with `color`, `texture` and `is_guess`; and takes what is not shown."""

    omissions: Omissions

    def read(self, socket: Any, scope: Scope | None) -> Any: ...


def find_coordinates(socket: Any, scope: Scope | None, reader: SocketReader) -> tuple[UvTransform, str]:
    """Of an image's Vector input: the transform, and the name of the uv map, "" for the one that is active for renders.

    Other coordinates than a uv map are taken for that one, unless Mapping nodes move them.
    """
    from mathutils import Matrix

    whole = Matrix()
    for _ in range(_MOST_MAPPINGS):
        output, scope = trace_back(socket, scope)
        if not output.is_output or output.node.type != "MAPPING":
            break
        matrix = _matrix_of(output.node, scope, reader)
        if matrix is None:
            reader.omissions.note_node(output.node, instead="the UV map as it is, is")
        else:
            whole = whole @ matrix
        socket = output.node.inputs["Vector"]
    _note_other_coordinates(output, reader.omissions)
    rows = tuple([(row[0], row[1], row[3]) for row in (whole[0], whole[1])])
    return (rows if np.isfinite(rows).all() else UNMAPPED), _uv_map_of(output)  # type: ignore[return-value]


def _note_other_coordinates(output: Any, omissions: Omissions) -> None:
    """output: where the coordinates come from."""
    node = output.node
    if not output.is_output:
        return
    if omissions.kind == "world":
        if node.type != "TEX_COORD" or output.identifier not in {"Generated", "Object"}:
            omissions.note_node(node, output, "the direction is")
    elif not (_uv_map_of(output) or (node.type in {"TEX_COORD", "UVMAP"} and output.identifier == "UV")):
        omissions.note_node(node, output, "the UV map is")


def _uv_map_of(output: Any) -> str:
    node = output.node
    if not output.is_output:
        return ""
    if node.type == "UVMAP" and not node.from_instancer:
        return str(node.uv_map)
    if node.type != "ATTRIBUTE" or node.attribute_type != "GEOMETRY":
        return ""
    return str(node.attribute_name) if output.identifier in {"Color", "Vector"} else ""


def _matrix_of(node: Any, scope: Scope | None, reader: SocketReader) -> Any:
    """What a Mapping node multiplies coordinates with; None if that is not the same everywhere."""
    from mathutils import Euler, Matrix

    parts = []
    for name in ("Location", "Rotation", "Scale"):
        if name not in node.inputs:
            parts.append((0.0, 0.0, 0.0))
            continue
        value = reader.read(node.inputs[name], scope)
        if value.is_guess or not value.is_even:
            return None
        parts.append(tuple(value.color[:3].tolist()))
    place, angles, scale = parts
    turn, scaling = Euler(angles).to_matrix().to_4x4(), Matrix.Diagonal((*scale, 1.0))
    if node.vector_type == "TEXTURE":  # the texture is moved, not the coordinates
        return (Matrix.Translation(place) @ turn @ scaling).inverted_safe()
    if node.vector_type == "POINT":
        return Matrix.Translation(place) @ turn @ scaling
    return turn @ scaling if node.vector_type == "VECTOR" else None
