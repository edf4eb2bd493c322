"""Node programs for tests: materials whose colour is an image or a mesh's own colours."""

from __future__ import annotations

from perfect_bvh.nodes import NodeBuilder, NodeProgram, channels_of


def image_program(
    *slots: str, layer: str = "", image: int = 0, transform: tuple[float, ...] | None = None, scale: float = 1.0
) -> NodeProgram:
    """Sets these slots to an image; ALPHA to its alpha. transform: (12,), of the uv map. scale: of the colour."""
    nodes = NodeBuilder()
    uv = nodes.add("input", mode="UV", layer=layer)
    if transform is not None:
        uv = nodes.add("transform", uv, numbers=transform)
    pixels = nodes.add("image", uv, mode="FLAT", numbers=[image])
    color = nodes.add("vector_math", pixels, scale, 0.0, 0.0, mode="MULTIPLY")
    return nodes.program(**{slot: channels_of(pixels, 3) if slot == "ALPHA" else color for slot in slots})


def colors_program(layer: str = "", tint: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> NodeProgram:
    """The mesh's own colours, times a tint, as the base colour."""
    nodes = NodeBuilder()
    colors = nodes.add("input", mode="COLOR", layer=layer)
    return nodes.program(COLOR=nodes.add("vector_math", colors, tint, 0.0, 0.0, mode="MULTIPLY"))
