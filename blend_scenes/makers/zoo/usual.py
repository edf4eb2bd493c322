"""The usual method's picture of a failure case: the picture that its rays would give, from the case's own camera.

Trees are this engine's, built or refitted as the usual method does; answers are those of the plain Python with which
tests/stress counts losses. Cases that fail for other rays than a camera's, or invisibly, have no picture.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from perfect_bvh._tuning import with_policy

from . import Body, FailureCase, State
from .case import finite, world_corners

sys.path.append(str(Path(__file__).resolve().parents[3] / "tests"))

from stress.naive import slabs
from stress.naive.intersection import closest_hits
from stress.naive.tree import boxes_of

Picture = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Asked:
    """The subject of a picture. ours: (H, W, 3) this engine's displayed picture, row 0 on top."""

    case: FailureCase
    states: Sequence[State]  # up to the one that is shown
    camera: perfect_bvh.Camera
    mode: str
    ours: Picture

    @property
    def state(self) -> State:
        """The one that is shown."""
        return finite(self.states[-1])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture."""
        return self.ours.shape[1], self.ours.shape[0]

    def rays(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """One through the middle of each pixel, row by row from the top."""
        (width, height), (left, right, bottom, top) = self.size, self.camera.window
        x = left + (np.arange(width) + 0.5) * (right - left) / width
        y = top - (np.arange(height) + 0.5) * (top - bottom) / height
        plane = np.stack([*np.meshgrid(x, y), np.full((height, width), -1.0)], axis=-1).reshape(-1, 3)
        turn = self.camera.matrix[:3, :3] / np.linalg.norm(self.camera.matrix[:3, :3], axis=0)
        return np.tile(self.camera.matrix[:3, 3], (len(plane), 1)), plane @ turn.T


def usual_picture(asked: Asked) -> Picture | None:
    """The displayed picture, (H, W, 3), row 0 on top; None where the case has no such picture."""
    make = _MAKERS.get(asked.case.name)
    return None if make is None else make(asked)


# Other trees, or other scenes, and this engine's rays ----------------------------------------------------------------


def _scene_of(state: State, builder: Any = "auto", policy: Any = "governed") -> tuple[perfect_bvh.Scene, list[int]]:
    scene, meshes = with_policy(perfect_bvh.Scene(), policy), []
    for part in finite(state):
        build = builder if builder == "auto" else perfect_bvh.BuildConfig(builder=builder)
        meshes.append(scene.add_mesh(part.positions, part.triangles, build=build))
        scene.add_instances([meshes[-1]] * len(part.transforms), part.transforms)
    scene.commit()
    return scene, meshes


def _render(asked: Asked, scene: perfect_bvh.Scene) -> Picture:
    mode: Any = asked.mode.lower()
    found = perfect_bvh.render(scene, asked.camera, mode, asked.size, samples=16)[..., :3]
    return np.clip(np.where(found <= 0.0031308, found * 12.92, 1.055 * found ** (1.0 / 2.4) - 0.055), 0.0, 1.0)


def _built_by(builder: str) -> Callable[[Asked], Picture]:
    return lambda asked: _render(asked, _scene_of(asked.state, builder)[0])


def _refitted(asked: Asked) -> Picture:
    """Built for the first state, and refitted from then on."""
    scene, meshes = _scene_of(asked.states[0], "binned", "refit")
    for state in asked.states[1:]:
        for mesh, part in zip(meshes, finite(state), strict=True):
            scene.update_mesh(mesh, part.positions)
        scene.commit()
    return _render(asked, scene)


def _first_triangles(asked: Asked) -> Picture:
    """The triangles of the first state over the vertices of this one."""
    parts = zip(asked.states[0], asked.state, strict=True)
    state = tuple(Body(now.name, now.positions, first.triangles, now.transforms) for first, now in parts)
    return _render(asked, _scene_of(state)[0])


def _never_deleted(asked: Asked) -> Picture:
    """All that ever was there, where it was last."""
    seen = {part.name: part for state in asked.states for part in state}
    return _render(asked, _scene_of(tuple(seen.values()))[0])


def _half_new(asked: Asked) -> Picture:
    """Half of the bodies in their previous state."""
    before, now = asked.states[-2], asked.states[-1]
    return _render(asked, _scene_of((*now[: len(now) // 2], *before[len(now) // 2 :]))[0])


def _frame_before(asked: Asked) -> Picture:
    return _render(asked, _scene_of(asked.states[-2])[0])


# Other answers -------------------------------------------------------------------------------------------------------


def _without(asked: Asked, is_lost: npt.NDArray[np.bool_], is_hit: npt.NDArray[np.bool_]) -> Picture:
    """This engine's picture without the pixels (H * W,) whose rays are lost."""
    pixels = asked.ours.reshape(-1, 3).copy()
    pixels[is_lost] = pixels[~is_hit][0] if not is_hit.all() else 0.0
    return pixels.reshape(asked.ours.shape)


