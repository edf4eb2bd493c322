"""Curves and points that are hard: the round oracle's answers on every builder and instruction set, moved or not."""

from __future__ import annotations

from collections.abc import Iterator

import perfect_bvh
import pytest
from benchmarks.generated_curves import BenchBalls
from oracles.round_judge import judge
from perfect_bvh._tuning import Traced
from perfect_bvh.build_config import BUILDERS

from stress.losses_of_rounds import world_of
from stress.round_zoo import ROUND_CASES, RoundCase, cast_in_float, lost, rays_at

ANSWER = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs", "geometric_normals")
STRATEGIES = ("packets", "stream", "single")
RAYS = 300
every_case = pytest.mark.parametrize("case", ROUND_CASES, ids=lambda case: case.name)


@pytest.fixture(autouse=True)
def default_isa() -> Iterator[None]:
    yield
    perfect_bvh.set_active_isa(None)


def play(case: RoundCase, builder: str = "auto") -> Iterator[tuple[perfect_bvh.Scene, BenchBalls]]:
    """One scene; later states move its meshes."""
    scene, mesh = perfect_bvh.Scene(), -1
    build = "auto" if builder == "auto" else perfect_bvh.BuildConfig(builder=builder)
    for balls in case.states():
        if mesh < 0 and balls.offsets is None:
            mesh = scene.add_points(balls.points, balls.radii, build=build, usage="deforming")
        elif mesh < 0:
            mesh = scene.add_curves(balls.points, balls.radii, balls.offsets, build=build, usage="deforming")
        elif balls.offsets is None:
            scene.update_points(mesh, balls.points)
        else:
            scene.update_curves(mesh, balls.points)
        if scene.instance_count == 0:
            scene.add_instance(mesh)
        scene.commit()
        yield scene, balls


@every_case
def test_answers_are_the_oracles_on_every_instruction_set(case: RoundCase) -> None:
    for index, (scene, balls) in enumerate(play(case)):
        rays = rays_at(balls, RAYS, index)
        usual = scene.cast_rays(*rays, fields=ANSWER)
        verdict = judge(world_of(balls), *rays, usual.t_hit, usual.instance_ids, usual.primitive_ids)
        assert not verdict.wrong.any() and verdict.hit.sum() > RAYS // 3, str(verdict)
        for isa in perfect_bvh.available_isas():
            perfect_bvh.set_active_isa(isa)
            for strategy in STRATEGIES:
                hits = Traced(scene, strategy).cast_rays(*rays, fields=ANSWER)
                for field in ANSWER:
                    assert getattr(hits, field).tobytes() == getattr(usual, field).tobytes(), (isa, strategy, field)
        perfect_bvh.set_active_isa(None)


@every_case
def test_answers_are_the_same_with_every_builder(case: RoundCase) -> None:
    plays = [play(case, builder) for builder in BUILDERS]
    for index, (scene, balls) in enumerate(play(case)):
        rays = rays_at(balls, RAYS, 100 + index)
        expected = scene.cast_rays(*rays, fields=ANSWER)
        for builder, moments in zip(BUILDERS, plays, strict=True):
            hits = next(moments)[0].cast_rays(*rays, fields=ANSWER)
            for field in ANSWER:
                assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), (builder, field)


@every_case
def test_a_usual_test_in_float_loses_where_ours_does_not(case: RoundCase) -> None:
    balls = case.states()[-1]
    rays = rays_at(balls, RAYS, 7)
    hits = [scene.cast_rays(*rays) for scene, _ in play(case)][-1]
    assert not judge(world_of(balls), *rays, hits.t_hit, hits.instance_ids, hits.primitive_ids).wrong.any()
    t_hit, _ = cast_in_float(balls, rays)
    assert (lost(t_hit, hits.t_hit).sum() > RAYS // 20) == case.loses_in_float
