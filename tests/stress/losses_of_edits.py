"""How many rays are answered from a scene that is no longer there: per million, over all the edits of a case."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import perfect_bvh
from makers.zoo import Body, FailureCase
from makers.zoo.case import Rays
from makers.zoo.shapes import ball

from .loss import PER_MILLION, Loss
from .losses_of_answers import per_million
from .playing import Moment, play, wrong_answers
from .syncing import sync

RAYS = 1000


def _synced(case: FailureCase) -> Iterator[tuple[Moment, Rays]]:
    """Every state but the first, kept in step by sync."""
    for index, (moment, _) in enumerate(sync(case.states())):
        if index:
            yield moment, case.rays(moment.state, RAYS, index)


def _wrong(
    moment: Moment, rays: Rays, t_hit: np.ndarray, instance_ids: np.ndarray, primitive_ids: np.ndarray
) -> np.ndarray:
    return wrong_answers(moment.scene, rays, t_hit, instance_ids, primitive_ids)


def _ours(moment: Moment, rays: Rays) -> np.ndarray:
    hits = moment.scene.cast_rays(*rays)
    return _wrong(moment, rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)


def refit_at_equal_counts(case: FailureCase) -> Loss:
    """New positions under the triangles of the first state."""
    first = case.states()[0][0].triangles
    naive, ours = [], []
    for moment, rays in _synced(case):
        (part,) = moment.state
        (refitted,) = play(((Body(part.name, part.positions, first, part.transforms),),))
        hits = refitted.scene.cast_rays(*rays)
        instances = np.where(hits.is_hit, moment.instance_ids[0][0], -1)
        naive.append(_wrong(moment, rays, hits.t_hit, instances, hits.primitive_ids))
        ours.append(_ours(moment, rays))
    return Loss(PER_MILLION, per_million(np.concatenate(naive)), per_million(np.concatenate(ours)))


def never_deleted(case: FailureCase) -> Loss:
    """Everything that ever existed still exists; its current place is known."""
    seen: dict[str, Body] = {part.name: part for part in case.states()[0]}
    naive, ours = [], []
    for moment, rays in _synced(case):
        seen.update({part.name: part for part in moment.state})
        (all_,) = play((tuple(seen.values()),))
        naive.append(all_.scene.cast_rays(*rays).t_hit != moment.scene.cast_rays(*rays).t_hit)
        ours.append(_ours(moment, rays))
    return Loss(PER_MILLION, per_million(np.concatenate(naive)), per_million(np.concatenate(ours)))


def frame_before(case: FailureCase) -> Loss:
    """The answers of the frame before, taken for this one's."""
    naive, ours = [], []
    before = next(play(case.states())).scene.snapshot()
    for moment, rays in _synced(case):
        late = before.cast_rays(*rays)
        naive.append(
            _wrong(moment, rays, late.t_hit, np.where(late.is_hit, moment.instance_ids[0][0], -1), late.primitive_ids)
        )
        ours.append(_ours(moment, rays))
        before = moment.scene.snapshot()
    return Loss(PER_MILLION, per_million(np.concatenate(naive)), per_million(np.concatenate(ours)))


def stopped_halfway(case: FailureCase) -> Loss:
    """Half of the meshes are new when the build is stopped; ours: the snapshot of before, and the next commit."""
    first, second = case.states()
    rays = case.rays(second, RAYS, 1)
    (whole,) = play((second,))
    half = (*second[: len(second) // 2], *first[len(second) // 2 :])
    (mixed,) = play((half,))
    met = mixed.scene.cast_rays(*rays)
    naive = _wrong(whole, rays, met.t_hit, met.instance_ids, met.primitive_ids)

    (moment,) = play((first,))
    scene = moment.scene
    before, snapshot = scene.cast_rays(*rays), scene.snapshot()
    for mesh, part in zip(scene.statistics().meshes, second, strict=True):
        scene.replace_mesh(mesh.mesh_id, part.positions, part.triangles)
    _commit_and_stop(scene)
    ours = snapshot.cast_rays(*rays).t_hit != before.t_hit
    scene.commit()
    return Loss(PER_MILLION, per_million(naive), per_million(ours | _ours(moment, rays)))


def _commit_and_stop(scene: perfect_bvh.Scene) -> None:
    """Leaves the scene with its edits uncommitted. One of them adds a mesh that takes long to build."""
    heavy = scene.add_mesh(*ball(7), build=perfect_bvh.BuildConfig(builder="spatial", optimize=5))
    instance = scene.add_instance(heavy, mask=0)
    threads = perfect_bvh.thread_count()
    perfect_bvh.set_thread_count(1)  # long on any machine
    try:
        scene.commit(progress=lambda done: False)
    except perfect_bvh.Cancelled:
        scene.remove_instances([instance])
        scene.remove_mesh(heavy)
    else:
        raise RuntimeError("the commit was over before it could be stopped")
    finally:
        perfect_bvh.set_thread_count(threads)


def edited_in_place(case: FailureCase) -> Loss:
    """The second half of a batch met the scene after the edit; ours: a snapshot, asked after the edit."""
    naive, ours = [], []
    moments = play(case.states())
    moment = next(moments)
    for index in range(1, len(case.states())):
        kept = replace(moment), moment.scene.snapshot()
        rays = case.rays(moment.state, RAYS, index)
        right = kept[1].cast_rays(*rays)
        moment = next(moments)
        mixed = right.t_hit.copy()
        mixed[RAYS // 2 :] = moment.scene.cast_rays(*rays).t_hit[RAYS // 2 :]
        naive.append(mixed != right.t_hit)
        ours.append(kept[1].cast_rays(*rays).t_hit != right.t_hit)
    return Loss(PER_MILLION, per_million(np.concatenate(naive)), per_million(np.concatenate(ours)))
