"""The nodes that this engine follows, in a panel. Blender's own show those of EEVEE, which may be others."""

from __future__ import annotations

import bpy

# From Blender 5.0 on materials and worlds always have nodes.
ALWAYS_NODES = bpy.app.version >= (5, 0, 0)


def draw_surface(layout: bpy.types.UILayout, owner: bpy.types.ID, plain: str) -> None:
    """What is linked to the Surface of a material, a light or a world, to unfold and edit.

    plain: the property that counts without nodes; empty for a light, whose own color counts besides.
    """
    if not (ALWAYS_NODES and plain):
        layout.prop(owner, "use_nodes", icon="NODETREE")
        layout.separator()
    layout.use_property_split = True
    tree = owner.node_tree
    if tree is None or not (owner.use_nodes or (ALWAYS_NODES and plain)):
        if plain:
            layout.prop(owner, plain)
        return
    # What extraction looks at: both engines show the same scene.
    output = tree.get_output_node("CYCLES")
    if output is None:
        layout.label(text="No output node", icon="ERROR")
    else:
        layout.template_node_view(tree, output, output.inputs["Surface"])
