"""Labelled images as a data set in the format of BOP: poses, masks, depths and models. Does not depend on Blender.

The benchmark for 6D object pose estimation (Hodan et al. 2018) keeps images of rigid objects: for each object that an
image shows its model, its pose in the camera, and its masks. Lengths are millimetres; a world unit counts as a metre.

An image is a row, a line of JSON, as for COCO. Models are numbered once all rows are together: equal meshes with equal
stretch are one model, in any frame and any chunk of frames. Matrices are float32, so the stretch of a turning object
differs a little from frame to frame.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..support.files import make_folder, replacing, write_arrays
from .files import grey_depth, too_far_warning, write_png
from .labels import Labels, run_lengths

if TYPE_CHECKING:
    from ..sync.records import MeshRecord, SceneRecord

FORMAT = "bop"
SCENE = f"{FORMAT}/train/000001"
JOINED = tuple(f"{SCENE}/scene_{what}.json" for what in ("gt", "gt_info", "camera"))
MILLIMETRES = 1000.0
NO_BOX = [-1, -1, -1, -1]
MOST_OFF = 1e-5  # how far equal stretches differ, as a share of the largest number in them
_DIRECTIONS = 2000  # along which the ends of a model are looked for

Row = dict[str, Any]
Doubles = npt.NDArray[np.float64]
Kinds = dict[str, list[tuple[int, Doubles]]]  # of each mesh, its models: numbers and stretches


def image_name(folder: str, frame: int) -> str:
    """Return the name of a frame's file in the folder `rgb` or `depth`."""
    return f"{SCENE}/{folder}/{frame:06d}.png"


class Models:
    """The meshes of some images, by a digest of each: vertices and triangles."""

    def __init__(self) -> None:
        self.arrays: dict[str, npt.NDArray[Any]] = {}
        self._known: dict[int, tuple[str, MeshRecord]] = {}  # the mesh: so that its id stays its own

    def add(self, mesh: MeshRecord) -> str:
        """Add a mesh, and return its digest."""
        if id(mesh) not in self._known:
            digest = hashlib.sha256(mesh.positions.tobytes() + mesh.triangles.tobytes()).hexdigest()[:16]
            self.arrays[f"{digest}_vertices"], self.arrays[f"{digest}_triangles"] = mesh.positions, mesh.triangles
            self._known[id(mesh)] = digest, mesh
        return self._known[id(mesh)][0]

    def save(self, path: Path) -> None:
        """Write them all as .npz. Raises OSError."""
        with replacing(path) as name:
            write_arrays(name, self.arrays, is_compressed=True)


def image_row(
    labels: Labels, record: SceneRecord, rows: npt.NDArray[np.int32], frame: int, depth_scale: float, models: Models
) -> tuple[Row, npt.NDArray[np.uint16], list[str]]:
    """Make the row of an image, its depth, and sentences about the parts that are left out.

    Args:
        record: The record that was labelled.
        rows: The object instances' rows among its instances.
        depth_scale: World units a step of depth.
        models: Receives the models of the object instances.

    Raises:
        ValueError: Without a perspective camera.
    """
    if "intrinsics" not in labels.camera:
        raise ValueError(f"bop: the camera must be a perspective one, not {labels.camera['projection']}")
    view = np.array(labels.camera["world_to_camera"])
    depth, too_far = grey_depth(labels.depth, depth_scale)
    visible, amodal = run_lengths(labels.visible), run_lengths(labels.amodal)
    masks = labels.visible, labels.amodal
    boxes = [np.where(mask.areas[:, None] > 0, mask.boxes(), NO_BOX).tolist() for mask in masks]
    things: list[Row] = []
    left_out = [too_far_warning("BOP", depth_scale)] if too_far else []
    for number, thing in enumerate(labels.things):
        mesh = record.meshes[record.instances.mesh_indices[rows[number]]]
        if mesh.kind != "triangles":
            left_out.append(f"BOP: {thing.name} has no triangles and is left out")
            continue
        transform = record.instances.transforms[rows[number]].astype(np.float64)
        turn, stretch = _parted(transform[:, :3])
        pixels = labels.amodal.pixels_of(number)
        things.append(
            {
                "model": models.add(mesh),
                "stretch": stretch.tolist(),
                "R": (view[:, :3] @ turn).ravel().tolist(),
                "t": ((view[:, :3] @ transform[:, 3] + view[:, 3]) * MILLIMETRES).tolist(),
                "visible": visible[number]["counts"],
                "amodal": amodal[number]["counts"],
                "bbox_visib": boxes[0][number],
                "bbox_obj": boxes[1][number],
                "px_count_visib": int(labels.visible.areas[number]),
                "px_count_all": len(pixels),
                "px_count_valid": int(np.count_nonzero(depth.ravel()[pixels])),
            }
        )
    camera = {
        "cam_K": np.ravel(labels.camera["intrinsics"]).tolist(),
        "depth_scale": depth_scale * MILLIMETRES,
        "cam_R_w2c": view[:, :3].ravel().tolist(),
        "cam_t_w2c": (view[:, 3] * MILLIMETRES).tolist(),
    }
    return {"frame": frame, "size": list(labels.size), "camera": camera, "things": things}, depth, left_out


def _parted(linear: Doubles) -> tuple[Doubles, Doubles]:
    """A rotation and the stretch before it, which begins with a mirrored object's reflection, along its x."""
    mirror = np.diag([-1.0 if np.linalg.det(linear) < 0.0 else 1.0, 1.0, 1.0])
    left, _, right = np.linalg.svd(linear @ mirror)
    turn = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return turn, turn.T @ linear


