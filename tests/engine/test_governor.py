"""How a scene treats moved vertices: its decisions are reproducible, explained, and never change a hit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import perfect_bvh
import pytest
from benchmarks.moving_meshes import exploding
from engine.calibrations import MACHINE
from oracles import meshes
from perfect_bvh._tuning import POLICIES, with_policy

BURST = exploding(frame_count=10, rows=40)


def play(policy="governed", expected_rays=None, motion=BURST, **keywords):
    """The scene after the last frame, and the ledger's rows of the frames after the first."""
    scene = with_policy(perfect_bvh.Scene(calibration=MACHINE), policy)
    mesh = scene.add_mesh(motion.positions[0], motion.triangles, usage="deforming", **keywords)
    scene.add_instance(mesh)
    scene.commit(expected_rays)
    rows = []
    for positions in motion.positions[1:]:
        scene.update_mesh(mesh, positions)
        rows += scene.commit(expected_rays).meshes
    return scene, rows


def test_policies_give_identical_hits():
    rays = meshes.random_rays(4000, 1)
    scenes = [play(policy, 1e5)[0] for policy in POLICIES]
    hits = [scene.cast_rays(*rays) for scene in scenes]
    assert hits[0].is_hit.any()
    for other in hits[1:]:
        for name in perfect_bvh.hits.DEFAULT_FIELDS:
            assert np.array_equal(getattr(hits[0], name), getattr(other, name)), name


@pytest.mark.parametrize(
    ("policy", "action"),
    [("refit", "refitted"), ("rotate", "rotated"), ("rebuild_parts", "partly_rebuilt"), ("rebuild", "rebuilt")],
)
@pytest.mark.parametrize("rays", [None, 1e7])
def test_policies_do_what_they_say(policy, action, rays):
    rows = play(policy, rays)[1]
    assert {row.action for row in rows} == {action}
    assert all("policy" in row.reason for row in rows)


def test_a_policy_that_there_is_not():
    with pytest.raises(ValueError, match=r"with_policy: policy must be one of governed, .*; got 'best'"):
        with_policy(perfect_bvh.Scene(), "best")


def test_more_rays_mean_better_trees():
    costs, updates = [], []
    for rays in (0, 1e4, 1e5, 1e6, 1e8):
        rows = play(expected_rays=rays)[1]
        costs.append(sum(row.cost for row in rows))
        updates.append(sum(row.action != "refitted" for row in rows))
    assert updates[0] == 0 and updates[-1] > 0
    assert costs[-1] < 0.9 * costs[0]


@pytest.mark.parametrize("rays", [None, 2e4, 1e6])
def test_decisions_do_not_depend_on_threads(rays):
    threads = perfect_bvh.thread_count()
    ledgers = []
    try:
        for count in (1, 2, 4):
            perfect_bvh.set_thread_count(count)
            ledgers.append(
                [(row.action, row.reason, row.alternatives, row.cost) for row in play(expected_rays=rays)[1]]
            )
    finally:
        perfect_bvh.set_thread_count(threads)
    assert ledgers[0] == ledgers[1] == ledgers[2]


def test_the_ledger_is_complete():
    rows = play(expected_rays=3e4)[1]
    assert "refitted" in {row.action for row in rows}
    for row in rows:
        assert row.usage == "deforming" and row.reason
        assert row.expected_rays == pytest.approx(3e4)  # nothing else is in the scene
        assert [item.action for item in row.alternatives] == ["refitted", "rotated", "partly_rebuilt", "rebuilt"]
        for alternative in row.alternatives:
            assert alternative.update_milliseconds > 0 and alternative.trace_milliseconds > 0
        assert row.cost == pytest.approx(row.node_visits + 0.5 * row.leaf_visits)
        assert row.fresh_cost > 0 and row.refitted_cost > 0
        if row.action == "refitted":
            assert row.cost == pytest.approx(row.refitted_cost, rel=1e-5)
            ray = row.node_visits * MACHINE.node_nanoseconds + row.leaf_visits * MACHINE.leaf_nanoseconds
            refit = next(item for item in row.alternatives if item.action == "refitted")
            assert refit.trace_milliseconds == pytest.approx(row.expected_rays * ray * 1e-6, rel=1e-5)
            assert refit.builder == ""


