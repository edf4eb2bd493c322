"""The engine's appearance of each instance and triangle equals the record's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from perfect_bvh.appearance import World
from perfect_bvh_addon.sync.appearance import make_appearance
from perfect_bvh_addon.sync.look_records import LightRecords, MaterialRecord, WorldRecord
from perfect_bvh_addon.sync.records import VISIBLE_TO_CAMERA, VISIBLE_TO_SHADOW
from sync.fakes import Shown, mesh, record

MATERIALS = (MaterialRecord("red", 70, 3, (1.0, 0.0, 0.0, 1.0)), MaterialRecord("green", 71, 4, (0.0, 1.0, 0.0, 0.5)))


def test_materials_and_attributes() -> None:
    slots = np.array([0, 1], np.int32)
    normals, uvs = np.ones((2, 3, 3), np.float32), np.ones((2, 3, 2), np.float32)
    made = record(
        [replace(mesh("a"), material_slots=slots, corner_normals=normals, corner_uvs=uvs), mesh("b")],
        [Shown("a", 1), Shown("b", 2)],
        materials=MATERIALS,
        film_transparent=True,
    )
    appearance = make_appearance(made, np.array([8, 9], np.int32), np.array([40, 30], np.int32))
    assert set(appearance.meshes) == {40, 30}
    assert appearance.meshes[40].material_slots is slots
    assert appearance.meshes[40].corner_normals is normals
    assert appearance.meshes[40].corner_uvs is uvs
    assert appearance.meshes[30].material_slots is None
    np.testing.assert_array_equal(appearance.materials.colors, [[1, 0, 0, 1], [0, 1, 0, 0.5]])
    assert appearance.materials.indices.tolist() == [3, 4]
    assert appearance.film_transparent
    assert (appearance.camera_mask, appearance.shadow_mask) == (VISIBLE_TO_CAMERA, VISIBLE_TO_SHADOW)


@pytest.mark.parametrize("what", ["nothing", "world", "light", "material"])
def test_a_scene_in_which_nothing_shines_is_as_dark_as_it_says(what: str) -> None:
    shining = replace(MATERIALS[0], emission=(0.0, 1.0, 0.0))
    power = np.ones((1, 3), np.float32)
    lamp = LightRecords(("point",), np.zeros((1, 3)), np.eye(3, dtype=np.float32)[None], power)
    made = record(
        [mesh("a")],
        [Shown("a", 1)],
        materials=(shining,) if what == "material" else MATERIALS,
        world=WorldRecord((0.5, 0.5, 0.5)) if what == "world" else WorldRecord(),
        lights=lamp if what == "light" else LightRecords(),
    )
    appearance = make_appearance(made, np.array([8], np.int32), np.array([40], np.int32))
    assert appearance.world == World((0.5, 0.5, 0.5) if what == "world" else (0.0, 0.0, 0.0))
    assert made.is_dark == (what == "nothing")
    assert make_appearance(replace(made, world=None), np.array([8], np.int32), np.array([40], np.int32)).world is None


def test_each_instance_lists_its_objects_slots() -> None:
    made = record(
        [replace(mesh("a", 3), material_slots=np.array([0, 3, 1], np.int32)), mesh("b")],
        [
            Shown("a", 1),
            Shown("b", 1, parent=9, persistent_id=(0,)),
            Shown("a", 2),
            Shown("b", 3),
            Shown("a", 1, parent=9, persistent_id=(1,)),
        ],
        slots={1: (0, 1), 2: (1, -1, 0, 0, 1), 3: ()},
        materials=MATERIALS,
    )
    ids = np.array([3, 4, 5, 9, 2], np.int32)
    table = make_appearance(made, ids, np.array([0, 1], np.int32)).instances
    np.testing.assert_array_equal(table.ids, ids)
    listed = [
        table.slot_materials[first:end].tolist()
        for first, end in zip(table.slot_offsets[:-1], table.slot_offsets[1:], strict=True)
    ]
    assert listed == [[0, 1], [0, 1], [1, -1, 0, 0, 1], [], [0, 1]]
    assert table.object_indices.tolist() == [1, 1, 2, 3, 1]
    assert table.slot_offsets.dtype == table.slot_materials.dtype == table.object_indices.dtype == np.int32


def test_holdouts_are_those_of_the_objects() -> None:
    made = record([mesh("a")], [Shown("a", 1), Shown("a", 2)])
    made = replace(made, objects=(made.objects[0], replace(made.objects[1], holdout=True)))
    table = make_appearance(made, np.array([0, 1], np.int32), np.array([0], np.int32)).instances
    assert table.holdout.tolist() == [False, True]
    assert table.holdout.dtype == np.bool_


def test_an_empty_scene() -> None:
    none = np.empty(0, np.int32)
    appearance = make_appearance(record([], []), none, none)
    assert appearance.meshes == {}
    assert appearance.instances.slot_offsets.tolist() == [0]
    assert appearance.materials.colors.shape == (0, 4)
