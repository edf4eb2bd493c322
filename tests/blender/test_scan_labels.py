"""Labels of points by name: their sources, the values of points without label, and equality in every part of a scan."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.builders import collection, collection_instance  # noqa: E402
from blender.command_lines import run  # noqa: E402
from blender.labelled_room import PARTS, make_labelled_room  # noqa: E402
from perfect_bvh_addon import CameraGrid, PointCloud, scan  # noqa: E402
from perfect_bvh_addon.scanning import make_point_object  # noqa: E402

GRID = CameraGrid(200, 20)
PARTS_WITH_EMPTY = {x: {"" if x == 3.0 else part} for x, part in PARTS.items()}
SENSOR = 'kind = "depth camera"\nwidth = 20\nheight = 10\nhorizontal = 8\nvertical = 8\nrate = 24\n'


@pytest.fixture
def room(registered: None) -> Any:
    return make_labelled_room()


def by_place(cloud: PointCloud, name: str) -> dict[float, set[Any]]:
    """Return all values of a label on each square, by the square's x."""
    column = cloud.labels[name]
    places = np.round(cloud.positions[:, 0] / 3.0) * 3.0
    return {float(x): {column.value_at(row) for row in np.flatnonzero(places == x)} for x in np.unique(places)}


def test_a_property_is_the_objects_else_the_instancers_else_the_datas_else_the_materials(room: Any) -> None:
    cloud = scan(GRID, labels=("part",))
    assert by_place(cloud, "part") == {x: {part} for x, part in PARTS.items()}
    column = cloud.labels["part"]
    assert column.values.dtype == np.int32 and column.values.shape == (len(cloud),)
    assert column.names == tuple(sorted(part for part in PARTS.values() if part))
    assert set(column.values[cloud.positions[:, 0] > 13.9]) == {-1}


def test_of_instancers_within_instancers_the_outermost_counts(room: Any) -> None:
    outer = collection("Outer", linked=False)
    inner = collection_instance("Within", bpy.data.collections["Boxes"], into=outer)
    inner["part"], inner["categoryID"] = "within", 1
    bpy.data.objects["Shown"].instance_collection = outer
    cloud = scan(GRID, labels=("part", "categoryID", "instancer", "collection"))
    found = {name: by_place(cloud, name)[6.0] for name in cloud.labels}
    assert found == {
        "part": {"of instancer"},
        "categoryID": {70_000},
        "instancer": {"Shown"},
        "collection": {"Boxes"},
    }


def test_whole_numbers_stay_and_others_are_floats(room: Any) -> None:
    cloud = scan(GRID, labels=("categoryID", "weight"))
    none = {x: {None} for x in PARTS}
    assert by_place(cloud, "categoryID") == none | {0.0: {7}, 6.0: {70_000}}
    assert by_place(cloud, "weight") == none | {0.0: {2.0}, 12.0: {0.5}}
    whole, floats = cloud.labels["categoryID"], cloud.labels["weight"]
    assert whole.values.dtype == np.int32 and whole.names is None and set(whole.values) == {-1, 7, 70_000}
    assert floats.values.dtype == np.float64 and floats.names is None
    assert np.isnan(floats.values).sum() == (~np.isin(floats.values, (2.0, 0.5))).sum() > 0


def test_nothing_is_minus_one_among_whole_numbers_and_nan_among_floats(room: Any) -> None:
    data = bpy.data.objects["Data"]
    for value in (-2, -(2**31), 0):
        data["categoryID"] = value
        column = scan(GRID, labels=("categoryID",)).labels["categoryID"]
        assert set(column.values) == {-1, 7, 70_000, value} and column.values.dtype == np.int32
        assert column.table.described() == {"names": None, "missing": -1}
    for value in (-1, 0.5):
        data["categoryID"] = value
        cloud = scan(GRID, labels=("categoryID",))
        column = cloud.labels["categoryID"]
        assert set(column.values[~np.isnan(column.values)]) == {7.0, 70_000.0, value}
        assert column.table.described() == {"names": None, "missing": None}
        assert by_place(cloud, "categoryID")[3.0] == {value} and by_place(cloud, "categoryID")[12.0] == {None}


def test_an_empty_text_is_a_text(room: Any) -> None:
    bpy.data.objects["Data"]["part"] = ""
    cloud = scan(GRID, labels=("part",))
    assert by_place(cloud, "part") == PARTS_WITH_EMPTY
    assert cloud.labels["part"].names[0] == ""


def test_what_is_not_finite_is_none_and_nothing_else_is_refused(room: Any) -> None:
    own, data = bpy.data.objects["Own"], bpy.data.objects["Data"]
    own["odd"], data["odd"] = math.nan, math.inf
    with pytest.raises(ValueError, match="label 'odd' has no finite number: all its values are NaN or infinite"):
        scan(GRID, labels=("odd",))
    bpy.data.objects["Painted"]["odd"] = 3
    column = scan(GRID, labels=("odd",)).labels["odd"]
    assert set(column.values) == {-1, 3} and column.values.dtype == np.int32


def test_names_of_blenders_own(room: Any) -> None:
    cloud = scan(GRID, labels=("object", "instancer", "material", "collection"))
    names = ("Own", "Data", "Inner", "Child", "Painted", "Plain")
    assert by_place(cloud, "object") == {x: {name} for x, name in zip(PARTS, names, strict=True)}
    none = {x: {None} for x in PARTS}
    assert by_place(cloud, "instancer") == none | {6.0: {"Shown"}, 9.0: {"Parent"}}
    assert by_place(cloud, "material") == none | {0.0: {"painted"}, 12.0: {"painted"}, 15.0: {"plain"}}
    holders = {x: {"Scene Collection"} for x in PARTS}
    assert by_place(cloud, "collection") == holders | {6.0: {"Boxes"}, 9.0: {"Parents"}, 15.0: {"Alpha"}}
    assert cloud.labels["object"].names == tuple(sorted((*names, "Parent")))


