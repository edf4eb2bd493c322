"""Every instruction set gives the same bits."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes


@pytest.fixture(autouse=True)
def default_isa():
    yield
    perfect_bvh.set_active_isa(None)


def test_names():
    assert perfect_bvh.available_isas()[0] == "scalar"
    assert perfect_bvh.active_isa() in perfect_bvh.available_isas()
    with pytest.raises(ValueError, match=r"set_active_isa: .*sse9"):
        perfect_bvh.set_active_isa("sse9")


def test_same_bits():
    scene = perfect_bvh.Scene()
    random = np.random.default_rng(1)
    for seed in range(3):
        positions, triangles = meshes.soup(400, seed)
        mesh = scene.add_mesh(positions.astype(np.float32), triangles)
        scene.add_instances([mesh] * 5, random.normal(size=(5, 3, 4)))
    scene.commit()
    origins, directions = meshes.random_rays(20_000, 2)
    answers = []
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        assert perfect_bvh.active_isa() == isa
        hits = scene.cast_rays(origins, directions)
        answers.append([getattr(hits, name).tobytes() for name in ("t_hit", "instance_ids", "primitive_ids")])
        answers[-1].append(hits.primitive_uvs.tobytes())
        answers[-1].append(scene.test_occlusions(origins, directions).tobytes())
    assert hits.is_hit.sum() > 1000
    assert all(answer == answers[0] for answer in answers)
