"""Each difference between two readings is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from perfect_bvh_addon.sync.look_records import ImageRecord, LightRecords, MaterialRecord, WorldRecord
from perfect_bvh_addon.sync.plan import find_mismatches
from perfect_bvh_addon.sync.records import SceneRecord
from sync.fakes import Shown, mesh, record

SHOWN = [Shown("a", 1), Shown("b", 2)]


def base() -> SceneRecord:
    return record([mesh("a"), mesh("b", 4)], SHOWN)


def with_mesh(**columns: object) -> SceneRecord:
    made = base()
    return replace(made, meshes=(replace(made.meshes[0], **columns), made.meshes[1]))


def with_instances(**columns: object) -> SceneRecord:
    return replace(base(), instances=replace(base().instances, **columns))


DIFFERENCES: dict[str, Callable[[], SceneRecord]] = {
    "mesh a: positions differ": lambda: with_mesh(positions=base().meshes[0].positions + 1),
    "mesh a: triangles differ": lambda: with_mesh(triangles=base().meshes[0].triangles[:, ::-1]),
    "mesh a: polygon_ids differ": lambda: with_mesh(polygon_ids=base().meshes[0].polygon_ids + 1),
    "mesh a: material_slots differ": lambda: with_mesh(material_slots=np.zeros(2, np.int32)),
    "instances: transforms differ": lambda: record(base().meshes, [Shown("a", 1, x=2.0), SHOWN[1]]),
    "instances: masks differ": lambda: record(base().meshes, [Shown("a", 1, mask=1), SHOWN[1]]),
    "camera or image size differ": lambda: replace(base(), size=(17, 9)),
    "materials differ": lambda: replace(base(), materials=(MaterialRecord("m", 9, 0, (1.0, 0.0, 0.0, 1.0)),)),
    "world differ": lambda: replace(base(), world=WorldRecord((1.0, 0.0, 0.0))),
    "lights differ": lambda: replace(base(), lights=LightRecords(kinds=("sun",))),
    "images differ": lambda: replace(base(), images=(ImageRecord("i", 9, np.zeros((1, 1, 4), np.uint8), "clip"),)),
    "instances: persistent_ids differ": lambda: with_instances(persistent_ids=np.ones((2, 8), np.int32)),
    "instances: object_indices differ": lambda: with_instances(object_indices=np.array([1, 0], np.int32)),
    "instances: mesh_indices differ": lambda: with_instances(mesh_indices=np.array([1, 0], np.int32)),
    "film differ": lambda: replace(base(), film_transparent=True),
    "objects differ": lambda: record(base().meshes, SHOWN, names={1: "renamed"}),
    "mesh c: not synced": lambda: replace(base(), meshes=(*base().meshes, mesh("c"))),
    "mesh b: synced, but Blender does not show it": lambda: replace(base(), meshes=base().meshes[:1]),
}


@pytest.mark.parametrize("sentence", DIFFERENCES)
def test_a_difference_is_named(sentence: str) -> None:
    assert find_mismatches(base(), DIFFERENCES[sentence]()) == (sentence,)


def test_what_is_known_to_be_rounded_may_differ_by_so_much() -> None:
    def moved(by: float) -> SceneRecord:
        return with_mesh(positions=base().meshes[0].positions + np.float32(by), rounding=1e-3)

    assert find_mismatches(base(), moved(5e-4)) == ()
    assert find_mismatches(base(), moved(2e-3)) == ("mesh a: positions differ",)
    assert find_mismatches(base(), with_mesh(rounding=1e-3, triangles=base().meshes[0].triangles[:, ::-1])) != ()


@pytest.mark.parametrize(
    ("column", "by", "sentence"),
    [
        ("radii", 0.0101, "radii differ"),
        ("corner_uvs", 0.01, "corner_uvs differ"),
        ("corner_colors", 0.03, "corner_colors differ"),
        ("named_uvs", 0.01, "uv maps or colors differ"),
        ("named_colors", 0.03, "uv maps or colors differ"),
    ],
)
def test_rounding_of_places_is_none_of_other_numbers(column: str, by: float, sentence: str) -> None:
    """As far away as 1e5, where places are good to 1; radii are 0.01."""

    def read(values: float) -> SceneRecord:
        array = np.full((4, 3), values, np.float32)
        return with_mesh(**{column: {"name": array} if column.startswith("named") else array}, rounding=1.0)

    assert find_mismatches(read(0.01), read(0.01 + by * 1e-4)) == ()
    assert find_mismatches(read(0.01), read(0.01 + by)) == (f"mesh a: {sentence}",)


def test_equal_readings_have_none() -> None:
    assert find_mismatches(base(), base()) == ()
