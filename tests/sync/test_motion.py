"""Motions made from time samples, compared with plain loops; and the calls of the engine for motions."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from perfect_bvh_addon.sync.moments import MomentRecord, MotionSettings, times_of
from perfect_bvh_addon.sync.motion import add_motion, without_parting
from perfect_bvh_addon.sync.records import SceneRecord
from sync.fakes import Shown, mesh, record
from sync.targets import base, bending, fresh, moved, moving, moving_faster, moving_more, state

Ends = list[bytes]
Found = dict[Any, tuple[Ends, Ends]]


def moment(made: SceneRecord) -> MomentRecord:
    return MomentRecord(made.meshes, made.objects, made.instances, made.camera)


def settings(made: SceneRecord, steps: int = 3, **uids: int) -> MotionSettings:
    """uids: by "u" and an object's uid, its own number of steps."""
    counts = [uids.get(f"u{obj.session_uid}", steps) for obj in made.objects]
    return MotionSettings(np.array(counts, np.int32), np.ones(len(counts), np.bool_))


def scenes(random: np.random.Generator) -> dict[Fraction, SceneRecord]:
    """The same scene at five time samples: parts of it move, deform, are absent at some, or in another order."""
    shown = [Shown("abc"[i % 3], 1 + i // 4, parent=0 if i % 4 == 0 else 20, persistent_id=(i,)) for i in range(24)]
    goes, bends = random.random(24) < 0.5, random.random(3) < 0.6
    made = {}
    for number, time in enumerate(times_of(5)):
        there = [
            replace(item, x=float(i + goes[i] * number))
            for i, item in enumerate(shown)
            if i % 7 or number != 1  # the second moment lacks some
        ]
        order = random.permutation(len(there)) if number != 2 else np.arange(len(there))
        meshes = [mesh(key, 3, shift=float(bends[i] * number)) for i, key in enumerate("abc")]
        made[time] = record(meshes, [there[i] for i in order])
    return made


def identities(made: SceneRecord | MomentRecord) -> list[tuple[Any, ...]]:
    columns = made.instances
    uids = [*(obj.session_uid for obj in made.objects), 0]
    return [
        (uids[columns.object_indices[row]], uids[columns.parent_indices[row]], columns.persistent_ids[row].tobytes())
        for row in range(len(columns))
    ]


def by_loops(
    made: dict[Fraction, SceneRecord], frame: SceneRecord, counts: dict[int, int]
) -> dict[Any, tuple[Ends, Ends]]:
    """By an instance's identity: its transforms and its mesh's positions at its time samples, empty at rest."""
    found = {}
    for row, name in enumerate(identities(frame)):
        count = max(counts[name[0]], counts[name[1]]) if name[1] else counts[name[0]]
        places: Ends = []
        shapes: Ends = []
        for time in times_of(count):
            there = made[time]
            names = identities(there)
            if name not in names:
                places, shapes = [], []
                break
            other = names.index(name)
            places.append(there.instances.transforms[other].tobytes())
            shapes.append(there.meshes[there.instances.mesh_indices[other]].positions.tobytes())
        own = frame.instances.transforms[row].tobytes()
        own_shape = frame.meshes[frame.instances.mesh_indices[row]].positions.tobytes()
        found[name] = (
            places if any(place != own for place in places) else [],
            shapes if any(shape != own_shape for shape in shapes) else [],
        )
    return found


def as_found(moving_record: SceneRecord) -> Found:
    names = identities(moving_record)
    places: dict[int, Ends] = {}
    for motions in moving_record.motion.instances:
        for column, row in enumerate(motions.rows.tolist()):
            places[row] = [step.tobytes() for step in motions.transforms[:, column]]
    shapes = {one.row: [step.tobytes() for step in one.positions] for one in moving_record.motion.meshes}
    columns = moving_record.instances.mesh_indices
    return {name: (places.get(row, []), shapes.get(int(columns[row]), [])) for row, name in enumerate(names)}


@pytest.mark.parametrize("seed", range(20))
def test_motions_are_those_that_plain_loops_find(seed: int) -> None:
    made = scenes(np.random.default_rng(seed))
    frame = made[Fraction(1, 2)]
    counts = {obj.session_uid: (3, 5, 2)[obj.session_uid % 3] for obj in frame.objects}
    asked = MotionSettings(
        np.array([counts[obj.session_uid] for obj in frame.objects], np.int32), np.ones(len(frame.objects), np.bool_)
    )
    moments = {time: moment(there) for time, there in made.items()}
    result = add_motion(frame, moments, asked)
    assert as_found(result) == by_loops(made, frame, counts)
    back = without_parting(result)
    assert back.meshes == frame.meshes
    np.testing.assert_array_equal(back.instances.mesh_indices, frame.instances.mesh_indices)


def test_a_mesh_of_others_that_rest_parts_from_theirs() -> None:
    """One instance alone is asked to move."""
    frame = record([mesh("a")], [Shown("a", 1), Shown("a", 2, x=3.0)])
    later = record([mesh("a", shift=1.0)], [Shown("a", 1), Shown("a", 2, x=3.0)])
    moments = {Fraction(0): moment(frame), Fraction(1): moment(later)}
    result = add_motion(frame, moments, settings(frame, 2, u1=0))
    assert [one.key for one in result.meshes] == [("a",), ("apart", ("a",), 0)]
    assert result.instances.mesh_indices.tolist() == [0, 1] and [one.row for one in result.motion.meshes] == [1]
    whole = add_motion(frame, moments, settings(frame, 2))
    assert whole.meshes is frame.meshes and [one.row for one in whole.motion.meshes] == [0]


def row_of_copies(places: list[float], ids: list[int] | None = None) -> SceneRecord:
    """One instancer's copies at these places, numbered by their order or by `ids`, and a separate object."""
    numbers = range(len(places)) if ids is None else ids
    copies = [Shown("a", 1, x=x, parent=9, persistent_id=(0, n)) for x, n in zip(places, numbers, strict=True)]
    return record([mesh("a")], [Shown("a", 2), *copies])


@pytest.mark.parametrize(
    ("later", "ids", "still", "moving"),
    [
        ([2.0, 0.0, 1.0, 3.0], None, 3, []),  # another order
        ([3.0, 1.0, 2.0, 0.0], None, 2, []),
        ([1.0, 3.0, 2.0], None, 2, []),  # one less, and another order
        ([1.0, 2.0, 3.0, 4.0], None, 0, [1, 2, 3, 4]),  # a row that goes on by the way between two of them
        ([2.0, 0.0, 1.0, 3.5], None, 0, [1, 2, 3, 4]),
        ([0.0, 2.0, 2.0, 3.0], None, 0, [2]),
        ([2.0, 0.0, 1.0, 3.0], [0, 2, 1, 3], 0, [1, 3]),  # ids, which go with the places
    ],
)
def test_copies_without_ids_whose_order_changes_stand_still(
    later: list[float], ids: list[int] | None, still: int, moving: list[int]
) -> None:
    frame = row_of_copies([0.0, 1.0, 2.0, 3.0])
    moments = {Fraction(0): moment(frame), Fraction(1): moment(row_of_copies(later, ids))}
    result = add_motion(frame, moments, settings(frame, 2))
    rows = [row for motions in result.motion.instances for row in motions.rows.tolist()]
    told = [text for text in result.warnings if "have no ids" in text]
    assert rows == moving and len(told) == bool(still)
    assert all(f"object 9: {still} of its instances" in text for text in told)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_what_nothing_tells_apart_is_followed_while_there_is_as_much_of_it(count: int) -> None:
    """Points of nodes may have equal ids."""

    def there(number: int, x: float) -> SceneRecord:
        alike = [Shown("a", 1, x=10.0 * i + x, parent=9, persistent_id=(5,)) for i in range(number)]
        return record([mesh("a")], [Shown("a", 2, x=x), *alike])

    frame = there(3, 0.0)
    moments = {Fraction(0): moment(frame), Fraction(1): moment(there(count, 1.0))}
    result = add_motion(frame, moments, settings(frame, 2))
    rows = [motions.rows.tolist() for motions in result.motion.instances]
    assert rows == ([[0, 1, 2, 3]] if count == 3 else [[0]])
    still = "3 of its instances are missing at a moment of the shutter; they stand still, as at the frame"
    more = "1 of its instances is missing at the frame, but not at another moment of the shutter; left out"
    told = {3: [], 4: [still, more]}.get(count, [still])
    assert list(result.warnings) == [f"object 9: {text}" for text in told]


def test_what_is_flat_for_a_moment_stands_still() -> None:
    frame = record([mesh("a")], [Shown("a", 1), Shown("a", 2)])
    flat = moment(record([mesh("a")], [Shown("a", 1, x=2.0), Shown("a", 2, x=2.0)]))
    flat.instances.transforms[0, 2, 2] = 0.0
    result = add_motion(frame, {Fraction(0): moment(frame), Fraction(1): flat}, settings(frame, 2))
    assert [motions.rows.tolist() for motions in result.motion.instances] == [[1]]
    assert result.warnings == (
        "object 1: its scale is zero at a moment of the shutter; it stands still, as at the frame",
    )


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_a_small_or_sheared_matrix_is_not_flat(scale: float) -> None:
    frame = record([mesh("a")], [Shown("a", 1)])
    there = moment(record([mesh("a")], [Shown("a", 1)]))
    there.instances.transforms[0, :, :3] = scale * np.float32([[1, 5, 0], [0, 1e-5, 0], [0, 0, 1]])
    result = add_motion(frame, {Fraction(0): moment(frame), Fraction(1): there}, settings(frame, 2))
    assert result.motion.count == 1 and not result.warnings


# Calls of the engine ---------------------------------------------------------------------------------------------

STEPS: dict[str, tuple[Any, Any, list[str]]] = {
    "the same": (moving, moving, []),
    "an end": (moving, base, ["set_transforms"]),
    "an end by another place": (lambda: moving_row(0), moved, ["set_transforms"]),
    "some more": (moving, moving_more, ["set_instance_motion"]),
    "some less": (moving_more, moving, ["set_transforms"]),
    "another way": (moving, moving_faster, ["set_instance_motion"]),
    "the same shape": (bending, bending, []),
    "an end of a shape": (bending, base, ["update_mesh"]),
    "from shape to place": (bending, moving, ["update_mesh", "set_instance_motion"]),
}


def moving_row(row: int) -> SceneRecord:
    from sync.targets import in_motion

    return in_motion(base(), row)


@pytest.mark.parametrize("name", STEPS)
def test_only_the_difference_of_motions_is_edited(name: str) -> None:
    first, second, calls = STEPS[name]
    made, scene = state()
    made.update(first())
    scene.calls.clear()
    report = made.update(second())
    assert scene.calls == [*calls, "commit"]
    assert report.has_changes == report.motion_changed == bool(calls)
    assert report.motion_count == second().motion.count
    assert scene.answer() == fresh(second())
