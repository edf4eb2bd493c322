"""How many rays get a wrong answer: per million, as the audit in double precision counts them."""

from __future__ import annotations

import numpy as np
import perfect_bvh
from makers.zoo import FailureCase
from makers.zoo.case import Rays, world_corners
from oracles.exact_rays import lines_meet, plane_distances
from perfect_bvh._tuning import Traced

from .loss import PER_MILLION, Loss
from .naive import packets, slabs
from .naive.intersection import closest_hits
from .naive.tree import boxes_of
from .naive.watertight import are_hits
from .playing import Moment, play, wrong_answers

RAYS = 1000
OF_EDGES = 2000


def per_million(flags: np.ndarray) -> float:
    return 1e6 * float(np.mean(flags)) if len(flags) else 0.0


def _ours(moment: Moment, rays: Rays) -> np.ndarray:
    hits = moment.scene.cast_rays(*rays)
    return wrong_answers(moment.scene, rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)


def usual_test(case: FailureCase) -> Loss:
    """The usual test on every triangle in turn, no tree; over all states of the case."""
    naive, ours = [], []
    for index, moment in enumerate(play(case.states())):
        rays = case.rays(moment.state, RAYS, index)
        t_hit, rows = closest_hits(world_corners(moment.state), *rays)
        instances = np.where(rows < 0, -1, moment.instance_ids[0][0])
        naive.append(wrong_answers(moment.scene, rays, t_hit, instances, rows))
        ours.append(_ours(moment, rays))
    return Loss(PER_MILLION, *(per_million(np.concatenate(flags)) for flags in (naive, ours)))


def grazed(case: FailureCase) -> Loss:
    """Rays of float32 that meet another triangle than in double, or t off by more than 1e-5; rounding moves either."""
    (moment,) = play(case.states())
    rays = tuple(values.astype(np.float32) for values in case.rays(moment.state, RAYS, 1))
    corners = world_corners(moment.state)
    exact = closest_hits(corners, *rays, epsilon=0.0, dtype=np.float64)
    hits = moment.scene.cast_rays(*rays)
    answers = [closest_hits(corners, *rays), (hits.t_hit, hits.primitive_ids)]
    with np.errstate(invalid="ignore"):  # both miss: inf - inf
        losses = [per_million((rows != exact[1]) | (np.abs(t - exact[0]) > 1e-5 * exact[0])) for t, rows in answers]
    return Loss("unlike double's per million", losses[0], losses[1])


def distances(case: FailureCase) -> Loss:
    """Rays whose t is off by more than 1e-6 of itself, on any of the triangles at an edge."""
    (moment,) = play(case.states())
    rays = case.rays(moment.state, RAYS, 1)
    corners = world_corners(moment.state)
    exact = closest_hits(corners, *rays, epsilon=0.0, dtype=np.float64)[0]
    answers = (closest_hits(corners, *rays)[0], moment.scene.cast_rays(*rays).t_hit)
    return Loss("off by 1e-6 per million", *(per_million(np.abs(t - exact) > 1e-6 * exact) for t in answers))


def leaks(case: FailureCase) -> Loss:
    """Rays from inside a closed surface that meet nothing."""
    (moment,) = play(case.states())
    rays = case.rays(moment.state, OF_EDGES, 1)
    naive = closest_hits(world_corners(moment.state), *rays)[1] < 0
    ours = ~moment.scene.test_occlusions(*rays)
    return Loss("leaks per million", per_million(naive), per_million(ours))


def lost_outlines(case: FailureCase) -> Loss:
    """Rays that hit where exact arithmetic finds no hit, or do not hit where it finds one."""
    (moment,) = play(case.states())
    (part,) = moment.state
    rays = case.rays(moment.state, OF_EDGES, 1)
    mesh = part.positions, part.triangles
    right = (lines_meet(*mesh, *rays) & (plane_distances(*mesh, *rays) > 0.0)).any(axis=1)
    naive = are_hits(world_corners(moment.state), *rays)
    ours = moment.scene.test_occlusions(*rays), moment.scene.cast_rays(*rays).is_hit
    return Loss(
        "lost or made up per million",
        per_million(naive != right),
        per_million(np.any([answer != right for answer in ours], axis=0)),
    )