def test_bad_labels_are_named(room: Any) -> None:
    bpy.data.objects["Own"]["box"] = [1.0, 2.0]
    for labels, said in (
        (("categoryid",), "custom property 'categoryid' that could be a label .is it 'categoryID'"),
        (("colection",), "is it 'collection'"),
        (("zzzz",), "could be a label; object, instancer, material, collection can be"),
        (("part", "part"), "labels must differ, got 'part' twice"),
        ("part", "labels must be a sequence of names"),
        ((3,), "labels must be names, got 3"),
        (("box",), "label 'box' must be a number, a text or a data-block, got IDPropertyArray on 'Own'"),
    ):
        with pytest.raises(ValueError, match=f"scan: .*{said}"):
            scan(GRID, labels=labels)


def test_a_property_that_becomes_a_text_is_refused(room: Any) -> None:
    def rename(*_: Any) -> None:
        bpy.data.objects["Own"]["categoryID"] = "seven"

    bpy.app.handlers.frame_change_post.append(rename)
    try:
        with pytest.raises(
            ValueError, match="'categoryID' held whole numbers other than -1 alone at first, and now has 'seven'"
        ):
            scan(GRID, frames=(1, 3), labels=("categoryID",))
    finally:
        bpy.app.handlers.frame_change_post.remove(rename)


def test_a_whole_number_that_becomes_minus_one_is_refused(room: Any) -> None:
    own = bpy.data.objects["Own"]
    for frame, number in ((1, 0), (3, -2)):
        own["categoryID"] = number
        own.keyframe_insert('["categoryID"]', frame=frame)
    room.frame_set(1)
    with pytest.raises(ValueError, match="held whole numbers other than -1 alone at first, and now has -1 on 'Own'"):
        scan(GRID, frames=(1, 3), labels=("categoryID",))


def test_numbers_that_are_keyed_are_those_of_their_frame(room: Any) -> None:
    own = bpy.data.objects["Own"]
    for frame in (1, 3):
        own["categoryID"] = frame
        own.keyframe_insert('["categoryID"]', frame=frame)
    room.frame_set(1)
    cloud = scan(GRID, frames=(1, 3), labels=("categoryID",))
    numbers = cloud.labels["categoryID"].values
    first = [set(numbers[(cloud.ray_ids // (200 * 20) == frame) & (cloud.positions[:, 0] < 1.1)]) for frame in range(3)]
    assert first == [{1}, {2}, {3}]


def test_points_of_blender_carry_them(room: Any) -> None:
    cloud = scan(GRID, labels=("part", "weight", "categoryID"))
    data = make_point_object(cloud, "points").data
    for name, dtype in (("part", np.int32), ("categoryID", np.int32), ("weight", np.float32)):
        found = np.empty(len(cloud), dtype)
        data.attributes[name].data.foreach_get("value", found)
        assert np.array_equal(found, cloud.labels[name].values.astype(dtype), equal_nan=True)
    facts = json.loads(data["labels"])
    assert facts["part"]["names"] == list(cloud.labels["part"].names) and facts["weight"]["missing"] is None


def test_the_button_asks_for_them(room: Any) -> None:
    settings = room.perfect_bvh.scan
    settings.width, settings.height, settings.labels = 200, 20, " part, categoryID,"
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    data = bpy.data.objects["Scan"].data
    assert set(json.loads(data["labels"])) == {"part", "categoryID"} and "part" in data.attributes
    settings.labels = "prat"
    with pytest.raises(RuntimeError, match="is it 'part'"):
        bpy.ops.perfect_bvh.scan()


# Pieces --------------------------------------------------------------------------------------------------------------


def test_pieces_have_one_table_whatever_is_met_in_them(room: Any, tmp_path: Path, capfd: Any) -> None:
    camera = room.camera
    for frame, x in ((1, 0.0), (2, 6.0), (3, 12.0)):  # a square after the other
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    path = tmp_path / "room.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    (tmp_path / "sensor.toml").write_text(SENSOR)
    asked = ("scan", path, "--sensor", tmp_path / "sensor.toml", "--frames", "1-3", "--chunk", 1, "-q")
    labels = ("--labels", "part", "categoryID", "collection")
    assert run(*asked, "-o", tmp_path / "out", *labels) == 0
    tables = []
    for frame, part in ((1, "own"), (2, "of instancer"), (3, "of material")):
        stem = tmp_path / "out" / f"points_{frame:04d}-{frame:04d}"
        manifest = json.loads(stem.with_suffix(".json").read_text())
        tables.append(manifest["labels"])
        with np.load(stem.with_suffix(".npz")) as data:
            assert json.loads(str(data["labels"])) == manifest["labels"]
            assert {manifest["labels"]["part"]["names"][row] for row in set(data["part"])} == {part}
    assert tables[0] == tables[1] == tables[2]
    assert tables[0]["part"]["names"] == sorted(part for part in PARTS.values() if part)
    assert run(*asked, "-o", tmp_path / "out", "--labels", "part") == 2
    assert "differs in 'labels'" in capfd.readouterr().err
    assert run(*asked, "-o", tmp_path / "new", "--format", "ply", "--labels", "a b", "a_b") == 2
    assert "labels 'a b' and 'a_b' would both be column 'a_b'" in capfd.readouterr().err
    assert run(*asked, "-o", tmp_path / "new", "--labels", "prat") == 2
    assert "is it 'part'?" in capfd.readouterr().err
