"""Which objects the camera rays of an image spend their work on, asked of a part of its pixels. Knows no Blender."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..statistics.owners import Owners

if TYPE_CHECKING:
    from perfect_bvh import Appearance, Camera, Scene, Shutter, Snapshot
    from perfect_bvh.render import Passes, Progress

    from ..live.scene_sync import SceneSync

COST_PASSES = ("instance", "nodes_visited", "primitives_tested")
# Of one pixel in so many, each way: counted rays take longer, and no one waits for shares to a thousandth.
COST_STEP = 4
WHOLE = (0.0, 1.0, 0.0, 1.0)


def trace_costs(
    scene: Scene | Snapshot,
    camera: Camera,
    size: tuple[int, int],
    appearance: Appearance,
    threads: int,
    progress: Progress | None = None,
    shutter: Shutter | None = None,
) -> Passes:
    """`COST_PASSES` of an image of `size` pixels, smaller by COST_STEP. Arguments and errors: `render_passes`."""
    import perfect_bvh

    width, height = size
    return perfect_bvh.render_passes(
        scene,
        camera,
        mode="cost",
        size=(max(1, width // COST_STEP), max(1, height // COST_STEP)),
        appearance=appearance,
        passes=COST_PASSES,
        progress=progress,
        threads=threads,
        shutter=shutter,
    )


def trace_visits(
    scene: Scene | Snapshot, camera: Camera, size: tuple[int, int], appearance: Appearance, pixel: tuple[int, int]
) -> tuple[int, int] | None:
    """How many nodes the ray through the middle of a pixel visits, and how many triangles it tests.

    pixel: its column, and its row from below, of an image of `size` pixels. None beyond the image or its border.
    Arguments and errors: `render_passes`.
    """
    import perfect_bvh

    (width, height), (column, row) = size, pixel
    x, y = (column + 0.5) / width, (row + 0.5) / height
    first, end, below, above = camera.border
    if not (first <= x < end and below <= y < above and 0 <= column < width and 0 <= row < height):
        return None
    left, right, bottom, top = camera.window
    wide, high = (right - left) / width, (top - bottom) / height
    window = (left + column * wide, left + (column + 1) * wide, bottom + row * high, bottom + (row + 1) * high)
    passes = perfect_bvh.render_passes(
        scene,
        replace(camera, window=window, border=WHOLE),
        mode="cost",
        size=(1, 1),
        appearance=appearance,
        passes=COST_PASSES,
    )
    return int(passes["nodes_visited"][0, 0]), int(passes["primitives_tested"][0, 0])


def owners_of(sync: SceneSync, costs: Passes | None = None) -> Owners:
    """Which objects show which meshes of what a sync holds, with the shares of the work of these rays."""
    record = sync.record
    instances = record.instances
    return Owners(
        mesh_ids=sync.mesh_ids,
        objects=record.objects,
        mesh_rows=instances.mesh_indices,
        object_rows=instances.object_indices,
        parent_rows=instances.parent_indices,
        shares=instance_shares(sync, costs) if costs else None,
    )


def instance_shares(sync: SceneSync, costs: Passes) -> npt.NDArray[np.float64]:
    """(I,): the share of the work of all these rays that went into those that end on each instance of the record."""
    seen: npt.NDArray[np.int32] = costs["instance"].ravel()
    work = (costs["nodes_visited"] + costs["primitives_tested"]).ravel()
    ids, hit = sync.appearance.instances.ids, seen >= 0
    if not hit.any():
        return np.zeros(len(ids))
    by_id = np.bincount(seen[hit], weights=work[hit], minlength=int(ids.max()) + 1)
    return np.asarray(by_id[ids] / float(work.sum()))
