"""A small scene, changes of it, and the calls of the engine that each change takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from perfect_bvh_addon.sync.records import InstanceMotions, MeshMotion, SceneMotion, SceneRecord
from perfect_bvh_addon.sync.state import SceneState
from sync.fakes import FakeScene, Shown, mesh, record

MESHES = [mesh("a"), mesh("b", 5)]
SHOWN = [
    Shown("a", 1),
    Shown("b", 2, x=1.0),
    Shown("a", 3, x=2.0),
    *(Shown("b", 2, x=10.0 + index, parent=9, persistent_id=(index,)) for index in range(4)),
]


def base() -> SceneRecord:
    return record(MESHES, SHOWN)


def state() -> tuple[SceneState, FakeScene]:
    made = SceneState(FakeScene)
    assert isinstance(made.scene, FakeScene)
    return made, made.scene


def fresh(target: SceneRecord) -> list[Any]:
    """The content of an empty scene after one update."""
    made, scene = state()
    made.update(target)
    return scene.answer()


def moved() -> SceneRecord:
    return record(MESHES, [Shown("a", 1, x=-7.0), *SHOWN[1:]])


def deformed() -> SceneRecord:
    return record([mesh("a", shift=2.0), MESHES[1]], SHOWN)


def more_triangles() -> SceneRecord:
    return record([mesh("a", 3), MESHES[1]], SHOWN)


def other_triangles() -> SceneRecord:
    turned = replace(MESHES[0], triangles=MESHES[0].triangles[:, ::-1].copy())
    return record([turned, MESHES[1]], SHOWN)


def masked() -> SceneRecord:
    return record(MESHES, [Shown("a", 1, mask=1), *SHOWN[1:]])


def object_removed() -> SceneRecord:
    return record(MESHES, SHOWN[1:])


def mesh_removed() -> SceneRecord:
    return record(MESHES[1:], [item for item in SHOWN if item.mesh == "b"])


def object_added() -> SceneRecord:
    return record([*MESHES, mesh("c", 4)], [Shown("c", 4), *SHOWN])


def swapped() -> SceneRecord:
    return record(MESHES, [Shown("b", 1), *SHOWN[1:]])


def swapped_and_last_user_gone() -> SceneRecord:
    return record(MESHES[1:], [replace_mesh(item, "b") for item in SHOWN])


def replace_mesh(item: Shown, key: str) -> Shown:
    return Shown(key, item.uid, item.x, item.mask, item.parent, item.persistent_id)


def fewer_instances() -> SceneRecord:
    return record(MESHES, SHOWN[:-2])


def more_instances() -> SceneRecord:
    extra = [Shown("b", 2, x=50.0 + index, parent=9, persistent_id=(100 + index,)) for index in range(3)]
    return record(MESHES, [*SHOWN, *extra])


def reordered() -> SceneRecord:
    return record(MESHES[::-1], SHOWN[::-1])


def empty() -> SceneRecord:
    return record([], [])


def everything_at_once() -> SceneRecord:
    shown = [Shown("b", 1, x=3.0), Shown("c", 3), *SHOWN[4:], Shown("c", 2, x=1.0, mask=5), Shown("c", 8)]
    return record([mesh("c"), mesh("b", 5, shift=1.0)], shown)


def in_motion(
    made: SceneRecord, *rows: int, meshes: tuple[int, ...] = (), steps: int = 3, by: float = 1.0
) -> SceneRecord:
    """Returns the scene with these instances moving along x, and these meshes deforming along z."""
    way = by * np.linspace(-1.0, 1.0, steps, dtype=np.float32)
    moved = np.repeat(made.instances.transforms[None, list(rows)], steps, axis=0)
    moved[:, :, 0, 3] += way[:, None]
    motions = (InstanceMotions(np.array(rows, np.int32), moved),) if rows else ()
    bent = [made.meshes[row].positions + way[:, None, None] * np.float32([0.0, 0.0, 1.0]) for row in meshes]
    motion = SceneMotion(motions, tuple(MeshMotion(*pair) for pair in zip(meshes, bent, strict=True)))
    return replace(made, motion=motion)


def moving() -> SceneRecord:
    return in_motion(base(), 0, 2, 4)


def moving_more() -> SceneRecord:
    return in_motion(base(), 0, 1, 2, 4, 5)


def moving_faster() -> SceneRecord:
    return in_motion(base(), 0, 2, 4, by=2.0)


def moving_in_steps() -> SceneRecord:
    return in_motion(base(), 0, 2, 4, steps=5)


def moving_elsewhere() -> SceneRecord:
    return in_motion(moved(), 0, 4)


def moving_reordered() -> SceneRecord:
    return in_motion(reordered(), 0, 2, 4, meshes=(0,))


def bending() -> SceneRecord:
    return in_motion(base(), meshes=(0,))


def bending_both() -> SceneRecord:
    return in_motion(base(), 3, meshes=(0, 1), steps=2)


def bending_deformed() -> SceneRecord:
    return in_motion(deformed(), meshes=(0,))


def bending_more_triangles() -> SceneRecord:
    return in_motion(more_triangles(), 0, meshes=(0,))


TARGETS: dict[str, Callable[[], SceneRecord]] = {
    function.__name__: function
    for function in (
        base,
        moved,
        deformed,
        more_triangles,
        other_triangles,
        masked,
        object_removed,
        mesh_removed,
        object_added,
        swapped,
        swapped_and_last_user_gone,
        fewer_instances,
        more_instances,
        reordered,
        empty,
        everything_at_once,
        moving,
        moving_more,
        moving_faster,
        moving_in_steps,
        moving_elsewhere,
        moving_reordered,
        bending,
        bending_both,
        bending_deformed,
        bending_more_triangles,
    )
}

# The calls that a change from base() may make, in addition to commit.
CALLS = {
    "base": [],
    "moved": ["set_transforms"],
    "deformed": ["set_usage", "update_mesh"],
    "more_triangles": ["set_usage", "replace_mesh"],
    "other_triangles": ["set_usage", "replace_mesh"],
    "masked": ["set_masks"],
    "object_removed": ["remove_instances"],
    "mesh_removed": ["remove_instances", "remove_mesh"],
    "object_added": ["add_mesh", "add_instances"],
    "swapped": ["remove_instances", "add_instances"],
    "swapped_and_last_user_gone": ["remove_instances", "remove_mesh", "add_instances"],
    "fewer_instances": ["remove_instances"],
    "more_instances": ["add_instances"],
    "reordered": [],
    "moving": ["set_instance_motion"],
    "moving_elsewhere": ["set_transforms", "set_instance_motion"],
    "bending": ["set_mesh_motion"],
    "bending_both": ["set_mesh_motion", "set_mesh_motion", "set_instance_motion"],
    "bending_deformed": ["set_usage", "update_mesh", "set_mesh_motion"],
    "empty": ["remove_instances", "remove_mesh", "remove_mesh"],
}


def assert_ids_are_right(made: SceneState, target: SceneRecord) -> None:
    """Each instance of the record has the id under which the engine shows that mesh in that place."""
    scene = made.scene
    assert isinstance(scene, FakeScene)
    instances = target.instances
    assert len(made.instance_ids) == len(scene.instances) == len(instances)
    for row, instance_id in enumerate(made.instance_ids):
        held = scene.instances[int(instance_id)]
        np.testing.assert_array_equal(held.transform, instances.transforms[row])
        assert held.mask == instances.masks[row]
        assert held.mesh == made.mesh_ids[instances.mesh_indices[row]]
