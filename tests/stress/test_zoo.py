"""Every failure case, on every builder, instruction set and way of tracing: the oracle's answers, and the same bits."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from makers.zoo import CASES, FailureCase, find_case
from makers.zoo.case import world_corners
from perfect_bvh._tuning import STRATEGIES, Traced
from perfect_bvh.build_config import BUILDERS

from stress.playing import ANSWER, bits, play, verdict_on
from stress.syncing import sync

ISAS = perfect_bvh.available_isas()
RAYS = 300
# Rays times triangles for which the oracle takes a fraction of a second.
ORACLE_PAIRS = 100_000
WAYS = {
    # The others are compared with the first.
    **{builder: perfect_bvh.BuildConfig(builder=builder) for builder in BUILDERS[1:]},
    "optimized": perfect_bvh.BuildConfig(builder="median", optimize=3),
}

every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


@pytest.fixture(autouse=True)
def default_isa():
    yield
    perfect_bvh.set_active_isa(None)


@every_case
def test_answers_are_the_oracles_on_every_instruction_set(case: FailureCase) -> None:
    for index, moment in enumerate(play(case.states())):
        count = min(RAYS, ORACLE_PAIRS // max(1, len(world_corners(moment.state))))
        rays = case.rays(moment.state, count, index)
        usual = moment.scene.cast_rays(*rays, fields=ANSWER)
        verdict = verdict_on(moment, rays, usual)
        assert not verdict.wrong.any(), f"state {index}: {verdict}"
        for isa in ISAS:
            perfect_bvh.set_active_isa(isa)
            for strategy in STRATEGIES:
                hits = Traced(moment.scene, strategy).cast_rays(*rays, fields=ANSWER)
                assert bits(hits) == bits(usual), (index, isa, strategy)
                assert np.array_equal(Traced(moment.scene, strategy).test_occlusions(*rays), usual.is_hit)
            counts = moment.scene.count_intersections(*rays)
            assert np.array_equal(counts > 0, usual.is_hit), (index, isa)
        perfect_bvh.set_active_isa(None)


@every_case
def test_answers_are_the_same_with_every_builder(case: FailureCase) -> None:
    plays = {name: play(case.states(), config) for name, config in WAYS.items()}
    for index, usual in enumerate(play(case.states())):
        rays = case.rays(usual.state, RAYS, 100 + index)
        expected = usual.scene.cast_rays(*rays, fields=ANSWER, audit=1.0)
        assert expected.audit.wrong_rows.size == 0, f"state {index}: {expected.audit}"
        for number, (name, moments) in enumerate(plays.items()):
            scene = next(moments).scene
            for turn, isa in enumerate(ISAS):
                perfect_bvh.set_active_isa(isa)
                strategy = STRATEGIES[(number + turn + index) % len(STRATEGIES)]
                hits = Traced(scene, strategy).cast_rays(*rays, fields=ANSWER)
                assert bits(hits) == bits(expected), (index, name, isa, strategy)
        perfect_bvh.set_active_isa(None)


@every_case
def test_answers_are_right_after_every_sync(case: FailureCase) -> None:
    """The states as Blender would bring them: sync has to find the meshes to refit, replace, move or remove."""
    for index, (moment, _) in enumerate(sync(case.states())):
        rays = case.rays(moment.state, RAYS, 200 + index)
        hits = moment.scene.cast_rays(*rays, fields=ANSWER, audit=1.0)
        assert hits.audit.wrong_rows.size == 0, f"state {index}: {hits.audit}"


def test_cases_are_always_the_same_and_have_names_of_their_own() -> None:
    assert len({case.name for case in CASES}) == len({case.title for case in CASES}) == len(CASES)
    for case in CASES:
        assert find_case(case.name) is case
        first, second = (list(map(world_corners, case.states())) for _ in range(2))
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, second, strict=True)), case.name
    with pytest.raises(ValueError, match="teapot_in_stadium"):
        find_case("teapot")


def test_a_mesh_with_vertices_that_are_no_numbers_is_refused_by_name() -> None:
    ((part,),) = find_case("non_finite_vertices").states()
    with pytest.raises(ValueError, match=r"add_mesh: positions.*finite"):
        perfect_bvh.Scene().add_mesh(part.positions, part.triangles)
