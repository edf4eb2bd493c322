"""Judges the engine's hits at pixels of a synced scene in double precision: right, ambiguous, or wrong.

Where two triangles meet, or lie upon one another, a renderer's rounding decides which one a pixel shows. A renderer
with kernels for several processors rounds differently on each. So a pixel that differs proves nothing by itself.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from oracles.brute_force import Verdict, WorldTriangles, judge
from perfect_bvh import Hits
from perfect_bvh_addon import SceneSync


def world_triangles(sync: SceneSync) -> WorldTriangles:
    """Return every triangle of the record in world space, with the ids that hits of the synced scene use."""
    instances = sync.record.instances
    parts = []
    for row, mesh_index in enumerate(instances.mesh_indices):
        mesh = sync.record.meshes[mesh_index]
        instance_id, mask = int(sync.appearance.instances.ids[row]), int(instances.masks[row])
        parts.append((instance_id, mesh.positions, mesh.triangles, instances.transforms[row], mask))
    return WorldTriangles.of(parts)


def rays_through(sync: SceneSync, pixels: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return origins and directions, (N, 3) each, of the camera's rays through pixel centres. pixels: (N, 2), x, y."""
    camera, (width, height) = sync.camera, sync.size
    left, right, bottom, top = camera.window
    places = np.array(pixels, np.float64).reshape(-1, 2) + 0.5
    on_plane = np.stack([left + places[:, 0] / width * (right - left), top - places[:, 1] / height * (top - bottom)], 1)
    local_origins, local_directions = np.zeros((len(places), 3)), np.insert(on_plane, 2, -1.0, axis=1)
    if camera.projection == "orthographic":
        local_origins = np.insert(on_plane, 2, 0.0, axis=1)
        local_directions = np.broadcast_to([0.0, 0.0, -1.0], local_origins.shape)
    elif camera.projection == "equirectangular":
        (longitude, latitude), flat = on_plane.T, np.cos(on_plane[:, 1])
        local_directions = np.stack([flat * np.sin(longitude), np.sin(latitude), -flat * np.cos(longitude)], axis=1)
    rotation = camera.matrix[:3, :3].T
    return local_origins @ rotation + camera.matrix[:3, 3], local_directions @ rotation


def cast_through(sync: SceneSync, pixels: npt.ArrayLike, audit: float = 0.0) -> Hits:
    """Cast rays through the centres of pixels: (N, 2), x and y. audit: as in `Scene.cast_rays`."""
    return sync.scene.cast_rays(*rays_through(sync, pixels), **_limits(sync), audit=audit)


def judge_pixels(sync: SceneSync, pixels: npt.ArrayLike, hits: Hits) -> Verdict:
    """Judge one hit for each of the pixels: (N, 2), x and y."""
    rays = rays_through(sync, pixels)
    return judge(world_triangles(sync), *rays, hits.t_hit, hits.instance_ids, hits.primitive_ids, **_limits(sync))


def _limits(sync: SceneSync) -> dict[str, float]:
    camera = sync.camera
    return {"t_min": camera.clip_start, "t_max": camera.clip_end, "mask": sync.appearance.camera_mask}
