"""The words for hair and point clouds: users read of segments, curves and points where meshes have triangles."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import evaluated, mesh_object
from blender.command_lines import run
from blender.hair_and_points import cloud_object, hair_object, make_poly, set_points, set_radii, upright
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.cli.report import describe_changes
from perfect_bvh_addon.image.plan import owners_of
from perfect_bvh_addon.statistics.updates import facts_of, find_updates
from perfect_bvh_addon.view3d.tree_overlay.hovered_box import HoveredBox
from perfect_bvh_addon.view3d.walk.walk_legend import rows_of
from perfect_bvh_addon.view3d.walk.walk_steps import Counters, WalkWords

DOWN = (0.0, 0.0, -1.0)


@pytest.fixture
def hair(scene: Any) -> Any:
    """8 curves of 5 straight segments, 300 points, and a mesh of 4 triangles, side by side."""
    made = hair_object("Hair", upright(8, points=6))
    make_poly(made.data)
    cloud_object("Cloud", np.random.default_rng(3).uniform(12.0, 14.0, (300, 3)), 0.05)
    mesh_object("Mesh", location=(-5, -5, 0))
    return made


@pytest.fixture
def sync(hair: Any) -> Any:
    made = SceneSync()
    made.update(evaluated())
    yield made
    made.close()


def test_statistics_count_each_kind_apart(sync: Any) -> None:
    found = sync.scene.statistics()
    assert (found.triangle_count, found.segment_count, found.point_count) == (4, 40, 300)
    counts = found.instanced_triangle_count, found.instanced_segment_count, found.instanced_point_count
    assert counts == (4, 40, 300)
    rows = {tree.kind: tree.primitive_count for tree in found.meshes}
    assert rows == {"triangles": 4, "curves": 40, "points": 300} and found.top_level.kind == "instances"


def test_commits_and_updates_name_them(hair: Any) -> None:
    sync = SceneSync()
    report = sync.update(evaluated())
    text = " ".join(describe_changes(report))
    for part in ("Hair (40 segments)", "Cloud (300 points)", "Mesh (4 triangles)"):
        assert part in text
    found = find_updates(report, owners_of(sync))
    facts = {row.title: facts_of(row) for row in (*found.changed, *found.unchanged)}
    assert facts["Hair"].startswith("8 curves, 40 segments, ") and facts["Cloud"].startswith("300 points, ")
    hair.data.add_curves([4])
    make_poly(hair.data)
    set_points(hair.data, np.concatenate([upright(8, points=6).reshape(-1, 3), upright(1).reshape(-1, 3) + 9.0]))
    set_radii(hair.data, 0.1)
    report = sync.update(evaluated())
    (row,) = report.commit.meshes
    assert (row.kind, row.triangle_count) == ("curves", 43) and row.reason.startswith("the curves were replaced")
    sync.close()


def test_info_names_them(hair: Any, tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "round.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    assert run("info", path) == 0
    told = capsys.readouterr().out
    assert "  40 segments  " in told and " 300 points  " in told and "  4 triangles  " in told
    sums = "4 triangles, 40 segments, 300 points"
    assert f"3 meshes, {sums}; 3 instances show {sums}; top level" in told


def test_boxes_of_trees_name_them(sync: Any) -> None:
    for mesh, words in ((0, "40 segments"), (1, "300 points"), (2, "4 triangles")):
        kinds = ("curves", "points", "triangles")
        (row,) = [k for k, record in enumerate(sync.record.meshes) if record.kind == kinds[mesh]]
        mesh_id = int(sync.mesh_ids[row])
        tree = SimpleNamespace(boxes=sync.scene.snapshot().tree_boxes(mesh_id))
        assert HoveredBox(tree, 0, 0, mesh_id, None).lines(sync)[0].endswith(f"on level 0: {words}")


def test_walks_name_them(sync: Any) -> None:
    walk = sync.scene.walk_ray((2.0, 0.0, 9.0), DOWN)
    row = walk.hit_row
    assert row is not None
    instance = int(walk.instance_ids[row])
    kinds = {instance: "curves"}
    words = WalkWords(walk, {instance: "Hair"}, None, kinds)
    leaf = int(np.flatnonzero(walk.primitive_ids >= 0)[0])
    begin = leaf - 1
    end = begin + 1
    while end < len(walk) and walk.primitive_ids[end] >= 0:
        end += 1
    rows = range(begin, end)
    count = "1 segment" if len(rows) == 2 else f"{len(rows) - 1} segments"
    assert words.of_step(rows).startswith(f"Tests {count} of a leaf at level")
    assert words.of_event(rows, leaf).startswith(f"Segment 1 of {len(rows) - 1} at level")
    assert f"{count}, tested at once" in words.of_event(rows, begin)
    assert words.tested() == "Segments"
    none = Counters(np.zeros(11, np.int64), np.zeros(11))
    names = [line.name for line in rows_of(none, none, words.tested())]
    assert "Segments Tested in 0 Leaves" in names and names[-1] == "SAH Cost: Visits + Segments"
