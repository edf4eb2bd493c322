"""Which meshes the camera rays of an image spend their work on, asked of a part of its pixels. Knows no Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import Appearance, Camera, Scene, Snapshot
    from perfect_bvh.render import Passes, Progress

    from ..live.scene_sync import SceneSync

COST_PASSES = ("instance", "nodes_visited", "primitives_tested")
# Of one pixel in so many, each way: counted rays take longer, and no one waits for shares to a thousandth.
COST_STEP = 4


def trace_costs(
    scene: Scene | Snapshot,
    camera: Camera,
    size: tuple[int, int],
    appearance: Appearance,
    threads: int,
    progress: Progress | None = None,
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
    )


def mesh_costs(sync: SceneSync, costs: Passes) -> dict[int, float]:
    """The share of the work of all these rays that went into those that end on each mesh, by its id."""
    seen: npt.NDArray[np.int32] = costs["instance"].ravel()
    work = (costs["nodes_visited"] + costs["primitives_tested"]).ravel()
    ids, hit = sync.appearance.instances.ids, seen >= 0
    if not hit.any():
        return {}
    by_instance = np.bincount(seen[hit], weights=work[hit], minlength=int(ids.max()) + 1)[ids]
    by_mesh = np.bincount(sync.record.instances.mesh_indices, weights=by_instance)
    total = float(work.sum())
    return {int(sync.mesh_ids[row]): float(by_mesh[row]) / total for row in np.flatnonzero(by_mesh)}
