"""Point clouds in other programs' formats, read back with the libraries that those programs use."""

from __future__ import annotations

import importlib
import json
import math
import sys
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

h5py = pytest.importorskip("h5py")
laspy = pytest.importorskip("laspy")
plyfile = pytest.importorskip("plyfile")
pyarrow_csv = pytest.importorskip("pyarrow.csv")
pyarrow_parquet = pytest.importorskip("pyarrow.parquet")
pytest.importorskip("bpy")

from perfect_bvh_addon import PointCloud, save_cloud  # noqa: E402
from perfect_bvh_addon.scanning import formats  # noqa: E402
from perfect_bvh_addon.scanning.formats import (  # noqa: E402
    check_format,
    label_columns,
)
from perfect_bvh_addon.scanning.point_cloud import COLUMNS  # noqa: E402
from perfect_bvh_addon.support.files import how_to_get  # noqa: E402
from perfect_bvh_addon.sync.lookup import LabelColumn, LabelTable  # noqa: E402

ODD = "Größe / a name of more than 32 bytes"
NAMES = ("Würfel", 'a "quoted" name', "Ground\nfloor")


def cloud(count: int = 257, far: float = 0.0) -> PointCloud:
    random = np.random.default_rng(count)
    whole = {name: random.integers(0, 3, count).astype(np.int32) for name in ("object_ids", "instance_ids", "ring_ids")}
    single = ("incidences", "intensities", "spacings")
    return PointCloud(
        positions=random.normal(size=(count, 3)) * 50.0 + far,
        distances=random.uniform(1.0, 90.0, count),
        normals=random.normal(size=(count, 3)).astype(np.float32),
        material_ids=random.integers(-1, 2, count).astype(np.int32),
        times=np.sort(random.uniform(0.0, 2.0, count)),
        ray_ids=np.arange(count, dtype=np.int64) * (1 << 33),
        return_counts=(np.arange(count) % 3 + 1).astype(np.int32),
        return_ids=(np.arange(count) % 3).astype(np.int32),
        **whole,
        **{name: random.uniform(0.0, 1.0, count).astype(np.float32) for name in single},
        object_names=NAMES,
        material_names=("Red", "Blue"),
        ray_count=1000,
        pose_error=0.25,
        labels=labels_of(random, count),
    )


def labels_of(random: np.random.Generator, count: int) -> dict[str, LabelColumn]:
    """Labels of every kind: one has the name of a column, one a name that some formats cannot hold unchanged."""
    kinds = {
        "kind": (random.integers(-1, 3, count).astype(np.int32), LabelTable(NAMES, -1)),
        "partID": (random.integers(-1, 1 << 30, count).astype(np.int32), LabelTable(None, -1)),
        "time": (np.where(random.random(count) < 0.5, np.nan, random.random(count)), LabelTable(None, math.nan)),
        ODD: (random.integers(-1, 3, count).astype(np.int32), LabelTable(NAMES, -1)),
    }
    return {name: LabelColumn(values, table) for name, (values, table) in kinds.items()}


def check_labels(made: PointCloud, facts: Any, column: Any) -> None:
    """Check that each label is in the column that the file names, and that the meaning of its values is in the file."""
    assert set(facts) == set(made.labels)
    for name, label in made.labels.items():
        found = np.asarray(column(facts[name]["column"]))
        assert found.dtype.kind == label.values.dtype.kind
        assert np.array_equal(found, label.values, equal_nan=label.values.dtype.kind == "f"), name
        assert facts[name]["names"] == (None if label.names is None else list(label.names))
        assert facts[name]["missing"] == (-1 if label.table.is_whole else None)


@pytest.mark.parametrize("count", [257, 0])
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_tables_hold_every_column(tmp_path: Path, suffix: str, count: int) -> None:
    made = cloud(count)
    path = save_cloud(made, tmp_path / f"points{suffix}")
    table = pyarrow_csv.read_csv(path) if suffix == ".csv" else pyarrow_parquet.read_table(path)
    assert table.num_rows == count
    assert len(table.column_names) == len(COLUMNS) + 4 + len(made.labels)
    if count:
        assert np.array_equal(table["x"].to_numpy(), made.positions[:, 0])
        assert np.array_equal(table["ray_id"].to_numpy(), made.ray_ids)
        assert np.array_equal(table["intensity"].to_numpy().astype(np.float32), made.intensities)
    if suffix == ".parquet":
        assert json.loads(table.schema.metadata[b"object_names"]) == list(NAMES)
        assert table.schema.metadata[b"ray_count"] == b"1000"
        check_labels(made, json.loads(table.schema.metadata[b"labels"]), lambda name: table[name].to_numpy())
    elif count:
        assert np.array_equal(table["partID"].to_numpy(), made.labels["partID"].values)
        assert np.array_equal(table["label_time"].to_numpy(), made.labels["time"].values, equal_nan=True)


