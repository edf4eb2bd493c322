"""Build settings: trees of every builder with every setting are correct, and each setting has its documented effect."""

from __future__ import annotations

import re

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge
from perfect_bvh import BuildConfig
from perfect_bvh._tuning import CostedBuild
from perfect_bvh.build_config import BUILDERS

FIELDS = perfect_bvh.hits.DEFAULT_FIELDS

NAMED = BUILDERS[1:]  # without "auto", which is one of them
NAIVE = ("median",)  # they look at no cost
BY_COST = tuple(name for name in NAMED if name not in NAIVE)
SETTINGS = {
    "defaults": {},
    "optimized": {"optimize": 5},
    "few bins": {"bins": 2},
    "many bins": {"bins": 256},
    "one axis": {"axes": 1},
    "single triangles": {"max_leaf_size": 1},
    "large leaves": {"max_leaf_size": 255, "traversal_cost": 200.0},
    "free visits": {"traversal_cost": 0.0},
    "dear visits": {"traversal_cost": 20.0, "intersection_cost": 0.5},
    "no duplication": {"duplication_budget": 0.0},
    "much duplication": {"duplication_budget": 5.0, "traversal_cost": 0.1, "optimize": 2},
}

MESHES = {
    "sphere": meshes.sphere(48, 64),
    "soup": meshes.soup(4000, 3, 0.05),
    "slivers": meshes.slivers(3000, 2),
    "grid": meshes.grid(48),
}


def mixed_mesh() -> meshes.Mesh:
    """A small sphere among random triangles and slivers, over a large floor."""
    parts = [meshes.soup(500, 3), meshes.sphere(12, 16, 0.7), meshes.slivers(200, 4), meshes.grid(2, 50.0)]
    first = np.cumsum([0] + [len(positions) for positions, _ in parts[:-1]])
    positions = np.concatenate([positions for positions, _ in parts]).astype(np.float32)
    return positions, np.concatenate([part[1] + start for part, start in zip(parts, first, strict=True)])


def scene_of(mesh: meshes.Mesh, **settings: object) -> perfect_bvh.Scene:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh, build=CostedBuild(**settings)))
    scene.commit()
    return scene


def tree_of(mesh: meshes.Mesh, **settings: object) -> perfect_bvh.TreeStatistics:
    return scene_of(mesh, **settings).statistics().meshes[0]


