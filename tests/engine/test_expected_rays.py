"""The number of rays that a commit expects by default, and how the rays cast so far change it."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from engine.calibrations import MACHINE
from oracles import meshes

CROSSED = meshes.slivers(4000, 1)  # by MACHINE, 1.5 million rays repay spatial splits


def make_scene(**keywords):
    scene = perfect_bvh.Scene(calibration=MACHINE)
    scene.add_instance(scene.add_mesh(*CROSSED, **keywords))
    return scene


def test_every_ray_is_counted():
    scene = make_scene()
    scene.commit()
    assert scene.rays_cast == 0
    origins, directions = meshes.random_rays(300, 1)
    snapshot = scene.snapshot()
    calls = (
        lambda: scene.cast_rays(origins, directions),
        lambda: snapshot.test_occlusions(origins, directions),
        lambda: scene.count_intersections(origins, directions),
    )
    for number, call in enumerate(calls):
        call()
        assert scene.rays_cast == 300 * (number + 1)
    scene.list_intersections(origins, directions)
    assert scene.rays_cast == 5 * 300  # once to count the intersections, and once to list them
    snapshot.walk_ray(origins[0], directions[0])
    assert scene.rays_cast == 5 * 300


def test_an_images_rays_are_counted_with_those_that_light_it():
    scene = make_scene()
    scene.commit()
    camera = perfect_bvh.Camera.look_at((0, -6, 0), (0, 0, 0))
    perfect_bvh.render(scene, camera, "depth", size=(20, 10))
    assert scene.rays_cast == 200
    perfect_bvh.render(scene, camera, "clay", size=(20, 10), samples=2)
    assert 600 < scene.rays_cast <= 200 + 2 * 3 * 200


def test_rays_that_were_cast_buy_a_better_tree_once():
    scene = make_scene()
    assert scene.commit().meshes[0].builder == "binned"
    rays = meshes.random_rays(310_000, 2)  # and four times as many are taken to follow
    before = scene.cast_rays(*rays)
    (row,) = scene.commit().meshes
    assert (row.action, row.builder, row.expected_rays) == ("rebuilt", "spatial", None)
    assert [(other.action, other.builder) for other in row.alternatives] == [("kept", ""), ("rebuilt", "spatial")]
    after = scene.cast_rays(*rays)
    for name in perfect_bvh.hits.DEFAULT_FIELDS:
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name), err_msg=name)
    for told in (None, 10**9, 0):
        report = scene.commit(told)
        assert not report.meshes and not report.resting


def test_a_changing_mesh_is_built_soonest_as_long_as_nothing_is_known():
    scene = make_scene(usage="changing")
    assert scene.commit().meshes[0].builder == "fast"
    scene.replace_mesh(0, *CROSSED)
    assert scene.commit().meshes[0].builder == "fast"
    scene.cast_rays(*meshes.random_rays(200_000, 2))
    scene.replace_mesh(0, *CROSSED)
    assert scene.commit().meshes[0].builder == "binned"


def test_a_commit_that_is_told_nothing_expects_what_the_last_one_did():
    scene = make_scene()
    assert scene.commit().meshes[0].expected_rays is None

    def expected(*told):
        scene.replace_mesh(0, *CROSSED)
        return scene.commit(*told).meshes[0].expected_rays

    assert expected(900) == pytest.approx(900)
    assert expected() == pytest.approx(900)
    assert expected(0) == 0
    assert expected() == pytest.approx(900), "that none were expected said nothing of later commits"
    scene.cast_rays(*meshes.random_rays(2000, 2))
    assert expected() == pytest.approx(2000)
    assert expected() == pytest.approx(900)
