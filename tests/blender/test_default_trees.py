"""Trees without a chosen builder: for sticks and hair, on which builders differ most, rays repay the build.

The tests count and do not time: boxes and triangles that rays from all around are tested against.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from benchmarks import blender_meshes  # noqa: E402
from blender.builders import evaluated, mesh_object  # noqa: E402
from makers.zoo import thin_triangles  # noqa: E402
from perfect_bvh import BuildConfig  # noqa: E402
from perfect_bvh.build_config import BUILDERS  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.bench.measurements import make_scene, rays_from_around  # noqa: E402
from perfect_bvh_addon.sync.records import SceneRecord  # noqa: E402

MILLION = 1_000_000
NOTICEABLE = 1.1
# In the last one, as many triangles are cut as are worth it.
CONFIGS = (*(BuildConfig(builder=name) for name in BUILDERS), BuildConfig(builder="spatial", duplication_budget=5.0))  # type: ignore[arg-type]
Rays = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]


def put(name: str, positions: npt.NDArray[Any], triangles: npt.NDArray[Any]) -> None:
    """Put a mesh into a new scene, alone."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.meshes.new(name)
    data.from_pydata(positions, [], triangles)
    mesh_object(name, data)


def put_sticks() -> None:
    made = blender_meshes.sticks(0.1)
    put("sticks", made.positions, made.triangles)


def put_sticks_aslant() -> None:
    (body,) = thin_triangles.diagonal_sticks()[-1]
    put("sticks aslant", body.positions, body.triangles)


def put_hair_in_wind() -> None:
    (body,) = thin_triangles.hair_in_wind()[-1]
    put("hair in the wind", body.positions, body.triangles)


@pytest.fixture(params=[put_sticks, put_sticks_aslant, put_hair_in_wind], ids=lambda put: put.__name__)
def thin(request: pytest.FixtureRequest) -> None:
    request.param()


def rays_at(record: SceneRecord, count: int) -> Rays:
    return rays_from_around(record, np.random.default_rng(4), count)


def work(scene: perfect_bvh.Scene, rays: Rays) -> float:
    hits = scene.cast_rays(*rays, fields=("nodes_visited", "primitives_tested"))
    return float(hits.nodes_visited.mean() + hits.primitives_tested.mean())


def least_work(record: SceneRecord, rays: Rays) -> float:
    """Return the least work of all builders' trees."""
    found = []
    for config in CONFIGS:
        scene = make_scene(record, config)
        scene.commit()
        found.append(work(scene, rays))
    return min(found)


def actions(report: Any) -> list[str]:
    return [row.action for row in report.commit.meshes]


def test_after_a_million_rays_the_next_update_has_the_best_tree(thin: None) -> None:
    sync = SceneSync()
    assert actions(sync.update(evaluated())) == ["built"]
    few = rays_at(sync.record, 20_000)
    least, first = least_work(sync.record, few), work(sync.scene, few)
    sync.scene.cast_rays(*rays_at(sync.record, MILLION), fields=("t_hit",))
    report = sync.update(evaluated())
    assert actions(report) == ["rebuilt"] and not report.has_changes
    assert work(sync.scene, few) <= NOTICEABLE * least < first
    for _ in range(3):  # as good as it gets
        sync.scene.cast_rays(*few)
        assert actions(sync.update(evaluated())) == []
    sync.close()


def test_who_tells_of_a_million_rays_has_the_best_tree_at_once(thin: None) -> None:
    sync = SceneSync()
    assert actions(sync.update(evaluated(), expected_rays=MILLION)) == ["built"]
    few = rays_at(sync.record, 20_000)
    assert work(sync.scene, few) <= NOTICEABLE * least_work(sync.record, few)
    assert actions(sync.update(evaluated())) == []
    sync.close()


def test_an_update_that_only_tells_of_more_rays_replaces_the_tree_once(thin: None) -> None:
    sync = SceneSync()
    sync.update(evaluated(), expected_rays=10)
    assert [tree.builder for tree in sync.scene.statistics().meshes] == ["fast"]
    report = sync.update(evaluated(), expected_rays=MILLION)
    assert actions(report) == ["rebuilt"] and not report.has_changes
    few = rays_at(sync.record, 20_000)
    assert work(sync.scene, few) <= NOTICEABLE * least_work(sync.record, few)
    for told in (MILLION, 10, None, 100 * MILLION):
        assert actions(sync.update(evaluated(), expected_rays=told)) == []
    sync.close()


def test_what_the_last_update_was_told_counts_for_what_comes_new(thin: None) -> None:
    sync = SceneSync()
    sync.update(evaluated(), expected_rays=MILLION)
    (obj,) = bpy.context.scene.objects
    copy = obj.copy()
    copy.data, copy.location.x = obj.data.copy(), 5.0
    bpy.context.scene.collection.objects.link(copy)
    report = sync.update(evaluated())
    assert [(row.action, row.builder) for row in report.commit.meshes] == [("built", "spatial")]
    assert report.commit.meshes[0].expected_rays == pytest.approx(MILLION, rel=0.7)  # its share of them
    sync.close()


def test_hair_that_no_cut_helps_keeps_its_tree() -> None:
    """Most segments of its strands are short: a million rays do not repay the time of cutting them."""
    blender_meshes.hair(0.1)  # leaves its object
    sync = SceneSync()
    assert actions(sync.update(evaluated())) == ["built"]
    few = rays_at(sync.record, 20_000)
    sync.scene.cast_rays(*rays_at(sync.record, MILLION), fields=("t_hit",))
    assert actions(sync.update(evaluated())) == []
    scenes = [make_scene(sync.record, BuildConfig(builder=name)) for name in BUILDERS]  # type: ignore[arg-type]
    for scene in scenes:
        scene.commit()
    assert work(sync.scene, few) <= NOTICEABLE * min(work(scene, few) for scene in scenes)
    sync.close()