@pytest.mark.parametrize("count", [257, 0])
def test_ply_holds_every_column(tmp_path: Path, count: int) -> None:
    made = cloud(count)
    data = plyfile.PlyData.read(str(save_cloud(made, tmp_path / "points.ply")))
    rows = data["vertex"]
    assert rows.count == count
    assert np.array_equal(rows["z"], made.positions[:, 2]) and np.array_equal(rows["ny"], made.normals[:, 1])
    assert np.array_equal(rows["ray_id"].astype(np.int64), made.ray_ids)
    (names,) = (text for text in data.comments if text.startswith("object_names "))
    assert json.loads(names.removeprefix("object_names ")) == list(NAMES)
    (labels,) = (text for text in data.comments if text.startswith("labels "))
    check_labels(made, json.loads(labels.removeprefix("labels ")), lambda name: rows[name])


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize(("count", "far"), [(257, 0.0), (0, 0.0), (257, 4e6)])
def test_las_holds_every_column(tmp_path: Path, suffix: str, count: int, far: float) -> None:
    made = cloud(count, far)
    path = save_cloud(made, tmp_path / f"points{suffix}")
    points = laspy.read(path)
    assert len(points) == count
    assert points.header.are_points_compressed == (suffix == ".laz")
    xyz = np.column_stack([points.x, points.y, points.z])
    assert np.abs(xyz - made.positions).max(initial=0.0) <= 0.5001e-4
    assert np.array_equal(points.gps_time, made.times)
    assert np.array_equal(points["ray_id"], made.ray_ids) and np.array_equal(points["object_id"], made.object_ids)
    assert np.array_equal(points.return_number, made.return_ids + 1)
    assert np.array_equal(points.number_of_returns, made.return_counts)
    assert np.abs(np.asarray(points.intensity) / 65535.0 - made.intensities).max(initial=0.0) < 1e-5
    texts = {vlr.description.strip("\0"): vlr.record_data for vlr in points.header.vlrs.get_by_id("Perfect BVH")}
    assert json.loads(texts["object_names"]) == list(NAMES)
    check_labels(made, json.loads(texts["labels"]), lambda name: points[name])


@pytest.mark.parametrize("extent", [1.0, 2e5, 4e5, 5e5, 1e9, 1e30, 1.7e308])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_holds_any_finite_extent(tmp_path: Path, extent: float, suffix: str) -> None:
    """The error is at most half a step. A step is 1e-4, or for wide clouds the extent / (2^32 - 4), plus rounding."""
    made = cloud(33)
    for seed in range(8):
        random = np.random.default_rng(seed)
        positions = random.uniform(-1.0, 1.0, (33, 3)) * extent * [1.0, 0.5, 1e-3]
        positions[0] = [extent, 0.0, extent / 3]
        points = laspy.read(save_cloud(replace(made, positions=positions), tmp_path / f"points{suffix}"))
        found = np.column_stack([points.x, points.y, points.z])
        low, high = positions.min(axis=0), positions.max(axis=0)
        step = np.maximum(1e-4, (high / 2 - low / 2 + 1.0) / (2**31 - 2))
        assert np.all(np.abs(found - positions) <= 0.50001 * step)


@pytest.mark.parametrize("far", [0.0, 1e15, -1e300])
def test_las_holds_a_single_point_anywhere(tmp_path: Path, far: float) -> None:
    made = cloud(1)
    points = laspy.read(save_cloud(replace(made, positions=np.full((1, 3), far)), tmp_path / "points.las"))
    assert [points.x[0], points.y[0], points.z[0]] == [far] * 3


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_refuses_what_is_not_finite(tmp_path: Path, suffix: str) -> None:
    made = cloud(20)
    made.positions[3, 0], made.positions[3, 1], made.positions[7, 2] = math.nan, math.inf, -math.inf
    made.intensities[9] = math.nan
    with pytest.raises(ValueError, match="but 3 of 20 points have others"):
        save_cloud(made, tmp_path / f"points{suffix}")
    assert list(tmp_path.iterdir()) == []
    with np.load(save_cloud(made, tmp_path / "points.npz")) as data:
        assert np.array_equal(data["positions"], made.positions, equal_nan=True)


def test_las_holds_names_of_any_number(tmp_path: Path) -> None:
    names = tuple(f"An object with a long name, number {number}" for number in range(5000))
    points = laspy.read(save_cloud(replace(cloud(), object_names=names), tmp_path / "POINTS.LAZ"))
    assert points.header.are_points_compressed
    parts = [
        vlr.record_data
        for vlr in points.header.vlrs.get_by_id("Perfect BVH")
        if vlr.description.strip("\0") == "object_names"
    ]
    assert len(parts) > 1 and json.loads(b"".join(parts)) == list(names)


