"""The example scene of hair and points: its content, refits of the swaying blades, edits of a fringe, and Cycles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import evaluated
from blender.command_lines import run
from blender.hair_and_points import set_points
from blender.judged_pixels import cast_through, rays_through
from blender.test_passes_cycles import DISPUTED_SHARE, unlike
from oracles.cycles import index_edges, render_cycles, render_passes
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.live.sync_cache import syncs_of

SIZE = (160, 90)
# Offsets in pixels that Cycles' ray may have.
STEPS = [(x, y) for x in np.linspace(-0.005, 0.005, 7) for y in np.linspace(-0.005, 0.005, 7)]
SWAYING = {"Fresh grass", "Young grass", "Dry grass", "Dandelions", "Daisies", "Clover"}
REFITS = {"refitted", "rotated", "partly_rebuilt"}
FIELDS = ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals")


@pytest.fixture
def meadow(registered: None, blend_file: Callable[[str], Path]) -> Any:
    """The scene at its first frame, in a small size."""
    bpy.ops.wm.open_mainfile(filepath=str(blend_file("meadow")))
    scene = bpy.context.scene
    scene.frame_set(1)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.perfect_bvh.samples = 1
    return scene


def test_most_of_it_is_round(meadow: Any) -> None:
    sync = SceneSync(watch=False)
    sync.update(evaluated())
    found = sync.scene.statistics()
    assert found.segment_count > 600_000 and 20_000 < found.point_count < 40_000 and found.triangle_count < 20_000
    parts = {mesh.name: mesh.part_count for mesh in sync.record.meshes if mesh.kind == "curves"}
    lawn = sum(parts[name] for name in ("Fresh grass", "Young grass", "Dry grass"))
    assert 80_000 < lawn < 130_000 and parts["Ewe wool"] > 10_000 and parts["Ewe fringe"] == 150
    assert sync.record.warnings == () and meadow.cycles_curves.shape == "THICK"
    sync.close()


def test_what_sways_is_refitted_and_the_rest_kept(meadow: Any) -> None:
    sync = SceneSync()
    first = sync.update(evaluated(), expected_rays=100_000)
    of_lawn = [mesh for mesh in first.meshes if mesh.name in SWAYING]
    assert {(mesh.usage, mesh.usage_reason) for mesh in of_lawn} == {
        ("deforming", "its geometry nodes use the scene's time")
    }
    for frame in (2, 3):
        meadow.frame_set(frame)
        report = sync.update(evaluated(), expected_rays=100_000)
        assert {mesh.name for mesh in report.meshes if mesh.action == "deformed"} == SWAYING
        assert {mesh.action for mesh in report.meshes if mesh.name not in SWAYING} == {"kept"}
        assert len(report.commit.meshes) == 9  # flowers are stalks and heads
        assert {mesh.action for mesh in report.commit.meshes} <= REFITS
    sync.close()


def test_a_fringe_is_followed_while_it_is_combed(meadow: Any) -> None:
    """Its points are moved and a strand is added. The result equals a first reading."""
    sync, random = SceneSync(), np.random.default_rng(9)
    sync.update(evaluated())
    data = bpy.data.objects["Ewe fringe"].data
    places = np.empty(len(data.points) * 3, np.float32)
    data.attributes["position"].data.foreach_get("vector", places)
    rays = rays_through(sync, np.argwhere(np.ones(SIZE)))
    for step in range(3):
        set_points(data, places + random.normal(scale=0.02 * (step + 1), size=places.shape))
        report = sync.update(evaluated())
        actions = {mesh.name: mesh.action for mesh in report.meshes}
        assert actions.pop("Ewe fringe") == "deformed" and set(actions.values()) == {"kept"}
        assert {mesh.action for mesh in report.commit.meshes} <= REFITS | {"rebuilt"}
    data.add_curves([4])
    set_points(data, np.concatenate([places, np.linspace(0.0, 1.5, 12, dtype=np.float32)]))
    report = sync.update(evaluated())
    assert {mesh.name: mesh.action for mesh in report.meshes if mesh.action != "kept"} == {"Ewe fringe": "replaced"}
    fresh = SceneSync(watch=False)
    fresh.update(evaluated())
    hits, expected = (one.scene.cast_rays(*rays, fields=FIELDS) for one in (sync, fresh))
    assert hits.is_hit.mean() > 0.5
    for field in FIELDS:
        assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field
    for one in (sync, fresh):
        one.close()


def test_info_plans_it(blend_file: Callable[[str], Path], capsys: Any) -> None:
    assert run("info", blend_file("meadow")) == 0
    lines = capsys.readouterr().out.splitlines()
    (grass,) = [line for line in lines if line.startswith("Fresh grass")]
    assert (
        " deforming " in grass and " segments " in grass and grass.endswith("its geometry nodes use the scene's time")
    )
    assert any(" segments, " in line and " points; 28 instances show " in line for line in lines)


@pytest.mark.parametrize("frame", [1, 24])
def test_it_looks_the_same_to_cycles(meadow: Any, frame: int) -> None:
    """Compares depth, normal and index as `test_passes_cycles.py` does; pixels next to edges of the index pass, too.

    There Cycles' ray, up to 0.005 pixels off, may pass by a blade that is a pixel wide. Wherever passes differ, one of
    the engine's rays within this distance is as deep as Cycles' pixel, and the engine's hits on triangles are right.
    """
    meadow.frame_set(frame)
    for ids in (bpy.data.objects, bpy.data.materials):
        for index, item in enumerate(ids, 1):
            item.pass_index = index
    theirs = render_cycles(meadow)
    differ = unlike(render_passes(meadow, "PERFECT_BVH"), theirs)
    assert len(np.unique(theirs.object_index)) > 12
    assert differ.mean() < 3e-3
    assert (differ & ~index_edges(theirs.object_index)).sum() <= DISPUTED_SHARE * differ.size
    sync = syncs_of(meadow)[-1]
    pixels = [(int(x), int(y)) for y, x in np.argwhere(differ)]
    hits = cast_through(sync, pixels, audit=1.0)
    assert hits.audit is not None and len(hits.audit.wrong_rows) == 0
    depths = theirs.depth[differ]
    beside = np.stack([cast_through(sync, np.add(pixels, step)).t_hit for step in STEPS])
    assert np.isclose(beside, depths, rtol=1e-3).any(axis=0).all()