def test_rays_are_shared_out_by_area():
    scene = perfect_bvh.Scene(calibration=MACHINE)
    cube = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    triangles = [(0, 1, 2), (5, 6, 7), (0, 5, 6)]
    once, thrice, unseen = (scene.add_mesh(cube, triangles) for _ in range(3))
    scene.add_instance(once, np.diag([1.0, 1.0, 1.0, 1.0]))
    for x in (1, 2, 3):
        move = np.eye(4)
        move[0, 3] = x
        scene.add_instance(thrice, move)
    rows = {row.mesh_id: row.expected_rays for row in scene.commit(1800).meshes}
    # A box of 4 x 1 x 1 has 18 squares of surface, a cube 6.
    assert rows == pytest.approx({once: 600, thrice: 1800, unseen: 0})
    scene.update_mesh(once, cube * 0.5)
    assert scene.commit(1800).meshes[0].expected_rays == pytest.approx(150)
    scene.update_mesh(once, cube)
    assert scene.commit().meshes[0].expected_rays == pytest.approx(600)  # of the number passed to the last commit


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("rays", [None, 0, 1e9])
def test_what_cannot_be_refitted_never_is(policy, rays):
    _, rows = play(policy, rays, build=perfect_bvh.BuildConfig(builder="spatial"))
    assert {row.action for row in rows} == {"rebuilt"}
    scene = with_policy(perfect_bvh.Scene(calibration=MACHINE), policy)
    positions, triangles = meshes.sphere(8, 12)
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit(rays)
    scene.replace_mesh(mesh, positions, triangles[:, [1, 2, 0]][::-1].copy())  # as many, but others
    assert scene.commit(rays).meshes[0].action == "rebuilt"
    scene.replace_mesh(mesh, positions, triangles)
    scene.update_mesh(mesh, positions * 2)
    assert scene.commit(rays).meshes[0].action == "rebuilt"


def test_the_builder_is_what_the_rays_repay():
    smooth, crossed = meshes.sphere(60, 90), meshes.slivers(4000, 1)

    def builders(mesh, usage):
        made = []
        for rays in (None, 10, 6e4, 1e9):
            scene = perfect_bvh.Scene(calibration=MACHINE)
            scene.add_instance(scene.add_mesh(*mesh, usage=usage))
            row = scene.commit(rays).meshes[0]
            made.append(row.builder)
            assert bool(row.alternatives) == (rays is not None)
            assert not row.alternatives or row.builder in {alternative.builder for alternative in row.alternatives}
        return made

    assert builders(smooth, "static") == ["binned", "fast", "binned", "binned"]
    assert builders(crossed, "static") == ["binned", "fast", "binned", "spatial"]
    assert builders(crossed, "deforming") == ["binned"] * 4
    assert builders(crossed, "changing") == ["fast", "fast", "fast", "binned"]


def test_a_builder_that_was_asked_for_stays():
    scene = perfect_bvh.Scene(calibration=MACHINE)
    mesh = scene.add_mesh(*meshes.slivers(2000, 1), build=perfect_bvh.BuildConfig(builder="sweep"))
    scene.add_instance(mesh)
    row = scene.commit(1e9).meshes[0]
    assert (row.builder, row.alternatives) == ("sweep", ())


def test_the_usage_can_be_changed():
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*meshes.sphere(12, 16))
    assert scene.commit().meshes[0].builder == "binned"
    scene.set_usage(mesh, "changing")
    assert scene.is_current
    scene.replace_mesh(mesh, *meshes.sphere(14, 20))
    row = scene.commit().meshes[0]
    assert (row.usage, row.builder) == ("changing", "fast")
    with pytest.raises(ValueError, match="set_usage: usage must be"):
        scene.set_usage(mesh, "still")
    with pytest.raises(ValueError, match="set_usage: there is no mesh with id 7"):
        scene.set_usage(7, "static")


