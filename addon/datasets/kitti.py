"""Frames of a drive as files of the format of KITTI. Does not depend on Blender.

`training` has the layout of KITTI's object detection, `sequences/00` and `poses/00.txt` that of its odometry: the same
points and images once more, as hard links where the file system has them. There is one camera, which is all four of
KITTI's. Lengths are metres; a world unit counts as one.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..labels.labels import Labels, Thing
from ..support.files import make_folder, reachable, replacing
from ..sync.boxes import Boxes

TRAINING = "training"
SEQUENCE = "sequences/00"
POSES = "poses/00.txt"
FRAMES = "ImageSets/trainval.txt"
ENDINGS = {"image_2": ".png", "velodyne": ".bin", "calib": ".txt", "label_2": ".txt"}  # of the files of a frame
SHARED = ("image_2", "velodyne")
JOINED = (POSES, FRAMES, f"{SEQUENCE}/calib.txt", f"{SEQUENCE}/times.txt")
# Visible shares from which an object is fully visible (0), or partly occluded (1); below it is largely occluded (2).
VISIBLE, PARTLY = 0.8, 0.4
NEAR = 1e-3  # metres before the camera, where boxes end that reach behind it
# Rows: KITTI's axes of points (x ahead, y to the left, z up) in a sensor's space, which looks along -Z with +Y up.
VELODYNE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_EDGES = np.array([(a, a | bit) for bit in (1, 2, 4) for a in range(8) if not a & bit])  # of `Boxes.corners`

Doubles = npt.NDArray[np.float64]


def file_of(folder: str, frame: int) -> str:
    """Return the name of a frame's file in one of the folders of `ENDINGS`."""
    return f"{TRAINING}/{folder}/{frame:06d}{ENDINGS[folder]}"


def files_of(frames: Iterable[int]) -> tuple[str, ...]:
    """Return the names of all files of these frames."""
    return tuple(file_of(folder, frame) for frame in frames for folder in ENDINGS)


def write_text(path: Path, lines: Iterable[str]) -> None:
    """Write a text file; an older one is replaced once it is complete. Raises OSError."""
    make_folder(path.parent)
    with replacing(path) as name:
        name.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


def write_points(path: Path, positions: Doubles, intensities: npt.NDArray[np.float32]) -> None:
    """Write (N, 3) positions in KITTI's axes of points, and (N,) intensities. Raises OSError."""
    make_folder(path.parent)
    with replacing(path) as name:
        name.write_bytes(np.column_stack([positions, intensities]).astype("<f4").tobytes())


# Calibration and poses -----------------------------------------------------------------------------------------------


def calibration(intrinsics: Sequence[Sequence[float]], camera_from_points: Doubles) -> list[str]:
    """Make the lines of a frame's calibration. camera_from_points: (4, 4)."""
    identity = np.eye(3, 4)
    matrices = {"R0_rect": np.eye(3), "Tr_velo_to_cam": camera_from_points[:3], "Tr_imu_to_velo": identity}
    return [*_projections(intrinsics), *(f"{name}: {_numbers(matrix)}" for name, matrix in matrices.items())]


