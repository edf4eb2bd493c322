"""Many instances, overlapping and nested: every ray's answer against the double-precision oracle."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge


def placed(rng: np.random.Generator, spread: float, sizes: tuple[float, float]) -> np.ndarray:
    """A random rotation and size, at a random place."""
    matrix = np.eye(4)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix[:3, :3] = rotation * np.exp(rng.uniform(*np.log(sizes)))
    matrix[:3, 3] = rng.uniform(-spread, spread, 3)
    return matrix


def layouts(seed: int) -> dict[str, list[np.ndarray]]:
    rng = np.random.default_rng(seed)
    in_place = [np.diag([s, s, s, 1.0]) for s in np.geomspace(0.01, 1.0, 60)]
    return {
        "overlapping": [placed(rng, 0.5, (0.3, 1.0)) for _ in range(120)],
        "interleaved": [placed(rng, 1.0, (0.01, 2.0)) for _ in range(200)],
        "nested": in_place,
        "duplicates": [np.eye(4)] * 50,
        "two": [placed(rng, 0.2, (0.5, 1.0)) for _ in range(2)],
    }


@pytest.mark.parametrize("layout", ["overlapping", "interleaved", "nested", "duplicates", "two"])
@pytest.mark.parametrize("seed", range(2))
def test_hits_equal_the_oracle(layout: str, seed: int) -> None:
    positions, triangles = meshes.soup(30, seed)
    mesh = positions.astype(np.float32), triangles
    transforms = layouts(seed)[layout]
    scene = perfect_bvh.Scene()
    mesh_id = scene.add_mesh(*mesh)
    ids = scene.add_instances(np.full(len(transforms), mesh_id), np.array(transforms))
    scene.commit()
    assert scene.statistics().top_level.reference_count == len(transforms)
    origins, directions = meshes.random_rays(500, seed + 50)
    hits = scene.cast_rays(origins, directions)
    world = WorldTriangles.of([(int(i), *mesh, t, 0xFFFFFFFF) for i, t in zip(ids, transforms, strict=True)])
    verdict = judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not verdict.wrong.any(), str(verdict)
    assert verdict.hit.sum() > 30


def test_same_hits_when_few_instances_are_joined_by_many() -> None:
    """The tree over the instances differs with the masked ones in it; the answers must not."""
    rng = np.random.default_rng(3)
    positions, triangles = meshes.soup(30, 1)
    transforms = np.array([placed(rng, 1.0, (0.05, 1.0)) for _ in range(3000)])
    few, many = perfect_bvh.Scene(), perfect_bvh.Scene()
    for scene, count in ((few, 40), (many, 3000)):
        mesh_id = scene.add_mesh(positions.astype(np.float32), triangles)
        masks = np.where(np.arange(count) < 40, 1, 2).astype(np.uint32)
        scene.add_instances(np.full(count, mesh_id), transforms[:count], masks=masks)
        scene.commit()
    rays = meshes.random_rays(4000, 7)
    expected, got = few.cast_rays(*rays, mask=1), many.cast_rays(*rays, mask=1)
    assert np.array_equal(expected.t_hit, got.t_hit)
    assert np.array_equal(expected.instance_ids, got.instance_ids)
    assert np.array_equal(expected.primitive_ids, got.primitive_ids)
    assert expected.is_hit.sum() > 500