@pytest.fixture(scope="module")
def judged() -> tuple[meshes.Mesh, tuple[np.ndarray, np.ndarray], perfect_bvh.Hits]:
    """A mesh, rays, and hits that the oracle found right."""
    mesh, rays = mixed_mesh(), meshes.random_rays(2000, 8)
    hits = scene_of(mesh).cast_rays(*rays)
    triangles = WorldTriangles.of([(0, *mesh, np.eye(4), 0xFFFFFFFF)])
    verdict = judge(triangles, *rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not verdict.wrong.any(), str(verdict)
    assert verdict.hit.sum() > 1000
    return mesh, rays, hits


@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
@pytest.mark.parametrize("builder", BUILDERS)
def test_hits_are_right_with_every_setting(judged, builder, settings):
    mesh, rays, expected = judged
    scene = scene_of(mesh, builder=builder, **settings)
    hits = scene.cast_rays(*rays)
    for name in FIELDS:
        assert np.array_equal(getattr(hits, name), getattr(expected, name)), name
    assert np.array_equal(scene.test_occlusions(*rays), hits.is_hit)


@pytest.mark.parametrize("builder", ["auto", *BY_COST])
@pytest.mark.parametrize("name", MESHES)
def test_the_heuristic_saves_intersections(name, builder):
    """The lecture's "naive against SAH": by how much is for the benchmark to say."""

    def costs(tree: str) -> tuple[float, float]:
        fields = ("nodes_visited", "primitives_tested")
        hits = scene_of(MESHES[name], builder=tree).cast_rays(*meshes.random_rays(5000, 5), fields=fields)
        return float(hits.nodes_visited.mean()), float(hits.primitives_tested.mean())

    visited, tested = costs(builder)
    naively_visited, naively_tested = costs("median")
    assert tested < naively_tested
    assert visited + tested < naively_visited + naively_tested
    assert tree_of(MESHES[name], builder=builder).sah < tree_of(MESHES[name], builder="median").sah


@pytest.mark.parametrize("builder", NAMED)
def test_reinsertion_lowers_the_cost_of_any_tree(builder):
    # Leaves of another size: without, "fast" makes no binary tree that could be compared.
    settings = {"builder": builder, "max_leaf_size": 4}
    plain, better = (tree_of(MESHES["slivers"], **settings, optimize=passes) for passes in (0, 5))
    assert better.sah < 0.99 * plain.sah
    assert (better.leaf_count, better.reference_count) == (plain.leaf_count, plain.reference_count)


def test_a_tree_is_built_again_with_as_many_passes():
    scene = scene_of(MESHES["slivers"], builder="binned", optimize=100)
    first, second = (scene.statistics(detailed=True).meshes[0] for _ in range(2))  # details build it again
    assert first == second
    assert first.sah == tree_of(MESHES["slivers"], builder="binned", optimize=100).sah


@pytest.mark.parametrize("name", ["soup", "slivers"])
def test_fewer_planes_make_a_worse_tree(name):
    mesh = MESHES[name]
    usual = tree_of(mesh, builder="binned").sah
    assert tree_of(mesh, builder="binned", bins=2).sah > usual
    assert tree_of(mesh, builder="binned", axes=1).sah > usual
    assert tree_of(mesh, builder="sweep").sah < usual


@pytest.mark.parametrize("builder", NAMED)
@pytest.mark.parametrize("most", [1, 3])
def test_no_leaf_is_larger_than_asked_for(builder, most):
    tree = tree_of(MESHES["soup"], builder=builder, max_leaf_size=most, traversal_cost=100.0)
    assert tree.max_leaf_size <= most
    assert tree.leaf_count >= 4000 / most


@pytest.mark.parametrize("builder", BY_COST)
def test_dear_visits_make_large_leaves(builder):
    def leaf_count(visit: float) -> int:
        return tree_of(MESHES["soup"], builder=builder, max_leaf_size=255, traversal_cost=visit).leaf_count

    assert leaf_count(100.0) < leaf_count(5.0) < leaf_count(1.0)


def test_the_budget_limits_duplication():
    mesh = MESHES["slivers"]
    trees = [tree_of(mesh, builder="spatial", duplication_budget=budget) for budget in (0.0, 0.02, 2.0)]
    assert trees[0].duplication == 1.0 < trees[1].duplication < trees[2].duplication
    assert trees[1].duplication <= 1.02
    assert trees[2].sah < trees[0].sah
    assert tree_of(mesh, builder="binned", duplication_budget=2.0).duplication == 1.0


def test_settings_are_kept_as_plain_numbers():
    config = BuildConfig(bins=np.int64(8), optimize=np.uint8(3), duplication_budget=np.float32(0.5))
    assert (config.bins, config.optimize, config.duplication_budget) == (8, 3, 0.5)
    assert {type(config.bins), type(config.optimize)} == {int} and type(config.duplication_budget) is float
    assert config == BuildConfig(bins=8, optimize=3, duplication_budget=0.5)


@pytest.mark.parametrize(
    ("setting", "values", "expected"),
    [
        ("builder", ["", "sah", "Binned", None, 3], f"must be one of {', '.join(BUILDERS)}; got"),
        ("optimize", [-1, 1001, True, 1.0, "2", None], "must be an integer from 0 to 1000, got"),
        ("bins", [1, 0, -3, 257, 16.0, None, np.array([2, 3])], "must be an integer from 2 to 256, got"),
        ("axes", [0, 4, True, 3.0, "x"], "must be an integer from 1 to 3, got"),
        ("axes", [2], "must be 1 or 3, got"),
        ("max_leaf_size", [0, 256, -1], "must be an integer from 1 to 255, got"),
        (
            "duplication_budget",
            [-0.1, 10.5, np.nan, np.inf, "much", None, True, [1.0, 2.0]],
            "must be a number from 0 to 10, got",
        ),
    ],
)
def test_every_setting_is_checked(setting, values, expected):
    for value in values:
        with pytest.raises(ValueError, match=re.escape(f"BuildConfig: {setting} {expected} ")):
            BuildConfig(**{setting: value})


@pytest.mark.parametrize("name", ["layout", "optimize_milliseconds", "traversal_cost", "intersection_cost"])
def test_what_is_no_setting_is_refused_by_its_name(name):
    with pytest.raises(TypeError, match=name):
        BuildConfig(**{name: 1.0})


@pytest.mark.parametrize("costs", [{"traversal_cost": -0.1}, {"traversal_cost": np.nan}, {"intersection_cost": 0.0}])
def test_the_engine_checks_costs(costs):
    with pytest.raises(ValueError, match=f"BuildConfig: {next(iter(costs))} must be from"):
        tree_of(meshes.grid(2), **costs)


def test_the_limits_themselves_are_allowed():
    lowest = {"optimize": 0, "bins": 2, "max_leaf_size": 1, "traversal_cost": 0, "intersection_cost": 1e-6}
    highest = {"optimize": 1000, "bins": 256, "max_leaf_size": 255, "traversal_cost": 1e6, "intersection_cost": 1e6}
    for settings in (lowest, highest, {"duplication_budget": 10}):
        for builder in ("binned", "spatial"):
            assert tree_of(meshes.sphere(6, 8), builder=builder, **settings).reference_count >= 80
