"""What a scene's Output properties ask for, and the command line, which writes the engine's own image, does not do."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import bpy


def find_ignored_output(scene: bpy.types.Scene, active: bpy.types.ViewLayer) -> Iterator[str]:
    """A sentence for each, of a scene as its file has it. active: the view layer that is rendered."""
    render = scene.render
    if render.use_compositing and _has_compositor(scene):
        yield "Compositing: its nodes are not applied; the render as it is, is written"
    if render.use_sequencer and _has_strips(scene):
        yield "Sequencer: its strips are not shown; the scene is"
    if render.use_multiview:
        yield "Stereoscopy: it is not written; one view is"
    if render.use_stamp:
        yield "Burn Into Image: it is not done"
    others = [layer.name for layer in scene.view_layers if layer.use and layer != active]
    if others:
        yield f"View Layers: {', '.join(others)} is not rendered; {active.name} is"


def _has_compositor(scene: bpy.types.Scene) -> bool:
    if hasattr(scene, "compositing_node_group"):  # since Blender 5.0
        tree = scene.compositing_node_group
    else:
        tree = scene.node_tree if scene.use_nodes else None
    return tree is not None and len(tree.links) > 0 and any(node.type not in _TRIVIAL for node in tree.nodes)


_TRIVIAL = frozenset({"R_LAYERS", "COMPOSITE", "VIEWER", "GROUP_OUTPUT", "REROUTE", "FRAME"})


def _has_strips(scene: bpy.types.Scene) -> bool:
    editor = scene.sequence_editor
    return editor is not None and len(editor.strips if hasattr(editor, "strips") else editor.sequences) > 0
