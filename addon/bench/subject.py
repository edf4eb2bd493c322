"""What is measured: a scene as plain records, the rays that its camera would cast, and its frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from perfect_bvh import BuildConfig

from ..scanning.patterns import CameraGrid, View
from ..sync import mesh_edits
from ..sync.records import CameraRecord, SceneRecord

Float64Array = npt.NDArray[np.float64]
PIXELS = (400, 225)  # of the picture whose rays are cast


@dataclass(frozen=True, slots=True)
class Subject:
    """record: the frame to measure. frames: of the animation; read: one of them, after which Blender stands at it."""

    name: str
    record: SceneRecord
    frames: Sequence[int] = ()
    read: Callable[[int], SceneRecord] | None = None

    @property
    def triangle_count(self) -> int:
        """Of the distinct meshes."""
        return sum(len(mesh.triangles) for mesh in self.record.meshes)


def make_scene(record: SceneRecord, config: BuildConfig | None = None) -> perfect_bvh.Scene:
    """All meshes and instances, not committed. config: of every mesh; None: as the planner wants."""
    scene = perfect_bvh.Scene()
    build: Any = "auto" if config is None else config
    meshes = np.array([mesh_edits.add(scene, mesh, build=build) for mesh in record.meshes], np.int32)
    instances = record.instances
    scene.add_instances(meshes[instances.mesh_indices], instances.transforms)
    return scene


def bounced_rays(record: SceneRecord, scene: perfect_bvh.Scene) -> tuple[Float64Array, Float64Array]:
    """Origins and directions (R, 3): from what the camera sees on into a random direction, as light goes.

    Without a camera, or where it sees nothing: from all around towards random places of the scene.
    """
    random = np.random.default_rng(5)
    if record.camera is not None:
        origins, directions, t_min, t_max = _camera_rays(record.camera)
        fields = ("t_hit", "positions", "geometric_normals")
        hits = scene.cast_rays(origins, directions, t_min=t_min, t_max=t_max, fields=fields)
        rows = np.isfinite(hits.t_hit)
        if rows.any():
            normals = hits.geometric_normals[rows].astype(np.float64)
            normals *= np.where(np.einsum("ij,ij->i", normals, directions[rows]) > 0.0, -1.0, 1.0)[:, None]
            starts = hits.positions[rows].astype(np.float64)
            reach = float(np.abs(starts).max() + hits.t_hit[rows].max())
            bounced = _unit(random.normal(size=normals.shape)) + 1.0001 * normals
            return starts + 1e-5 * reach * normals, _unit(bounced)
    return rays_from_around(record, random, PIXELS[0] * PIXELS[1])


def _camera_rays(camera: CameraRecord) -> tuple[Float64Array, Float64Array, float, float]:
    view = View(camera.window, camera.projection, camera.clip_start, camera.clip_end)
    rays = CameraGrid(*PIXELS).cast(0.0, 1.0, view)
    matrix = np.asarray(camera.matrix, np.float64)
    directions = rays.directions @ matrix[:3, :3].T
    return rays.origins @ matrix[:3, :3].T + matrix[:3, 3], directions, rays.t_min, rays.t_max


def rays_from_around(record: SceneRecord, random: np.random.Generator, count: int) -> tuple[Float64Array, Float64Array]:
    """Origins and directions (count, 3): from all around towards random places in the scene's box."""
    transforms = record.instances.transforms.astype(np.float64)
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for row, transform in zip(record.instances.mesh_indices, transforms, strict=True):
        positions = record.meshes[row].positions
        corners = np.stack([positions.min(axis=0), positions.max(axis=0)]).astype(np.float64)
        middle = transform[:, :3] @ corners.mean(axis=0) + transform[:, 3]
        half = np.abs(transform[:, :3]) @ (np.ptp(corners, axis=0) / 2)
        lower, upper = np.minimum(lower, middle - half), np.maximum(upper, middle + half)
    origins = (lower + upper) / 2 + _unit(random.normal(size=(count, 3))) * np.linalg.norm(upper - lower)
    return origins, random.uniform(lower, upper, (count, 3)) - origins


def _unit(vectors: Float64Array) -> Float64Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