def save_depth(path: Path, depth: npt.NDArray[np.uint16]) -> None:
    """Write the depth of an image. Raises OSError."""
    make_folder(path.parent)
    with replacing(path) as name:
        write_png(name, depth)


def join_rows(rows: Callable[[], Iterable[Row]], models: Iterable[Path], folder: Path) -> None:
    """Write the data that all images share: poses, cameras, masks and models.

    Args:
        rows: Gives all rows, in order, each time it is called.
        models: The files of `Models.save`.
        folder: Of the data set.

    Raises:
        OSError.
    """
    scene, model_folder = folder / SCENE, folder / FORMAT / "models"
    for each in (scene / "mask", scene / "mask_visib", model_folder):
        make_folder(each)
    kinds: Kinds = {}
    numbers = count(1)
    poses, facts, cameras = dict[str, list[Row]](), dict[str, list[Row]](), dict[str, Row]()
    for row in rows():
        image = str(row["frame"])
        cameras[image] = row["camera"]
        poses[image], facts[image] = [], []
        for place, thing in enumerate(row["things"]):
            number = _number_of(kinds.setdefault(thing["model"], []), np.array(thing["stretch"]), numbers)
            poses[image].append({"cam_R_m2c": thing["R"], "cam_t_m2c": thing["t"], "obj_id": number})
            counts = {name: thing[name] for name in ("bbox_obj", "bbox_visib", "px_count_all", "px_count_valid")}
            seen = thing["px_count_visib"]
            facts[image].append(counts | {"px_count_visib": seen, "visib_fract": seen / max(counts["px_count_all"], 1)})
            for mask, part in (("mask", "amodal"), ("mask_visib", "visible")):
                _save_mask(scene / mask / f"{row['frame']:06d}_{place:06d}.png", thing[part], row["size"])
    for name, content in zip(JOINED, (poses, facts, cameras), strict=True):
        _save_json(folder / name, content)
    _save_models(kinds, models, model_folder)


def _number_of(known: list[tuple[int, Doubles]], stretch: Doubles, numbers: Iterator[int]) -> int:
    """The number of a model. known: of its mesh; a new one is added, with the next of the numbers."""
    if known:
        off = np.abs(np.array([each for _, each in known]) - stretch).max(axis=(1, 2))
        if off.min() <= MOST_OFF * np.abs(stretch).max():
            return known[int(np.argmin(off))][0]
    known.append((next(numbers), stretch))
    return known[-1][0]


def _save_mask(path: Path, counts: list[int], size: list[int]) -> None:
    width, height = size
    columns = np.repeat(np.arange(len(counts)) % 2, counts).reshape(width, height)
    with replacing(path) as name:
        write_png(name, (columns.T * 255).astype(np.uint8))


def _save_models(kinds: Kinds, files: Iterable[Path], folder: Path) -> None:
    facts: dict[str, Any] = {}
    for path in files:
        with np.load(path) as arrays:
            for digest in {name.partition("_")[0] for name in arrays.files} & kinds.keys():
                vertices, triangles = arrays[f"{digest}_vertices"], arrays[f"{digest}_triangles"]
                for number, stretch in kinds.pop(digest):
                    facts[str(number)] = _save_model(folder, number, vertices, triangles, stretch)
    _save_json(folder / "models_info.json", {number: facts[number] for number in sorted(facts, key=int)})


def _save_model(
    folder: Path, number: int, positions: Doubles, triangles: npt.NDArray[np.int32], stretch: Doubles
) -> Row:
    """Write a model in millimetres, and return the facts about it. positions: unstretched."""
    used, corners = np.unique(triangles, return_inverse=True)
    corners = corners.reshape(-1, 3)
    if np.linalg.det(stretch) < 0.0:
        corners = corners[:, ::-1]  # mirrored: so that the outside remains outside
    vertices = (positions[used] @ stretch.T * MILLIMETRES).astype(np.float32)
    _save_ply(folder / f"obj_{number:06d}.ply", vertices, corners)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    sizes = {f"min_{axis}": float(low[i]) for i, axis in enumerate("xyz")}
    sizes |= {f"size_{axis}": float(high[i] - low[i]) for i, axis in enumerate("xyz")}
    return {"diameter": _diameter(vertices.astype(np.float64))} | sizes


def _diameter(vertices: Doubles) -> float:
    """The distance of the two vertices that are farthest apart; up to 0.1 % less if there are more than 2,000."""
    ends = vertices
    if len(vertices) > _DIRECTIONS:
        heights = 1.0 - (2.0 * np.arange(_DIRECTIONS) + 1.0) / _DIRECTIONS
        turns = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(_DIRECTIONS)
        radii = np.sqrt(1.0 - heights**2)
        directions = np.stack([radii * np.cos(turns), radii * np.sin(turns), heights], axis=-1)
        parts = np.array_split(directions, _DIRECTIONS // 50)
        ends = vertices[np.unique(np.concatenate([np.argmax(vertices @ part.T, axis=0) for part in parts]))]
    return float(max(np.linalg.norm(ends - end, axis=1).max() for end in ends))


def _save_ply(path: Path, vertices: npt.NDArray[np.float32], triangles: npt.NDArray[np.integer[Any]]) -> None:
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [*(f"property float {axis}" for axis in "xyz"), f"element face {len(triangles)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    with replacing(path) as name, name.open("wb") as file:
        file.write("\n".join(header).encode() + vertices.astype("<f4").tobytes() + faces.tobytes())


def _save_json(path: Path, content: dict[str, Any]) -> None:
    with replacing(path) as name:
        lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in content.items())
        name.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
