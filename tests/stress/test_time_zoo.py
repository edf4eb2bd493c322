"""Rays meet the zoo's moving meshes where formulas place them, with every instruction set and builder."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest

from stress.losses_of_times import BAD_TIMES, closest, unlike
from stress.time_zoo import TIME_CASES, TimeCase, rays_at

RAYS = 600


@pytest.fixture(autouse=True)
def default_isa():
    yield
    perfect_bvh.set_active_isa(None)


@pytest.mark.parametrize("case", TIME_CASES, ids=lambda case: case.name)
def test_rays_meet_what_moves_where_it_is_at_their_time(case: TimeCase) -> None:
    motion = case.make()
    origins, directions, times = rays_at(motion, RAYS, 7)
    scene = motion.scene()
    corners = np.stack([motion.corners_at(float(time)) for time in times])
    expected = closest(corners, origins, directions)
    assert np.isfinite(expected).mean() > 0.6
    answers = []
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        hits = scene.cast_rays(origins, directions, times=times)
        # Rays may miss a mesh that has shrunk to a point, or that is seen edge-on.
        assert unlike(hits.t_hit.astype(np.float64), expected).mean() < (
            0.21 if case.name == "scale_through_zero" else 0.01
        )
        answers.append((hits.t_hit.tobytes(), hits.primitive_ids.tobytes()))
    assert len(set(answers)) == 1


@pytest.mark.parametrize("case", TIME_CASES, ids=lambda case: case.name)
def test_a_ray_of_no_time_meets_nothing(case: TimeCase) -> None:
    motion = case.make()
    origins, directions, _ = rays_at(motion, RAYS)
    hits = motion.scene().cast_rays(origins, directions, times=np.resize(np.float32(BAD_TIMES), RAYS))
    assert not hits.is_hit.any() and hits.invalid_count == RAYS
