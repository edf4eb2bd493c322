"""The extra work of usual methods: boxes and triangles tested for the same rays, and the growth of trees."""

from __future__ import annotations

from functools import cache

import numpy as np
import perfect_bvh
from makers.zoo import Body, FailureCase, State
from makers.zoo.case import Rays, world_corners
from perfect_bvh import BuildConfig

from .loss import WORK, Loss
from .naive import reinsertion, tree
from .playing import play, wrong_answers

COUNTS = ("nodes_visited", "primitives_tested")
RAYS = 1000
OURS = {
    "auto": BuildConfig(),
    "sweep": BuildConfig(builder="sweep"),
    "spatial": BuildConfig(builder="spatial", duplication_budget=5.0),
    "fast": BuildConfig(builder="fast"),
    "optimized": BuildConfig(optimize=3),
}


def work_of(scene: perfect_bvh.Scene, rays: Rays) -> int:
    """Boxes and triangles that the engine tests for these rays."""
    hits = scene.cast_rays(*rays, fields=COUNTS)
    return int(hits.nodes_visited.sum()) + int(hits.primitives_tested.sum())


def _last_scene(states: tuple[State, ...], build: str | BuildConfig = "auto") -> perfect_bvh.Scene:
    return list(play(states, build))[-1].scene


@cache
def _works(case: FailureCase) -> dict[str, int]:
    states, rays = case.states(), case.rays(case.states()[-1], RAYS, 1)
    configs = {**OURS, "median": BuildConfig(builder="median")}
    return {name: work_of(_last_scene(states, config), rays) for name, config in configs.items()}


def median_splits(case: FailureCase) -> Loss:
    """Relative to the best of all builders; ours: the default builder."""
    return _splits(case, "median")


def object_splits(case: FailureCase) -> Loss:
    """As `median_splits`, with every plane between centroids tried."""
    return _splits(case, "sweep")


def _splits(case: FailureCase, naive: str) -> Loss:
    works = _works(case)
    name = min(works, key=works.__getitem__)
    naive_loss, ours, best = (works[which] / works[name] for which in (naive, "auto", name))
    return Loss(WORK, naive_loss, ours, nothing=1.0, other=None if name == "auto" else (name, best))


def refit_only(case: FailureCase) -> Loss:
    """After the last state, relative to a tree that is built for it; each kind of tree against its own like."""
    states = case.states()
    rays = case.rays(states[-1], RAYS, 1)
    old, new = (tree.boxes_of(world_corners(state)) for state in (states[0], states[-1]))
    fresh, refitted = tree.build(new, tree.by_area), tree.build(old, tree.by_area)
    tree.refit(refitted, new)
    moments = list(play(states))
    t_hit = moments[-1].scene.cast_rays(*rays).t_hit.astype(np.float64)
    naive = tree.count_work(refitted, *rays, t_hit) / tree.count_work(fresh, *rays, t_hit)
    ours = work_of(moments[-1].scene, rays) / work_of(_last_scene(states[-1:]), rays)
    return Loss(WORK, naive, ours, nothing=1.0)


def flat_list(case: FailureCase) -> Loss:
    """Relative to one tree over all triangles of all instances."""
    (state,) = case.states()
    rays = case.rays(state, 300, 1)
    merged = world_corners(state)
    points = merged.reshape(-1, 3).astype(np.float32)
    whole = Body("Whole", points, np.arange(len(points), dtype=np.int32).reshape(-1, 3))
    best = work_of(_last_scene(((whole,),)), rays)
    total, t_max = 0, np.full(len(rays[0]), np.inf, np.float32)
    for part in state:
        for transform in part.transforms:
            alone = _last_scene(((Body("One", part.positions, part.triangles, transform[None]),),))
            hits = alone.cast_rays(*rays, t_max=t_max, fields=("t_hit", *COUNTS))
            total += int(hits.nodes_visited.sum()) + int(hits.primitives_tested.sum())
            t_max = np.minimum(t_max, hits.t_hit)
    return Loss(WORK, total / best, work_of(_last_scene((state,)), rays) / best, nothing=1.0)


def stack_entries(case: FailureCase) -> Loss:
    """Entries past a stack of 64 that a depth-first way down asks for, with large leaves; ours: wrong answers."""
    (state,) = case.states()
    depth = tree.build(tree.boxes_of(world_corners(state)), tree.at_the_middle, leaf_size=64).depth
    return Loss("entries past the 64th", max(0, depth - 64), _wrong(case))


def largest_leaf(case: FailureCase) -> Loss:
    """Triangles that no split parts; ours: triangles past the largest leaf that was allowed."""
    (state,) = case.states()
    boxes = tree.boxes_of(world_corners(state))
    rows = np.arange(len(boxes))
    left, right = tree.at_the_middle(boxes, rows)
    stuck = len(rows) if len(left) == 0 or len(right) == 0 else 0
    leaf = _last_scene((state,)).statistics().meshes[0].max_leaf_size
    return Loss("triangles in one endless node", stuck, max(0, leaf - BuildConfig().max_leaf_size))


def endless_splits(case: FailureCase) -> Loss:
    """Meshes of none to five triangles for which halving until one is left does not end; ours: wrong answers."""
    counts = [len(state[0].triangles) for state in case.states()]
    return Loss("of six meshes never end", sum(not _ends(count) for count in counts), _wrong(case))


def _ends(count: int, steps: int = 64) -> bool:
    """Whether halving `count` until one is left ends."""
    while count != 1 and steps > 0:
        count, steps = max(count // 2, count - count // 2), steps - 1
    return count == 1


def rings(case: FailureCase) -> Loss:
    """Of a million moves of a node to another place in the tree, those that create a cycle; ours: wrong answers."""
    (state,) = case.states()
    plain = tree.build(tree.boxes_of(world_corners(state)), tree.by_area)
    return Loss("rings per million moves", reinsertion.rings_per_million(plain), _wrong(case, OURS["optimized"]))


def _wrong(case: FailureCase, build: str | BuildConfig = "auto") -> float:
    """Wrong answers per million over all the states."""
    wrong = total = 0
    for index, moment in enumerate(play(case.states(), build)):
        rays = case.rays(moment.state, RAYS, index)
        hits = moment.scene.cast_rays(*rays)
        wrong += int(wrong_answers(moment.scene, rays, hits.t_hit, hits.instance_ids, hits.primitive_ids).sum())
        total += RAYS
    return 1e6 * wrong / total