def other_rounding(case: FailureCase) -> Loss:
    """Rays that meet one triangle by one rounding and another, or nothing, by the other; ours: between all kernels."""
    (moment,) = play(case.states())
    rays = case.rays(moment.state, OF_EDGES, 1)
    plain, fused = (closest_hits(world_corners(moment.state), *rays, fused=how)[1] for how in (False, True))
    answers = []
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        answers.append(moment.scene.cast_rays(*rays).primitive_ids)
    perfect_bvh.set_active_isa(None)
    unlike = np.any([answer != answers[0] for answer in answers], axis=0)
    return Loss("unlike per million", per_million(plain != fused), per_million(unlike))


def usual_slabs(case: FailureCase) -> Loss:
    """Of the rays that hit, those for which the usual slab test misses the box of the hit triangle."""
    (moment,) = play(case.states())
    rays = case.rays(moment.state, RAYS, 1)
    hits = moment.scene.cast_rays(*rays)
    at, boxes = hits.is_hit, boxes_of(world_corners(moment.state))[hits.primitive_ids]
    lost = ~slabs.box_hits(boxes[at, 0], boxes[at, 1], rays[0][at], rays[1][at])
    return Loss(PER_MILLION, per_million(lost), per_million(_ours(moment, rays)))


def poisoned_root(case: FailureCase) -> Loss:
    """Of the rays that hit the valid triangles, those that miss the root of a tree over all triangles."""
    (state,) = case.states()
    (moment,) = play((state,))
    rays = case.rays(state, RAYS, 1)
    at = moment.scene.cast_rays(*rays).is_hit
    corners = world_corners(state).reshape(-1, 3)
    lost = ~slabs.box_hits(corners.min(axis=0), corners.max(axis=0), rays[0][at], rays[1][at])
    return Loss(PER_MILLION, per_million(lost), per_million(_ours(moment, rays)))


def frustum_packets(case: FailureCase) -> Loss:
    """Of the rays that hit, those whose packet never reaches the triangle; ours: traced in packets."""
    (moment,) = play(case.states())
    rays = case.rays(moment.state, 1024, 1)
    hits = Traced(moment.scene, "packets").cast_rays(*rays)
    missed = packets.culled(boxes_of(world_corners(moment.state))[hits.primitive_ids], *rays)
    ours = wrong_answers(moment.scene, rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    return Loss(PER_MILLION, per_million(missed[hits.is_hit]), per_million(ours))


def usual_matrices(case: FailureCase) -> Loss:
    """Of the rays that hit, those whose normal is off by more than a degree, or whose instance has no inverse."""
    (moment,) = play(case.states())
    rays = case.rays(moment.state, RAYS, 1)
    hits = moment.scene.cast_rays(*rays)
    right, usual, singular = (np.empty((RAYS, 3)), np.empty((RAYS, 3)), np.zeros(RAYS, np.bool_))
    for part, ids in zip(moment.state, moment.instance_ids, strict=True):
        for ident, transform, corners in zip(ids.tolist(), part.transforms, part.world_corners(), strict=True):
            at = hits.instance_ids == ident
            rows = hits.primitive_ids[at]
            local = part.positions.astype(np.float64)[part.triangles[rows]]
            right[at] = _normals(corners[rows]) * np.sign(np.linalg.det(transform[:3, :3]) or 1.0)
            usual[at] = _normals(local) @ transform[:3, :3].T
            singular |= at & (np.linalg.matrix_rank(transform[:3, :3]) < 3)
    at = hits.is_hit
    naive = singular | (_cosines(usual, right) < np.cos(np.radians(1.0)))
    ours = np.abs(_cosines(hits.geometric_normals.astype(np.float64), right)) < np.cos(np.radians(1.0))
    return Loss(PER_MILLION, per_million(naive[at]), per_million((ours & at) | _ours(moment, rays)))


def _normals(corners: np.ndarray) -> np.ndarray:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _cosines(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    with np.errstate(all="ignore"):
        return np.nan_to_num(np.sum(a * b, axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)))
