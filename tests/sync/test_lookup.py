"""Ids back to objects, polygons and materials: against a loop over the rays, in every shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from perfect_bvh_addon.sync.look_records import MaterialRecord
from perfect_bvh_addon.sync.lookup import SceneLookup
from perfect_bvh_addon.sync.records import SceneRecord
from sync.fakes import Shown, mesh, record

SCENE_ID = 5
MATERIALS = tuple(MaterialRecord(name, uid, 0, (0.0, 0.0, 0.0, 1.0)) for uid, name in enumerate(("red", "green")))


def scene_record() -> SceneRecord:
    meshes = [
        replace(mesh("a", 4), material_slots=np.array([0, 1, 2, 5], np.int32)),
        replace(
            mesh("b", 3),
            material_slots=np.array([0, 0, 1], np.int32),
            polygon_ids=np.array([7, 7, 9], np.int32),
            triangle_ids=np.array([10, 11, 14], np.int32),
        ),
    ]
    shown = [
        Shown("a", 1),
        Shown("b", 2, parent=9, persistent_id=(3, 1)),
        Shown("a", 3),
        Shown("b", 4),
    ]
    slots = {1: (0, 1, -1), 2: (1,), 3: (), 4: (-1, 0)}
    names = {1: "one", 2: "two", 3: "three", 4: "four", 9: "parent"}
    return record(meshes, shown, slots=slots, materials=MATERIALS, names=names)


@pytest.fixture(params=["dense ids", "spread ids"])
def ids(request: pytest.FixtureRequest) -> tuple[np.ndarray, np.ndarray]:
    if request.param == "dense ids":
        return np.array([4, 2, 3, 7], np.int32), np.array([1, 0], np.int32)
    return np.array([4, 2_000_000_000, 3, 70_000], np.int32), np.array([900_000_000, 5], np.int32)


def hits(ids: tuple[np.ndarray, np.ndarray], count: int, shape: tuple[int, ...] = (-1,)) -> Any:
    """Every triangle of every instance and misses, many times, in random order."""
    made, (instance_ids, mesh_ids) = scene_record(), ids
    rows = [
        (instance_ids[row], mesh_ids[mesh_row], primitive)
        for row, mesh_row in enumerate(made.instances.mesh_indices)
        for primitive in range(len(made.meshes[mesh_row].triangles))
    ]
    rows += [(-1, -1, -1)] * 5
    picked = np.array(rows, np.int32)[np.random.default_rng(1).integers(0, len(rows), count)]
    columns = (np.ascontiguousarray(column).reshape(shape) for column in picked.T)
    found = dict(zip(("instance_ids", "mesh_ids", "primitive_ids"), columns, strict=True))
    return SimpleNamespace(**found, scene_id=SCENE_ID, generation=3)


def look_up_in(made: SceneRecord, ids: tuple[np.ndarray, np.ndarray], generations: Sequence[int] = ()) -> SceneLookup:
    """Meshes of the second commit, unless said otherwise."""
    return SceneLookup(made, *ids, SCENE_ID, np.array(generations or [2] * len(ids[1]), np.int64))


def expected(found: Any, ids: tuple[np.ndarray, np.ndarray], what: str) -> np.ndarray:
    """The plain way: one ray after the other."""
    made, (instance_ids, mesh_ids) = scene_record(), ids
    values = []
    columns = (found.instance_ids, found.mesh_ids, found.primitive_ids)
    for instance, mesh_id, primitive in zip(*(column.ravel() for column in columns), strict=True):
        if instance < 0:
            values.append(-1)
            continue
        obj = made.objects[made.instances.object_indices[list(instance_ids).index(instance)]]
        hit_mesh = made.meshes[list(mesh_ids).index(mesh_id)]
        if what == "polygon":
            values.append(hit_mesh.polygon_ids[primitive])
        elif what == "triangle":
            values.append(primitive if hit_mesh.triangle_ids is None else hit_mesh.triangle_ids[primitive])
        else:
            slot = min(int(hit_mesh.material_slots[primitive]), len(obj.material_slots) - 1)
            values.append(obj.material_slots[slot] if obj.material_slots else -1)
    return np.array(values).reshape(found.instance_ids.shape)


@pytest.mark.parametrize("shape", [(600,), (20, 30), (0,)])
@pytest.mark.parametrize("what", ["polygon", "triangle", "material"])
def test_ids_of_hits(ids: tuple[np.ndarray, np.ndarray], what: str, shape: tuple[int, ...]) -> None:
    lookup = look_up_in(scene_record(), ids)
    found = hits(ids, int(np.prod(shape)), shape)
    answer = getattr(lookup, f"{what}_ids")(found)
    assert answer.dtype == np.int32
    np.testing.assert_array_equal(answer, expected(found, ids, what))


def test_descriptions(ids: tuple[np.ndarray, np.ndarray]) -> None:
    lookup = look_up_in(scene_record(), ids)
    asked = np.array([[ids[0][1], -1], [ids[0][3], ids[0][0]]])
    names, uids, persistent_ids, parents, parent_uids = lookup.describe(asked)
    assert names.tolist() == [["two", ""], ["four", "one"]]
    assert uids.tolist() == [[2, 0], [4, 1]]
    assert parents.tolist() == [["parent", ""], ["", ""]]
    assert parent_uids.tolist() == [[9, 0], [0, 0]]
    assert persistent_ids.shape == (2, 2, 8)
    assert persistent_ids[0, 0, :2].tolist() == [3, 1]
    assert (persistent_ids[0, 1] == -1).all()
    assert (persistent_ids[1] == 0).all()


def test_one_id_is_described_as_a_scalar(ids: tuple[np.ndarray, np.ndarray]) -> None:
    description = look_up_in(scene_record(), ids).describe(int(ids[0][0]))
    assert description.names == "one"
    assert description.persistent_ids.shape == (8,)


@pytest.mark.parametrize("unknown", [-2, 5, 2**31 - 1])
def test_ids_that_are_not_there_are_errors(ids: tuple[np.ndarray, np.ndarray], unknown: int) -> None:
    lookup = look_up_in(scene_record(), ids)
    with pytest.raises(ValueError, match=f"instance {unknown} is not part of the synced scene"):
        lookup.describe([ids[0][0], unknown])


@pytest.mark.parametrize(("mesh_row", "primitive"), [(0, 4), (1, 3), (1, -1)])
def test_triangles_of_an_earlier_update_are_errors(
    ids: tuple[np.ndarray, np.ndarray], mesh_row: int, primitive: int
) -> None:
    """Otherwise they would be looked up in the next mesh."""
    old = SimpleNamespace(
        instance_ids=np.array([-1, ids[0][mesh_row]], np.int32),
        mesh_ids=np.array([-1, ids[1][mesh_row]], np.int32),
        primitive_ids=np.array([-1, primitive], np.int32),
        scene_id=SCENE_ID,
        generation=2,
    )
    lookup = look_up_in(scene_record(), ids)
    for look_up in (lookup.polygon_ids, lookup.triangle_ids, lookup.material_ids):
        with pytest.raises(ValueError, match=f"triangle {primitive} is not part of the synced scene"):
            look_up(old)


def test_floats_are_no_ids(ids: tuple[np.ndarray, np.ndarray]) -> None:
    with pytest.raises(ValueError, match="integers"):
        look_up_in(scene_record(), ids).describe([1.0])


def test_an_empty_scene_has_only_misses() -> None:
    none = np.empty(0, np.int32)
    lookup = look_up_in(record([], []), (none, none))
    misses = SimpleNamespace(**dict.fromkeys(("instance_ids", "mesh_ids", "primitive_ids"), np.full(3, -1, np.int32)))
    misses.scene_id, misses.generation = SCENE_ID, 1
    for answer in (lookup.polygon_ids(misses), lookup.material_ids(misses), lookup.triangle_ids(misses)):
        assert answer.tolist() == [-1, -1, -1]
    assert lookup.describe(misses.instance_ids).names.tolist() == ["", "", ""]
    with pytest.raises(ValueError, match="instance 0 is not part"):
        lookup.describe([0])


def test_material_ids_need_slots(ids: tuple[np.ndarray, np.ndarray]) -> None:
    made = scene_record()
    bare = replace(made, meshes=tuple(replace(item, material_slots=None) for item in made.meshes))
    lookup = look_up_in(bare, ids)
    with pytest.raises(ValueError, match="material_slots were not read"):
        lookup.material_ids(hits(ids, 3))


@pytest.mark.parametrize("what", ["polygon", "triangle", "material"])
def test_hits_on_a_mesh_that_was_replaced_since_are_errors(ids: tuple[np.ndarray, np.ndarray], what: str) -> None:
    """Even where the mesh that follows has as many triangles; hits on other meshes are still looked up."""
    lookup = look_up_in(scene_record(), ids, [4, 3])
    found = hits(ids, 50)
    with pytest.raises(ValueError, match=r"got hits of generation 3 on mesh \d+, whose triangles were replaced since"):
        getattr(lookup, f"{what}_ids")(found)
    for name in ("instance_ids", "mesh_ids", "primitive_ids"):
        column = getattr(found, name)
        column[...] = np.where(np.asarray(hits(ids, 50).mesh_ids) == ids[1][0], -1, column)
    np.testing.assert_array_equal(getattr(lookup, f"{what}_ids")(found), expected(found, ids, what))


def test_hits_of_another_scene_are_errors(ids: tuple[np.ndarray, np.ndarray]) -> None:
    found = hits(ids, 5)
    found.scene_id = SCENE_ID + 1
    for what in ("polygon", "triangle", "material"):
        with pytest.raises(ValueError, match="got hits of another scene"):
            getattr(look_up_in(scene_record(), ids), f"{what}_ids")(found)