def test_files_are_the_same_on_every_day(tmp_path: Path) -> None:
    points = laspy.read(save_cloud(cloud(), tmp_path / "points.las"))
    assert points.header.creation_date == date(2000, 1, 1)


@pytest.mark.parametrize("suffix", [".npz", ".ply", ".las", ".csv"])
def test_formats_without_a_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    def refuse(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(formats, "_library", refuse)
    check_format(suffix)
    assert how_to_get("files", *formats.FORMATS[suffix].modules) is None
    assert save_cloud(cloud(), tmp_path / f"points{suffix}").stat().st_size > 10_000


@pytest.mark.parametrize(("version", "named"), [("1.26.4", '"pyarrow<22"'), ("2.4.0", "pyarrow")])
def test_the_pyarrow_is_one_for_the_numpy_there_is(monkeypatch: pytest.MonkeyPatch, version: str, named: str) -> None:
    monkeypatch.setattr(np, "__version__", version)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(ImportError) as refused:
        check_format(".parquet")
    assert str(refused.value).endswith(f"-m pip install {named}")


def test_las_counts_points_by_return(tmp_path: Path) -> None:
    """Bounds are in the header; a 16th return is stored as the 15th."""
    made = cloud()
    numbers = np.where(np.arange(257) % 3 == 2, 20, np.arange(257) % 3).astype(np.int32)
    made = replace(made, return_ids=numbers, return_counts=np.full(257, 21, np.int32))
    points = laspy.read(save_cloud(made, tmp_path / "points.las"))
    assert list(points.header.number_of_points_by_return) == [86, 86, *[0] * 12, 85]
    assert set(points.number_of_returns) == {15}
    assert np.allclose(points.header.mins, made.positions.min(axis=0), atol=1e-4)
    assert np.allclose(points.header.maxs, made.positions.max(axis=0), atol=1e-4)
    assert points.header.generating_software == "Perfect BVH" and str(points.header.version) == "1.4"


def test_hdf5_holds_every_column(tmp_path: Path) -> None:
    made = cloud()
    with h5py.File(save_cloud(made, tmp_path / "points.h5")) as file:
        for column in COLUMNS:
            assert np.array_equal(file[column][()], getattr(made, column))
        assert [name.decode() for name in file["object_names"][()]] == list(NAMES)
        assert file.attrs["pose_error"] == 0.25
        check_labels(made, json.loads(file["labels"][()]), lambda name: file[name][()])


def test_npz_is_the_clouds_own(tmp_path: Path) -> None:
    made = cloud()
    with np.load(save_cloud(made, tmp_path / "points.NPZ")) as data:
        assert set(COLUMNS) <= set(data.files)
        check_labels(made, json.loads(str(data["labels"])), lambda name: data[name])


def test_labels_keep_clear_of_a_formats_own_columns(tmp_path: Path) -> None:
    made = cloud()
    column = made.labels["partID"]
    renamed = replace(made, labels={"classification": column, "X": column, "Object_ID": column})
    assert label_columns(renamed.labels, ".las") == {
        "classification": "label_classification",
        "X": "label_X",
        "Object_ID": "label_Object_ID",
    }
    points = laspy.read(save_cloud(renamed, tmp_path / "points.las"))
    assert np.array_equal(points["label_classification"], column.values) and not points.classification.any()
    assert label_columns(renamed.labels, ".csv")["classification"] == "classification"
    alike = replace(made, labels={"part id": column, "part_id": column})
    with pytest.raises(ValueError, match="labels 'part id' and 'part_id' would both be column 'part_id' of a ply file"):
        save_cloud(alike, tmp_path / "points.ply")
    assert list(tmp_path.glob("*.ply")) == []


def test_what_cannot_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match=r"must end in .npz, .ply, .*got 'points.xyz'"):
        save_cloud(cloud(), tmp_path / "points.xyz")
    with pytest.raises(ValueError, match="the format must be one of npz, ply"):
        check_format(".xyz")

    def without(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", without)
    with pytest.raises(ImportError, match=r"laspy and lazrs \(perfect-bvh\[data\]\)\. .* -m pip install laspy lazrs"):
        check_format(".laz")
    check_format(".npz")


def test_a_file_that_fails_leaves_the_one_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save_cloud(cloud(), tmp_path / "points.h5")
    before = path.read_bytes()

    def fail(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(h5py.File, "create_dataset", fail)
    with pytest.raises(OSError, match="No space left"):
        save_cloud(cloud(9), path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["points.h5"]
