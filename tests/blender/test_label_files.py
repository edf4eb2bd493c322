"""Labels by name in images, and their files: other programs' readers get the values of the arrays."""

from __future__ import annotations

import importlib
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")
OpenEXR = pytest.importorskip("OpenEXR")
Image = pytest.importorskip("PIL.Image")

from blender.command_lines import run  # noqa: E402
from blender.labelled_room import PARTS, make_labelled_room  # noqa: E402
from oracles.png import load_image  # noqa: E402
from perfect_bvh_addon import CameraGrid, CocoFile, Labels, label_image, save_labels, scan  # noqa: E402
from perfect_bvh_addon.labels import files as png  # noqa: E402
from perfect_bvh_addon.labels.files import check_formats, file_names  # noqa: E402
from perfect_bvh_addon.scanning.point_data import colors_of_column  # noqa: E402

SIZE = (200, 20)
NAMES = ("part", "categoryID", "weight", "collection")


@pytest.fixture
def labels(registered: None) -> Labels:
    make_labelled_room()
    return label_image(size=SIZE, layers=2, labels=NAMES, category="part", flow=True)


def to_srgb(linear: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def read_png(path: Path) -> npt.NDArray[np.uint16]:
    """Read (H, W), row 0 on top, with Blender's reader, which is independent of Pillow."""
    image = load_image(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    numbers = pixels.reshape(height, width, 4)[::-1] * 65535.0
    assert np.abs(numbers - np.rint(numbers)).max() < 0.02  # if they had 8 bits they would be multiples of 257
    assert (numbers[..., :3] == numbers[..., :1]).all()
    return np.rint(numbers[..., 0]).astype(np.uint16)


def test_images_and_things_have_labels_as_a_scan_has_them(labels: Labels) -> None:
    cloud = scan(CameraGrid(*SIZE), labels=NAMES)
    hit = labels.thing_ids.ravel() >= 0
    assert np.array_equal(np.flatnonzero(hit), cloud.ray_ids)
    for name in NAMES:
        found, expected = labels.labels[name], cloud.labels[name]
        assert found.table == expected.table or name == "weight"  # its NaN does not equal itself
        is_float = found.values.dtype.kind == "f"
        assert np.array_equal(found.values.ravel()[hit], expected.values, equal_nan=is_float)
        assert {found.table.value_of(value) for value in found.values.ravel()[~hit]} == {None}
        for row, thing in enumerate(labels.things):
            seen = {found.table.value_of(value) for value in found.values[labels.thing_ids == row]}
            assert seen <= {thing.labels[name]}
    by_name = {thing.name: thing for thing in labels.things if thing.name != "Child" or thing.instancer}
    parts = {name: by_name[name].labels["part"] for name in ("Own", "Data", "Inner", "Child", "Painted", "Plain")}
    assert list(parts.values()) == list(PARTS.values())
    assert by_name["Plain"].collections == ("Alpha", "Zulu") and by_name["Inner"].collections == ("Boxes",)
    assert labels.categories == labels.labels["part"].names
    assert np.array_equal(labels.category_ids, labels.labels["part"].values)


def test_materials_that_differ_are_no_label_of_a_thing(registered: None) -> None:
    make_labelled_room()
    data = bpy.data.objects["Painted"].data
    data.materials.append(bpy.data.materials["plain"])
    found = label_image(size=SIZE, labels=("part",))
    (thing,) = (thing for thing in found.things if thing.name == "Painted")
    assert thing.labels == {"part": None}
    seen = found.labels["part"].values[found.thing_ids == found.things.index(thing)]
    assert {found.labels["part"].table.value_of(value) for value in seen} == {"of material"}


def test_categories_are_those_of_the_file_in_every_frame(registered: None) -> None:
    make_labelled_room()
    camera = bpy.context.scene.camera
    tables = []
    for x in (0.0, 12.0):
        camera.location.x, camera.data.ortho_scale = x, 2.0
        bpy.context.view_layer.update()
        found = label_image(size=(20, 10), category="part")
        tables.append(found.categories)
        assert {found.categories[row] for row in np.unique(found.category_ids) if row >= 0} == {PARTS[x]}
    assert tables[0] == tables[1]


# Files ---------------------------------------------------------------------------------------------------------------


def test_png_holds_rows_and_millimetres(labels: Labels, tmp_path: Path) -> None:
    whole = replace(labels, labels={name: labels.labels[name] for name in ("part", "collection")})
    saved = save_labels(whole, tmp_path, "labels_0001", ("png",), frame=1)
    assert saved.warnings == () and saved.paths[-1].name == "labels_0001.json"
    meaning = json.loads(saved.paths[-1].read_text())
    files, colors = meaning["png"]["files"], meaning["png"]["colors"]
    assert sorted(path.name for path in saved.paths[:-1]) == sorted((*files.values(), *colors.values()))
    images = {name: read_png(tmp_path / file) for name, file in files.items()}
    ids = {
        "things": labels.thing_ids,
        "categories": labels.category_ids,
        "materials": labels.material_ids,
        "things_layer_1": labels.layer_ids[0],
        "things_layer_2": labels.layer_ids[1],
        "label_part": labels.labels["part"].values,
        "label_collection": labels.labels["collection"].values,
    }
    for name, values in ids.items():
        assert np.array_equal(images[name].astype(int) - 1, values), name
        found = colors_of_column(values.ravel(), "ids").reshape(*values.shape, 4)[..., :3]
        with Image.open(tmp_path / colors.pop(name)) as shown:
            assert shown.mode == "RGB" and np.abs(np.asarray(shown) - 255.0 * to_srgb(found)).max() <= 0.51, name
    assert colors == {}, "depth is no id"
    for name, depth in (("depth", labels.depth), ("depth_layer_2", labels.layer_depths[1])):
        expected = np.where(depth < 1e9, np.rint(depth * 1000.0), 0.0)
        assert np.array_equal(images[name], expected) and expected.any()
    assert meaning["png"]["depth_scale"] == 0.001 and meaning["png"]["too_far"] == 0 and meaning["frame"] == 1
    assert meaning["png"]["left_out"] == ["positions", "normals", "uvs", "flow", "masks that are hidden"]
    assert [thing["name"] for thing in meaning["things"]] == [thing.name for thing in labels.things]
    assert meaning["things"][0]["area"] == labels.visible.areas[0]
    assert meaning["categories"] == list(labels.categories)


@pytest.mark.parametrize("size", [(1, 1), (1, 70_000), (3, 1), (40, 257)])
def test_png_is_16_bits_of_grey_and_the_same_bytes_again(tmp_path: Path, size: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 65_536, size, np.uint16)
    image[0, -1] = 65_535
    laid_out = {"rows": image, "columns": np.asfortranarray(image), "part": np.repeat(image, 2, 1)[:, ::2]}
    for name, array in laid_out.items():
        png.write_png(tmp_path / name, array)
    content = (tmp_path / "rows").read_bytes()
    assert {path.read_bytes() for path in tmp_path.iterdir()} == {content}
    with Image.open(tmp_path / "rows") as found:
        assert found.mode == "I;16" and np.array_equal(np.asarray(found), image)
    place, kinds = 8, []
    while place < len(content):
        kinds.append(content[place + 4 : place + 8])
        place += 12 + int.from_bytes(content[place : place + 4], "big")
    assert set(kinds) == {b"IHDR", b"IDAT", b"IEND"}  # no time, no gamma, no profile
    assert content[24:26] == bytes([16, 0])
    if size[1] < 65_536:
        assert np.array_equal(read_png(tmp_path / "rows"), image)


def test_png_says_what_it_cannot_hold(labels: Labels, tmp_path: Path) -> None:
    plain = replace(labels, labels={})
    saved = save_labels(plain, tmp_path, "near", ("png",), depth_scale=0.0001)
    assert saved.warnings == ("PNG: depth beyond 6.5535 is written as 0; use a larger depth scale",)
    meaning = json.loads((tmp_path / "near.json").read_text())
    assert meaning["png"]["too_far"] == 2 * (labels.depth < 1e9).sum() + (labels.layer_depths[1] < 1e9).sum()
    assert not read_png(tmp_path / "near_depth.png").any()
    part, many = labels.labels["part"], labels.thing_ids + 65_534
    negative = replace(part, values=part.values - 1)
    for changed, said in (
        (labels, "png: numbers of label 'categoryID' go up to 70,000, and 16 bits hold 65,534: choose exr"),
        (replace(plain, labels={"weight": labels.labels["weight"]}), "png: label 'weight' has fractions"),
        (replace(plain, labels={"part": negative}), "png: label 'part' has the value -2"),
        (replace(plain, thing_ids=many), "png: numbers of things go up to 65,5.., and 16 bits"),
    ):
        with pytest.raises(ValueError, match=said):
            save_labels(changed, tmp_path, "refused", ("npz", "png"))
    assert list(tmp_path.glob("refused*")) == []


def test_exr_holds_every_bit(labels: Labels, tmp_path: Path) -> None:
    large = replace(labels, thing_ids=labels.thing_ids + 70_000 * (labels.thing_ids >= 0))
    save_labels(large, tmp_path, "frame", ("exr",))
    channels = {}
    for name, channel in OpenEXR.File(str(tmp_path / "frame.exr"), separate_channels=True).channels().items():
        channels[name] = channel.pixels
    meaning = json.loads((tmp_path / "frame.json").read_text())["exr"]
    assert meaning["channels"] == {name: str(pixels.dtype) for name, pixels in channels.items()}
    expected: dict[str, Any] = {"Depth.Z": labels.depth, "Depth 2.Z": labels.layer_depths[1]}
    assert labels.flow is not None
    for name, values in (("Normal", labels.normals), ("Position", labels.positions), ("Vector", labels.flow)):
        expected |= {f"{name}.{axis}": values[..., place] for place, axis in enumerate("XYZW"[: values.shape[2]])}
    expected |= {"UV.U": labels.uvs[..., 0], "UV.V": labels.uvs[..., 1]}
    for name, values in expected.items():
        found = channels[f"Labels.{name}"]
        assert found.dtype == np.float32
        assert found.tobytes() == np.ascontiguousarray(values, np.float32).tobytes(), name
    ids = {
        "Thing": large.thing_ids,
        "Category": labels.category_ids,
        "Material": labels.material_ids,
        "Thing 2": labels.layer_ids[1],
        "label part": labels.labels["part"].values,
    }
    for name, values in ids.items():
        found = channels[f"Labels.{name}.X"]
        assert found.dtype == np.uint32 and np.array_equal(found.astype(np.int64) - 1, values), name
    category, weight = (channels[f"Labels.label {name}.X"] for name in ("categoryID", "weight"))
    numbers = labels.labels["categoryID"].values
    assert np.array_equal(category, np.where(numbers == -1, np.nan, numbers), equal_nan=True)
    assert np.array_equal(weight, labels.labels["weight"].values.astype(np.float32), equal_nan=True)
    assert channels["Labels.Thing.X"].max() > 70_000


def test_blender_opens_the_exr_as_layers(labels: Labels, tmp_path: Path) -> None:
    save_labels(labels, tmp_path, "frame", ("exr",))
    image = bpy.data.images.load(str(tmp_path / "frame.exr"))
    assert len(image.pixels) == 0 and image.type == "MULTILAYER"


def test_exr_refuses_what_floats_do_not_hold(labels: Labels, tmp_path: Path) -> None:
    column = labels.labels["categoryID"]
    large = replace(labels, labels={"number": replace(column, values=column.values + (1 << 25))})
    with pytest.raises(ValueError, match=r"exr: label 'number' goes up to 33,.*choose npy or npz"):
        save_labels(large, tmp_path, "frame", ("exr",))
    assert list(tmp_path.iterdir()) == []


def test_a_library_that_is_missing_is_named_before_the_work(
    labels: Labels,
    tmp_path: Path,
    capfd: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kind, library = "exr", "OpenEXR"

    def without(name: str) -> Any:
        raise ImportError(name)

    path, out = tmp_path / "room.blend", tmp_path / "out"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    monkeypatch.setattr(importlib, "import_module", without)
    said = f"{library}. Install them with:"
    for call in (
        lambda: check_formats(("npy", kind)),
        lambda: save_labels(labels, tmp_path, "frame", ("npz", kind)),
    ):
        with pytest.raises(ImportError, match=re.escape(said)):
            call()
    assert run("labels", path, "-o", out, "--format", "npz", kind) == 2
    assert f"--format: {kind.upper()} files need {said}" in capfd.readouterr().err
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_npy_is_a_folder_of_arrays(labels: Labels, tmp_path: Path) -> None:
    save_labels(labels, tmp_path, "frame", ("npy",))
    without_flow = replace(labels, flow=None)
    save_labels(without_flow, tmp_path, "frame", ("npy", "npz"))
    files = json.loads((tmp_path / "frame.json").read_text())["npy"]["files"]
    arrays = without_flow.arrays()
    assert set(files) == set(arrays) and "flow" not in files and {"amodal_pixels", "label_part"} <= set(files)
    assert sorted(path.name for path in (tmp_path / "frame").iterdir()) == sorted(Path(f).name for f in files.values())
    with np.load(tmp_path / "frame.npz") as data:
        for name, array in arrays.items():
            for found in (np.load(tmp_path / files[name]), data[name]):
                assert found.dtype == array.dtype and found.tobytes() == np.ascontiguousarray(array).tobytes(), name
        assert json.loads(str(data["labels"]))["part"]["names"] == list(labels.categories)


@pytest.mark.parametrize("formats", [("npz",), ("npy",), ("png", "exr"), ("exr", "png", "npy", "npz")])
@pytest.mark.parametrize("is_more", [False, True])
def test_names_of_files_are_known_before(
    labels: Labels, tmp_path: Path, formats: tuple[str, ...], is_more: bool
) -> None:
    made, names = labels, ["part", "collection"]
    if is_more:
        made = replace(labels, labels={f"{name}.": labels.labels[name] for name in names})
        expected = file_names("frame", formats, labels=[f"{name}." for name in names], layers=2, flow=True)
    else:
        layers = {"layer_depths": labels.layer_depths[:1], "layer_ids": labels.layer_ids[:1]}
        made = replace(labels, labels={}, flow=None, **layers)
        expected = file_names("frame", formats)
    assert len(set(expected)) == len(expected)
    saved = save_labels(made, tmp_path, "frame", formats)
    found = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file())
    assert sorted(expected) == found == sorted(path.relative_to(tmp_path).as_posix() for path in saved.paths)


def test_coco_has_labels_as_attributes(labels: Labels, tmp_path: Path) -> None:
    coco = CocoFile()
    coco.add(labels, "frame_0001.png")
    content = json.loads(coco.save(tmp_path / "coco.json").read_text())
    rows = {(row["name"], row["instancer"]): row for row in content["annotations"]}
    assert rows["Own", ""]["attributes"] == {
        "part": "own",
        "categoryID": 7,
        "weight": 2.0,
        "collection": "Scene Collection",
    }
    assert rows["Plain", ""]["collections"] == ["Alpha", "Zulu"]
    assert rows["Plain", ""]["attributes"]["part"] is None
    names = {category["name"]: category["id"] for category in content["categories"]}
    assert list(names) == [*labels.categories, "none"]
    assert all(names[name] == row + 1 for row, name in enumerate(labels.categories))


# The command line ----------------------------------------------------------------------------------------------------


def test_the_command_writes_all_formats(labels: Labels, tmp_path: Path, capfd: Any) -> None:
    path, out = tmp_path / "room.blend", tmp_path / "out"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    asked = ("labels", path, "--size", "200x20", "-q")
    formats = ("--format", "npz", "npy", "png", "exr", "--labels", "part", "collection", "--depth-scale", 0.01)
    assert run(*asked, "-o", out, *formats) == 0
    names = {entry.name for entry in out.iterdir()}
    stem = "labels_0001"
    assert {f"{stem}.npz", f"{stem}.exr", f"{stem}.json", stem, f"{stem}_label_part.png"} <= names
    assert {path for path in names if path.startswith(".")} == set()
    with np.load(out / f"{stem}.npz") as data:
        depth = np.where(data["depth"] < 1e9, np.rint(data["depth"] * 100.0), 0.0)
        assert np.array_equal(read_png(out / f"{stem}_depth.png"), depth)
        assert np.array_equal(read_png(out / f"{stem}_label_part.png").astype(int) - 1, data["label_part"])
    damaged, whole = out / f"{stem}_things.png", out / f"{stem}.exr"
    colors = out / f"{stem}_things.colors.png"
    content, before, shown = damaged.read_bytes(), whole.stat().st_mtime_ns, colors.read_bytes()
    again = ("--format", "exr", "png", "npz", "npy", "exr", *formats[5:])
    assert run(*asked, "-o", out, *again, "--resume") == 0
    assert whole.stat().st_mtime_ns == before
    damaged.write_bytes(content[:-20])
    (out / stem / "uvs.npy").unlink()
    colors.unlink()
    assert run(*asked, "-o", out, *formats, "--resume") == 0
    assert damaged.read_bytes() == content and colors.read_bytes() == shown and (out / stem / "uvs.npy").is_file()
    assert run(*asked, "-o", out, "--format", "exr") == 2
    assert "has chunks of another set of labels" in capfd.readouterr().err
    for more, said in (
        (("--format", "pgn"), "--format: formats must be some of npz, npy, png, exr, got 'pgn' .is it 'png'"),
        (("--format", "png", "--labels", "a.b", "a_b"), "labels 'a.b' and 'a_b' would both be files"),
        (("--labels", "prat"), "frame 1: label_image: .*is it 'part'"),
        (("--category", "prat"), "frame 1: label_image: .*is it 'part'"),
        (("--format", "png", "--labels", "weight"), "frame 1: png: label 'weight' has fractions"),
        (("--depth-scale", 0), "must be above 0"),
    ):
        assert run(*asked, "-o", tmp_path / "other", *more) == 2
        assert re.search(said, capfd.readouterr().err), more


def test_resuming_sweeps_the_folder_of_a_frame_and_keeps_what_is_the_users(labels: Labels, tmp_path: Path) -> None:
    path, out = tmp_path / "room.blend", tmp_path / "out"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    asked = ("labels", path, "--size", "200x20", "-q", "-o", out, "--no-coco", "--format", "npy")
    assert run(*asked) == 0
    folder = out / "labels_0001"
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    users = {"mine.npy": b"1", "notes.txt": b"2", ".mine.01234567.npy": b"3", ".depth.npy": b"4"}
    for name, content in users.items():
        (folder / name).write_bytes(content)
    for name in (".depth.0a1b2c3d.npy", ".visible_splits.0a1b2c3d.npy", ".0a1b2c3d"):
        (folder / name).write_bytes(b"half")
    for damaged in (None, "uvs.npy"):  # kept, then written again
        if damaged is not None:
            (folder / damaged).write_bytes(b"")
        assert run(*asked, "--resume") == 0
        assert {file.name: file.read_bytes() for file in folder.iterdir()} == before | users