def join(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write what all frames share: poses, times and the layout of odometry. Raises OSError.

    Args:
        rows: Facts about each frame, in order: "frame", "seconds", "intrinsics", "world_to_camera" (3, 4) and
            "camera_from_points" (4, 4).
    """
    whole = [np.vstack([row["world_to_camera"], [0.0, 0.0, 0.0, 1.0]]) for row in rows]
    write_text(folder / POSES, [_numbers((whole[0] @ np.linalg.inv(each))[:3]) for each in whole])
    first = np.array(rows[0]["camera_from_points"])
    lines = [*_projections(rows[0]["intrinsics"]), f"Tr: {_numbers(first[:3])}"]
    write_text(folder / SEQUENCE / "calib.txt", lines)
    write_text(folder / SEQUENCE / "times.txt", [f"{row['seconds']:.6e}" for row in rows])
    write_text(folder / FRAMES, [f"{row['frame']:06d}" for row in rows])
    for shared in SHARED:
        links = reachable(folder / SEQUENCE / shared)
        make_folder(links)
        for row in rows:
            path = reachable(folder / file_of(shared, row["frame"]))
            (links / path.name).unlink(missing_ok=True)
            try:
                os.link(path, links / path.name)
            except OSError:  # a file system without hard links
                shutil.copyfile(path, links / path.name)


def _projections(intrinsics: Sequence[Sequence[float]]) -> list[str]:
    return [f"P{number}: {_numbers(np.column_stack([intrinsics, np.zeros(3)]))}" for number in range(4)]


def _numbers(matrix: Doubles) -> str:
    return " ".join(f"{value:.12e}" for value in np.ravel(matrix))


# Boxes ---------------------------------------------------------------------------------------------------------------


def label_lines(labels: Labels) -> list[str]:
    """Make a line for each object instance that the image shows and that has a category, which is not blank.

    The 2D box is around all pixels whose rays hit the object, hidden or not. The 3D box is the smallest one around the
    object's oriented box that is turned about the camera's y axis alone: equal to it if both stand upright. An object's
    front is its side of -Y, as in Blender's front view.
    """
    view = np.array(labels.camera["world_to_camera"])
    intrinsics = np.array(labels.camera["intrinsics"])
    boxes, shares = labels.amodal.boxes().tolist(), labels.visible_shares.tolist()
    lines = []
    for number, thing in enumerate(labels.things):
        kind = "_".join(labels.categories[thing.category].split()) if thing.category >= 0 else ""
        if not kind or not shares[number]:
            continue
        left, top, width, height = boxes[number]
        corners = _corners(thing) @ view[:, :3].T + view[:, 3]
        front = -(view[:, :3] @ thing.box3d["axes"][1])
        side = view[:, :3] @ thing.box3d["axes"][0]
        size, place, turn = _upright(corners, front, side)
        occluded = 0 if shares[number] >= VISIBLE else 1 if shares[number] >= PARTLY else 2
        alpha = (turn - np.arctan2(place[0], place[2]) + np.pi) % (2.0 * np.pi) - np.pi
        numbers = (alpha, left, top, left + width - 1, top + height - 1, *size, *place, turn)
        truncated = _truncation(corners, intrinsics, labels.size)
        lines.append(f"{kind} {truncated:.2f} {occluded} {' '.join(f'{value:.4f}' for value in numbers)}")
    return lines


def _corners(thing: Thing) -> Doubles:
    box = (np.array(thing.box3d[name])[None] for name in ("center", "size", "axes"))
    return Boxes(*box).corners()[0]


def _upright(corners: Doubles, front: Doubles, side: Doubles) -> tuple[Doubles, Doubles, float]:
    """(height, width, length), the middle of the bottom, and the turn about y, of the box around these corners.

    front, side: directions; an object that looks straight up or down is turned by its side.
    """
    if np.hypot(front[0], front[2]) < 1e-6 * np.linalg.norm(front):
        front = np.array([-side[2], 0.0, side[0]])
    turn = float(np.arctan2(-front[2], front[0]))
    axes = np.array([[np.cos(turn), 0.0, -np.sin(turn)], [0.0, 1.0, 0.0], [np.sin(turn), 0.0, np.cos(turn)]])
    local = corners @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    middle = 0.5 * (low + high)
    middle[1] = high[1]  # y points down
    length, height, width = high - low
    return np.array([height, width, length]), middle @ axes, turn


def _truncation(corners: Doubles, intrinsics: Doubles, size: tuple[int, int]) -> float:
    """The share of the rectangle around a box's picture that is outside of the image."""
    ends = corners[_EDGES]
    depths = ends[..., 2]
    ends = ends[(depths > NEAR).any(axis=1)]
    if not len(ends):
        return 1.0
    near = np.argmax(ends[..., 2], axis=1)  # the end that is before the camera ...
    kept, other = ends[np.arange(len(ends)), near], ends[np.arange(len(ends)), 1 - near]
    share = np.clip((kept[:, 2] - NEAR) / np.maximum(kept[:, 2] - other[:, 2], 1e-30), 0.0, 1.0)
    points = np.concatenate([kept, kept + share[:, None] * (other - kept)]) @ intrinsics.T  # ... and where it ends
    pixels = points[:, :2] / points[:, 2:]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    inside = np.minimum(high, np.array(size) - 0.5) - np.maximum(low, -0.5)
    area = float(np.prod(np.maximum(high - low, 1e-30)))
    return float(np.clip(1.0 - np.prod(np.maximum(inside, 0.0)) / area, 0.0, 1.0))
