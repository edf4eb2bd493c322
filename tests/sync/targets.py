"""A small scene, what may become of it, and which calls of the engine that takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from perfect_bvh_addon.sync.records import SceneRecord
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
    """What an empty scene holds after one update."""
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
    )
}

# What a change from base() may call, beside commit.
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