def test_a_mesh_at_rest_is_built_anew_once():
    positions, triangles = meshes.sphere(40, 60)
    x, y, z = positions.T
    turn = 2 * np.pi * (z - z.min()) / np.ptp(z)
    twisted = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=1)
    scene = perfect_bvh.Scene(calibration=MACHINE)
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    other = scene.add_instance(scene.add_mesh(*meshes.sphere(4, 6)))
    scene.commit()
    scene.update_mesh(mesh, twisted)
    assert scene.commit(0).meshes[0].action == "refitted"
    (row,) = scene.commit().resting
    assert row.action == "kept" and "expected rays is unknown" in row.reason
    actions = []
    for _ in range(80):
        scene.set_transforms([other], np.eye(4)[None])
        report = scene.commit(2_000)
        rows = report.meshes + report.resting
        actions += [row.action for row in rows]
        assert all(row.mesh_id == mesh and "the triangles rest" in row.reason for row in rows)
        assert report.kept_count == 2 - len(report.meshes)
    assert actions == ["kept"] * (len(actions) - 1) + ["rebuilt"] and 1 < len(actions) < 80
    rays = meshes.random_rays(2000, 1)
    fresh = perfect_bvh.Scene()
    fresh.add_instance(fresh.add_mesh(twisted, triangles))
    fresh.commit()
    scene.remove_instances([other])
    scene.commit()
    assert np.array_equal(scene.cast_rays(*rays).t_hit, fresh.cast_rays(*rays).t_hit)


def test_what_is_known_of_a_mesh_is_not_told_of_the_one_that_replaces_it():
    """Also where the new one moves within the shutter at once, or was never traced."""
    positions, triangles = meshes.sphere(30, 42)
    motion = np.stack([positions, positions * (1.0, 1.0, 2.0)])

    def follow(scene, mesh):
        scene.set_mesh_motion(mesh, motion)
        rows = [scene.commit(1e6).meshes[0]]
        scene.set_mesh_motion(mesh, motion * (1.0, 3.0, 1.0))
        rows.append(scene.commit(1e6).meshes[0])
        return rows

    used, actions = play(expected_rays=1e6)
    assert "rebuilt" in {row.action for row in actions}, "nothing was learnt of the first mesh"
    used.replace_mesh(0, positions, triangles)
    fresh = perfect_bvh.Scene(calibration=MACHINE)
    mesh = fresh.add_mesh(positions, triangles, usage="deforming")
    fresh.add_instance(mesh)
    expected = follow(fresh, mesh)
    assert len(expected[1].alternatives) == 4
    for row, other in zip(follow(used, 0), expected, strict=True):
        weighed, anew = ([replace(each, action="") for each in found.alternatives] for found in (row, other))
        assert weighed == anew  # a tree that takes another's place is called rebuilt, not built


def test_a_sheared_mesh_gets_a_new_tree():
    positions, triangles = meshes.sphere(60, 84)
    positions = positions * (1.0, 0.8, 3.0)
    sheared = positions + positions[:, 2:3] * np.array([3.0, 0.9, 0.0])

    def follow(policy):
        scene = with_policy(perfect_bvh.Scene(calibration=MACHINE), policy)
        mesh = scene.add_mesh(positions, triangles, usage="deforming")
        scene.add_instance(mesh)
        scene.commit(1e7)
        scene.update_mesh(mesh, sheared)
        return scene.commit(1e7).meshes[0]

    refitted, rebuilt, governed = (follow(policy) for policy in ("refit", "rebuild", "governed"))
    # Its rays are cheaper than they were at rest, and still could be far cheaper.
    assert rebuilt.cost < 0.8 * refitted.cost < 0.8 * refitted.fresh_cost
    assert (governed.action, governed.cost) == ("rebuilt", rebuilt.cost)


def test_restructuring_is_priced_by_what_it_builds():
    positions, triangles = meshes.sphere(60, 84)
    parts = np.concatenate([positions + [3 * place, 0, 0] for place in range(8)])
    corners = np.concatenate([triangles + place * len(positions) for place in range(8)])

    def price(bent):
        scene = perfect_bvh.Scene(calibration=MACHINE)
        mesh = scene.add_mesh(parts, corners, usage="deforming")
        scene.add_instance(mesh)
        scene.commit(1e6)
        moved = parts.reshape(8, -1, 3).copy()
        turn = 6.0 * moved[:bent, :, 2]
        x, y = moved[:bent, :, 0] - 3 * np.arange(bent)[:, None], moved[:bent, :, 1].copy()
        moved[:bent, :, 0] = np.cos(turn) * x - np.sin(turn) * y + 3 * np.arange(bent)[:, None]
        moved[:bent, :, 1] = np.sin(turn) * x + np.cos(turn) * y
        scene.update_mesh(mesh, moved.reshape(-1, 3))
        row = scene.commit(1e6).meshes[0]
        return next(item.update_milliseconds for item in row.alternatives if item.action == "partly_rebuilt")

    assert 1.5 * price(1) < price(8)
