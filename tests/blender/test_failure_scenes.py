"""Failure cases in Blender: a frame evaluates to the state that it stands for, and every answer about it is right."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from perfect_bvh_addon.failure_cases import CASES, FailureCase, State, find_case  # noqa: E402
from perfect_bvh_addon.failure_cases.case import finite, world_corners  # noqa: E402
from perfect_bvh_addon.failure_scenes import add_failure_scene, frame_of  # noqa: E402

RAYS = 200
ZOO = sorted(path.stem for path in (Path(__file__).parents[2] / "blend_scenes" / "zoo").glob("*.blend"))

every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


def assert_frames_are_the_states(case: FailureCase) -> None:
    """One sync, frame after frame, forwards and then from the last straight to the first."""
    sync, states = perfect_bvh_addon.SceneSync(), case.states()
    for index in (*range(len(states)), 0):
        bpy.context.scene.frame_set(frame_of(index))
        sync.update(bpy.context.evaluated_depsgraph_get())
        state = finite(states[index])
        rays = case.rays(states[index], RAYS, index)
        hits = sync.scene.cast_rays(*rays, audit=1.0)
        assert hits.audit.wrong_rows.size == 0, f"state {index}: {hits.audit}"
        assert sync.scene.statistics().instanced_triangle_count == len(world_corners(state))
        assert_alike(hits, rays, state)


def assert_alike(hits: Any, rays: Any, state: State) -> None:
    """As in a scene filled without Blender, but for the few rays that pass an edge within Blender's roundings."""
    expected = perfect_bvh.Scene()
    for part in state:
        mesh = expected.add_mesh(part.positions, part.triangles)
        expected.add_instances([mesh] * len(part.transforms), part.transforms)
    expected.commit()
    wanted = expected.cast_rays(*rays).t_hit
    assert np.isclose(hits.t_hit, wanted, rtol=1e-3).mean() > 0.97


@every_case
def test_each_frame_is_the_state_it_stands_for(case: FailureCase, scene: Any) -> None:
    bpy.context.window.scene = add_failure_scene(case)
    assert_frames_are_the_states(case)


@pytest.mark.usefixtures("registered")
def test_the_button_makes_a_scene_and_leaves_the_others_alone(scene: Any) -> None:
    scene.name = "Mine"
    assert bpy.ops.perfect_bvh.add_failure_case(case="TWIST") == {"FINISHED"}
    made = bpy.context.scene
    assert (made.name, made.render.engine, made.perfect_bvh.mode) == (find_case("twist").title, "PERFECT_BVH", "COST")
    assert bpy.data.scenes["Mine"] == scene
    assert not scene.objects
    assert find_case("twist").source in bpy.data.texts[made.name].as_string()
    made.render.resolution_x, made.render.resolution_y = 32, 18
    assert bpy.ops.render.render() == {"FINISHED"}


def test_the_cases_of_the_button_are_all_cases() -> None:
    from perfect_bvh_addon.operators.failure_case import CASE_ITEMS

    assert [item[0].lower() for item in CASE_ITEMS] == [case.name for case in CASES]


def test_there_are_files_of_the_telling_cases() -> None:
    assert len(ZOO) == 12
    assert {"twist", "teapot_in_stadium", "equal_counts"} <= set(ZOO) <= {case.name for case in CASES}


@pytest.mark.parametrize("name", ZOO)
def test_a_file_holds_its_case(name: str, blend_file: Callable[[str], Path]) -> None:
    path = blend_file(f"zoo/{name}")
    assert path.stat().st_size < 300_000
    bpy.ops.wm.open_mainfile(filepath=str(path))
    case = find_case(name)
    assert bpy.context.scene.camera is not None
    assert bpy.context.scene.frame_end == frame_of(len(case.states()) - 1)
    assert case.breaks.split(":")[0].split(",")[0] in bpy.data.texts[case.title].as_string().replace("\n", " ")
    assert_frames_are_the_states(case)


def test_the_script_writes_the_file_again(repository: Path, tmp_path: Path) -> None:
    command = [
        sys.executable,
        str(repository / "blend_scenes" / "make_scenes.py"),
        "zoo/twist",
        "--output",
        str(tmp_path),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "zoo" / "twist.blend"))
    assert_frames_are_the_states(find_case("twist"))
