"""Whether a frame depends on those before it: whatever is simulated has to be played in order."""

from __future__ import annotations

from typing import Any

import bpy

SIMULATED = frozenset({"CLOTH", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT", "PARTICLE_SYSTEM"})


def has_simulations(scene: Any) -> bool:
    """Rigid bodies, cloth, soft bodies, fluids, dynamic paint, particles, simulation zones of nodes; baked or not."""
    if scene.rigidbody_world is not None and scene.rigidbody_world.enabled:
        return True
    if any(modifier.type in SIMULATED for obj in scene.objects for modifier in obj.modifiers):
        return True
    return any(node.bl_idname == "GeometryNodeSimulationOutput" for tree in bpy.data.node_groups for node in tree.nodes)