def _as_colors(normals: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return 0.5 + 0.5 * normals / np.maximum(lengths, 1e-30)


def _usual_test(asked: Asked) -> Picture:
    """Möller and Trumbore's test; where it finds another triangle, the normal of that."""
    corners, rays = world_corners(asked.state), asked.rays()
    with np.errstate(all="ignore"):
        rows = closest_hits(corners, *rays)[1]
    right = _rows_of(asked)
    pixels = _without(asked, rows < 0, right >= 0).reshape(-1, 3)
    other = (rows >= 0) & (rows != right)
    found = corners[rows[other]]
    pixels[other] = _as_colors(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]))
    return pixels.reshape(asked.ours.shape)


def _rows_of(asked: Asked) -> npt.NDArray[np.int32]:
    """(H * W,) of a state of one body: the triangle that each ray meets, -1 for none."""
    return np.asarray(_scene_of(asked.state)[0].cast_rays(*asked.rays()).primitive_ids)


def _usual_slabs(asked: Asked) -> Picture:
    rays, rows = asked.rays(), _rows_of(asked)
    boxes = boxes_of(world_corners(asked.state))[rows]
    return _without(asked, ~slabs.box_hits(boxes[:, 0], boxes[:, 1], *rays), rows >= 0)


def _nothing(asked: Asked) -> Picture:
    rows = _rows_of(asked)
    return _without(asked, rows >= 0, rows >= 0)


def _usual_matrices(asked: Asked) -> Picture:
    """Normals by the matrix itself, and no instances whose matrix has no inverse."""
    scene, _ = _scene_of(asked.state)
    hits = scene.cast_rays(*asked.rays())
    pixels = _without(asked, ~hits.is_hit, hits.is_hit).reshape(-1, 3)
    background = pixels[~hits.is_hit][0]
    instances = [(part, transform) for part in asked.state for transform in part.transforms]
    for number, (part, transform) in enumerate(instances):
        at = hits.instance_ids == number
        local = part.positions.astype(np.float64)[part.triangles[hits.primitive_ids[at]]]
        normals = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0]) @ transform[:3, :3].T
        pixels[at] = background if np.linalg.matrix_rank(transform[:3, :3]) < 3 else _as_colors(normals)
    return pixels.reshape(asked.ours.shape)


_MAKERS: dict[str, Callable[[Asked], Picture]] = {
    **dict.fromkeys(("teapot_in_stadium", "ground_under_gravel", "far_clusters"), _built_by("median")),
    **dict.fromkeys(
        (
            "explosion",
            "shuffle",
            "twist",
            "born_in_a_point",
            "long_refit_chain",
            "skinned_walk",
            "crumpled_cloth",
        ),
        _refitted,
    ),
    "equal_counts": _first_triangles,
    **dict.fromkeys(("grazed_slivers", "extreme_magnitudes", "large_ground", "small_triangles"), _usual_test),
    "flat_boxes": _usual_slabs,
    "non_finite_vertices": _nothing,
    "skewed_matrices": _usual_matrices,
    "deleted_objects": _never_deleted,
    "stopped_halfway": _half_new,
    "one_frame_late": _frame_before,
}
