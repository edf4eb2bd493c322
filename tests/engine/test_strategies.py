"""However rays are traced, they hit the same, and surfaces are closed."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh._tuning import STRATEGIES, Traced

FIELDS = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs")


@pytest.fixture(params=perfect_bvh.available_isas(), autouse=True)
def isa(request):
    perfect_bvh.set_active_isa(request.param)
    yield request.param
    perfect_bvh.set_active_isa(None)


def camera_rays(width: int, height: int, eye=(0.3, -4.0, 0.5)) -> tuple[np.ndarray, np.ndarray]:
    """Towards the unit cube, row by row: directions of shape (height, width, 3)."""
    x, z = np.meshgrid(np.linspace(-0.4, 0.4, width), np.linspace(0.3, -0.3, height))
    directions = np.stack([x, np.ones_like(x), z], axis=-1).astype(np.float32)
    return np.float32(eye), directions


def crowd() -> perfect_bvh.Scene:
    """Overlapping instances of unconnected triangles, slivers and a closed surface, with different masks."""
    scene, random = perfect_bvh.Scene(), np.random.default_rng(4)
    for number, make in enumerate((meshes.soup(300, 1), meshes.slivers(300, 2), meshes.sphere(9, 13, 0.5))):
        mesh = scene.add_mesh(make[0].astype(np.float32), make[1])
        scene.add_instances([mesh] * 6, random.normal(size=(6, 3, 4)) * 0.6, masks=[1 << number] * 6)
    scene.commit()
    return scene


def bits(hits: perfect_bvh.Hits) -> list[bytes]:
    return [getattr(hits, name).tobytes() for name in FIELDS]


@pytest.mark.parametrize("cull", ["none", "back"])
def test_hits_are_the_same(cull):
    scene, random = crowd(), np.random.default_rng(5)
    coherent = camera_rays(67, 41)
    count = coherent[1][..., 0].size
    limits = {"t_max": random.uniform(2.0, 9.0, count), "mask": random.integers(0, 8, count)}
    scattered = meshes.random_rays(2500, 6)
    for origins, directions, more in (
        (*coherent, {}),
        (coherent[0], coherent[1].reshape(-1, 3), limits),
        (*scattered, {}),
    ):
        usual = scene.cast_rays(origins, directions, cull=cull, **more)
        assert usual.is_hit.any() and not usual.is_hit.all()
        for strategy in STRATEGIES:
            traced = Traced(scene, strategy)
            assert bits(traced.cast_rays(origins, directions, cull=cull, **more)) == bits(usual)
            assert np.array_equal(traced.test_occlusions(origins, directions, cull=cull, **more), usual.is_hit)


def test_hits_are_the_same_far_from_what_is_hit(isa):
    """Rays that begin far from a tree are moved towards it, each by itself."""
    scene, random = perfect_bvh.Scene(), np.random.default_rng(8)
    for make in (meshes.soup(200, 1, 0.6), meshes.sphere(9, 13, 0.5)):
        mesh = scene.add_mesh(make[0].astype(np.float32), make[1])
        maps = random.normal(size=(40, 3, 4)) * 0.04
        maps[:, :, 3] = random.uniform(-1.0, 1.0, (40, 3))
        scene.add_instances([mesh] * 40, maps)
        scene.add_instances([mesh] * 3, random.normal(size=(3, 3, 4)) * 0.5)
    scene.commit()
    for distance in (5.0, 40.0, 3e4):
        eye, directions = camera_rays(96, 64, (0.0, -distance, 0.0))
        directions = directions * np.float32([2.5 / distance, 1.0, 2.5 / distance])
        for cull in ("none", "back"):
            far = Traced(scene, "stream").cast_rays(eye, directions, cull=cull)
            assert far.is_hit.mean() > 0.1 and not far.is_hit.all()
            limits = {"t_max": np.where(random.random(far.t_hit.shape) < 0.5, far.t_hit, np.inf)}
            for more in ({}, limits):
                usual = Traced(scene, "stream").cast_rays(eye, directions, cull=cull, **more)
                assert bits(usual) == bits(far)  # a range that ends at the hit holds it
                for strategy in ("auto", "packets"):
                    traced = Traced(scene, strategy)
                    hits = traced.cast_rays(eye, directions, cull=cull, **more)
                    assert bits(hits) == bits(usual)
                    assert hits.packet_ray_count > 0 or isa == "scalar"
                    assert np.array_equal(traced.test_occlusions(eye, directions, cull=cull, **more), usual.is_hit)


@pytest.mark.parametrize("cull", ["none", "back"])
def test_hits_are_the_same_on_a_mesh_in_its_place(cull):
    """The largest mesh without a transform is entered unmapped, by rays at its edges, along axes and from far away."""
    scene, random, count = perfect_bvh.Scene(), np.random.default_rng(10), 4000
    positions, triangles = meshes.sphere(41, 65, 2.0)
    positions = positions.astype(np.float32)
    scene.add_instance(scene.add_mesh(positions, triangles), mask=1)
    soup = scene.add_mesh(*meshes.soup(300, 1))
    scene.add_instances([soup] * 20, random.normal(size=(20, 3, 4)) * 0.3, masks=[2] * 20)
    scene.commit()
    chosen, share = triangles[random.integers(0, len(triangles), count)], random.uniform(size=(count, 1)).round(1)
    targets = positions[chosen[:, 0]] * share + positions[chosen[:, 1]] * (1.0 - share)
    origins = random.uniform(-2.0, 2.0, (count, 3))
    directions = (targets - origins).astype(np.float32)
    origins[3000:3500] *= 20.0
    directions[3500:] = random.permuted(np.tile([0.0, -0.0, 1.5], (500, 1)), axis=1)
    for more in ({}, {"mask": random.integers(0, 4, count), "t_max": random.uniform(0.5, 1.5, count)}):
        alone = Traced(scene, "single").cast_rays(origins, directions, cull=cull, **more)
        assert alone.is_hit.any() and not alone.is_hit.all()
        for strategy in STRATEGIES:
            traced = Traced(scene, strategy)
            assert bits(traced.cast_rays(origins, directions, cull=cull, **more)) == bits(alone)
            assert np.array_equal(traced.test_occlusions(origins, directions, cull=cull, **more), alone.is_hit)


def test_coherence_is_found(isa):
    scene, packed = perfect_bvh.Scene(), 0 if isa == "scalar" else 1
    positions, triangles = meshes.sphere(9, 13, 0.9)
    scene.add_instance(scene.add_mesh(positions.astype(np.float32), triangles))
    scene.commit()
    eye, directions = camera_rays(640, 16, (0.3, -3.0, 0.5))
    count = directions[..., 0].size
    assert scene.cast_rays(eye, directions).packet_ray_count == packed * count
    assert scene.cast_rays(*meshes.random_rays(4096, 1)).packet_ray_count == 0
    assert Traced(scene, "packets").cast_rays(*meshes.random_rays(4096, 1)).packet_ray_count == packed * 4096
    assert Traced(scene, "stream").cast_rays(eye, directions).packet_ray_count == 0
    counted = Traced(scene, "packets").cast_rays(eye, directions, fields=("nodes_visited",))
    assert counted.packet_ray_count == 0 and counted.nodes_visited.min() > 0


def test_the_order_of_rays_does_not_matter(isa):
    """Rows of an image, its columns, and its pixels in any order are traced as tiles: each ray keeps its hit."""
    scene, random = crowd(), np.random.default_rng(9)
    eye, directions = camera_rays(193, 101)
    masks = random.integers(0, 8, directions.shape[:2])
    usual = Traced(scene, "single").cast_rays(eye, directions, mask=masks)
    count = masks.size
    for order in (np.arange(count), np.arange(count).reshape(masks.shape).T.ravel(), random.permutation(count)):
        rays = {"directions": directions.reshape(-1, 3)[order], "mask": masks.ravel()[order]}
        hits = scene.cast_rays(eye, **rays)
        for name in FIELDS:
            expected = getattr(usual, name).reshape(count, *getattr(hits, name).shape[1:])[order]
            assert getattr(hits, name).tobytes() == expected.tobytes()
        assert np.array_equal(scene.test_occlusions(eye, **rays), hits.is_hit)
        assert hits.packet_ray_count > 0 or isa == "scalar"


@pytest.mark.skipif(
    len(perfect_bvh.available_isas()) == 1,
    reason="this processor has none of the vector instructions that packets need",
)
def test_packets_whose_rays_part_are_left_to_the_stream():
    perfect_bvh.set_active_isa(perfect_bvh.available_isas()[1])
    scene, (eye, directions) = crowd(), camera_rays(640, 16)
    count = directions[..., 0].size
    assert 0 < scene.cast_rays(eye, directions).packet_ray_count < count
    assert Traced(scene, "packets").cast_rays(eye, directions).packet_ray_count == count


def test_surfaces_are_closed_at_edges():
    """Rays from inside a closed surface at its edges."""
    positions, triangles = meshes.sphere(161, 257)
    positions = positions.astype(np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    random = np.random.default_rng(7)
    chosen, share = triangles[random.integers(0, len(triangles), 60_000)], random.uniform(size=(60_000, 1))
    targets = (positions[chosen[:, 0]] * share + positions[chosen[:, 1]] * (1.0 - share)).astype(np.float32)
    origins = random.uniform(-0.5, 0.5, targets.shape).astype(np.float32)
    assert scene.test_occlusions(origins, targets - origins).all()
