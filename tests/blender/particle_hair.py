"""Legacy particle hair for tests: emitters, and their strands by Blender's own accessor."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from blender.builders import mesh_object
from perfect_bvh_addon.sync.records import MeshRecord, SceneRecord

SQUARES = 3
COUNT = 24
CHILDREN = {"NONE": {}, "SIMPLE": {"rendered_child_count": 5}, "INTERPOLATED": {"rendered_child_count": 5}}
BENT = {"brownian_factor": 0.2, "clump_factor": 0.5}


def emitter(name: str = "Emitter", squares: int = SQUARES, **settings: Any) -> Any:
    """Make a grid over (0, 0) to (squares, squares) with a UV map and growing hair. settings: of the particles."""
    steps = np.arange(squares + 1)
    places = np.stack([*np.meshgrid(steps, steps), np.zeros((squares + 1, squares + 1))], axis=-1).reshape(-1, 3)
    corners = [0, 1, squares + 2, squares + 1]
    faces = [
        [row * (squares + 1) + column + corner for corner in corners] for row, column in np.ndindex(squares, squares)
    ]
    data = bpy.data.meshes.new(name)
    data.from_pydata(places.tolist(), [], faces)
    uvs = data.uv_layers.new(name="UVMap")
    verts = np.array([loop.vertex_index for loop in data.loops])
    uvs.uv.foreach_set("vector", (places[verts, :2] / squares).astype(np.float32).ravel())
    obj = mesh_object(name, data)
    add_hair(obj, **settings)
    return obj


def add_hair(obj: Any, **settings: Any) -> Any:
    """Add a particle system to an object; return its settings."""
    modifier = obj.modifiers.new("hair", "PARTICLE_SYSTEM")
    particles = modifier.particle_system.settings
    values = {"type": "HAIR", "count": COUNT, "hair_length": 1.0, "hair_step": 4, "render_step": 3, "display_step": 2}
    values |= {"radius_scale": 0.1, "root_radius": 1.0, "tip_radius": 0.2, "shape": 0.0, "use_close_tip": False}
    values |= settings
    for name, value in values.items():
        setattr(particles, name, value)
    return particles


def expected_strands(obj: Any, depsgraph: Any) -> npt.NDArray[np.float64]:
    """Read the strands as a viewport shows them, by `co_hair`: (S, K, 3) in the object's space."""
    shown = obj.evaluated_get(depsgraph)
    inverse = np.linalg.inv(np.array(shown.matrix_world))
    system = shown.particle_systems[0]
    settings = system.settings
    children = int(len(system.child_particles) * settings.display_percentage / 100)
    first, count = (len(system.particles), children) if children else (0, len(system.particles))
    steps = range((1 << settings.display_step) + 1)
    points = np.array(
        [[system.co_hair(shown, particle_no=first + row, step=step) for step in steps] for row in range(count)]
    )
    return points @ inverse[:3, :3].T + inverse[:3, 3]


def hair_of(record: SceneRecord) -> MeshRecord:
    (mesh,) = (mesh for mesh in record.meshes if mesh.kind == "curves")
    return mesh


def kind_settings(children: str) -> dict[str, Any]:
    return {"child_type": children, "child_percent": 4} | CHILDREN[children] | BENT


def asked_of_blender(
    shown: Any, accessor: str, number: int, count: int, modifier: Any = None
) -> npt.NDArray[np.float64]:
    """Read the emitter's value at the root of each strand; accessor: "uv_on_emitter", "mcol_on_emitter"."""
    system, modifier = shown.particle_systems[0], modifier or shown.modifiers[0]
    first = 0 if count == len(system.particles) else len(system.particles)
    layer = "uv_no" if accessor == "uv_on_emitter" else "vcol_no"
    ask = getattr(system, accessor)
    particles = system.particles
    return np.array(
        [
            ask(modifier, particle=particles[min(row, len(particles) - 1)], particle_no=first + row, **{layer: number})
            for row in range(count)
        ]
    )
