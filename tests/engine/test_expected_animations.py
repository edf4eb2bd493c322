"""One tree for all frames of an animation: what is weighed, what becomes of it, and that no answer depends on it."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from engine.calibrations import MACHINE
from oracles import brute_force, meshes

SHAPES, FRAMES, RAYS = 33, 200, 120


def swarms(count: int = 400, dtype=np.float32):
    """Positions (S, V, 3) of four swarms of triangles that are in one place, fly apart at once and come back."""
    positions, triangles = meshes.soup(count, 5, 0.03)
    ways = np.array([(3, 0, 0), (0, 3, 0), (0, 0, 3), (-3, -3, 0)], float)
    far = np.sin(np.linspace(0, 3.1, SHAPES)) ** 0.2
    way = ways[(np.arange(len(positions)) // 3) % 4]
    return (positions[None] + far[:, None, None] * way[None]).astype(dtype), triangles


def rays_at(positions, count: int = 100):
    """From around and inside, towards random vertices."""
    random = np.random.default_rng(3)
    origins = random.uniform(-4, 4, (count, 3)).astype(np.float32)
    targets = positions[random.integers(0, len(positions), count)] + random.normal(0, 0.01, (count, 3))
    return origins, (targets - origins).astype(np.float32)


class Play:
    """A scene of one mesh whose animation is known."""

    def __init__(self, policy="governed", *, is_told=True, count: int = 400, dtype=np.float32, **keywords):
        self.shapes, self.triangles = swarms(count, dtype)
        self.scene = perfect_bvh.Scene(policy, MACHINE)
        self.mesh = self.scene.add_mesh(self.shapes[0], self.triangles, usage="deforming", **keywords)
        self.scene.add_instance(self.mesh)
        if is_told:
            self.expect()

    def expect(self, shapes=None, frames=FRAMES):
        self.scene.expect_animation(self.mesh, self.shapes if shapes is None else shapes, frames)

    def commit(self, rays: int | None = RAYS):
        return self.scene.commit(rays).meshes[0]

    def show(self, shape: int, rays: int | None = RAYS):
        self.scene.update_mesh(self.mesh, self.shapes[shape])
        return self.commit(rays)


def weighs(row) -> bool:
    return "animated" in {item.action for item in row.alternatives}


def test_the_ledger_tells():
    play = Play()
    row = play.commit()
    assert (row.action, row.builder) == ("animated", "binned")
    assert row.reason.startswith("new mesh; one tree for the 200 frames to come is built for ")
    assert row.optimize_milliseconds > 0
    animated = row.alternatives[-1]
    assert (animated.action, animated.builder) == ("animated", "binned")
    assert animated.update_milliseconds > 0 and animated.trace_milliseconds > 0
    play.expect(frames=2)
    row = play.show(1)
    assert row.action == "refitted" and weighs(row)
    assert "; one tree for the 2 frames to come would take " in row.reason


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("layout", ["default", "compact"])
def test_hits_are_right_in_every_frame_and_after_any_jump(dtype, layout):
    play = Play(dtype=dtype, build=perfect_bvh.BuildConfig(layout=layout))
    assert play.commit().action == "animated"
    found = 0
    for shape in (*range(1, SHAPES), 5, 31, 0, 16):
        assert play.show(shape).action == "refitted"
        origins, directions = rays_at(play.shapes[shape])
        hits = play.scene.cast_rays(origins, directions)
        if dtype == np.float32:  # which the engine takes as they are, while it rounds float64 about their middle
            world = brute_force.WorldTriangles.of([(0, play.shapes[shape], play.triangles, np.eye(4), 0xFFFFFFFF)])
            verdict = brute_force.judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
            assert not verdict.wrong.any(), verdict
        found += hits.is_hit.sum()
        fresh = perfect_bvh.Scene()
        fresh.add_instance(fresh.add_mesh(play.shapes[shape], play.triangles))
        fresh.commit()
        expected = fresh.cast_rays(origins, directions)
        for name in ("t_hit", "primitive_ids", "primitive_uvs"):
            assert np.array_equal(getattr(hits, name), getattr(expected, name)), (shape, name)
    assert found > 500


def test_one_tree_costs_the_mean_ray_less():
    def mean_cost(policy):
        play = Play(policy=policy)
        assert play.commit().action == ("animated" if policy == "animate" else "built")
        return np.mean([play.show(shape).cost for shape in range(SHAPES)])

    assert mean_cost("animate") < 0.5 * mean_cost("refit")


def test_the_policy_builds_it_always():
    play = Play(policy="animate")
    row = play.commit(None)
    assert (row.action, row.alternatives) == ("animated", ())
    assert row.reason == "new mesh; the policy is to build one tree for all frames always"
    row = play.show(3, None)
    assert (row.action, row.reason) == ("refitted", "positions changed, and the policy is to refit always")


def test_decisions_do_not_depend_on_threads():
    threads, ledgers = perfect_bvh.thread_count(), []
    try:
        for count in (1, 2, 4):
            perfect_bvh.set_thread_count(count)
            play = Play()
            rows = [play.commit(), *(play.show(shape) for shape in (4, 20))]
            ledgers.append([(row.action, row.reason, row.alternatives, row.cost, row.byte_count) for row in rows])
    finally:
        perfect_bvh.set_thread_count(threads)
    assert ledgers[0] == ledgers[1] == ledgers[2]
    assert ledgers[0][0][0] == "animated"


def test_it_waits_until_rays_are_known():
    play = Play()
    assert not weighs(play.commit(None))
    assert play.scene.is_current
    assert weighs(play.show(1))
    assert not weighs(play.show(2))  # it was weighed


def test_it_ends_with_its_frames():
    play = Play(is_told=False)
    play.expect(frames=2)
    for shape in (0, 1):
        assert not weighs(play.show(shape, None))
    assert not weighs(play.show(2))


def test_other_triangles_end_it():
    play = Play()
    play.scene.replace_mesh(play.mesh, play.shapes[0], play.triangles[::-1].copy())
    assert not weighs(play.commit())
    play.expect()
    play.scene.update_mesh(play.mesh, play.shapes[3])
    play.scene.update_mesh(play.mesh, play.shapes[4])
    assert play.commit().action == "animated"
    play.scene.replace_mesh(play.mesh, *meshes.sphere(6, 8))
    assert play.commit().action == "rebuilt"


def test_the_mesh_can_be_removed():
    play = Play()
    play.scene.remove_instances([0])
    play.scene.remove_mesh(play.mesh)
    assert play.scene.commit(RAYS).meshes == ()
    with pytest.raises(ValueError, match=f"expect_animation: there is no mesh with id {play.mesh}"):
        play.expect()


def test_a_mesh_may_move_within_the_shutter():
    play = Play("animate")
    play.scene.set_mesh_motion(play.mesh, play.shapes[:3])
    assert play.commit().action == "animated"
    rays = rays_at(play.shapes[1])
    still = perfect_bvh.Scene()
    still.add_instance(still.add_mesh(play.shapes[1], play.triangles))
    still.commit()
    hits = still.cast_rays(*rays)
    assert np.array_equal(play.scene.cast_rays(*rays, times=0.5).t_hit, hits.t_hit) and hits.is_hit.sum() > 10


def test_a_stopped_commit_tells_it_again():
    play = Play("animate", count=20_000)  # long enough to be asked
    with pytest.raises(perfect_bvh.Cancelled):
        play.scene.commit(progress=lambda share: False)
    assert play.commit().action == "animated"


def test_bad_input_is_named_and_changes_nothing():
    play = Play()
    cases = [
        (play.shapes[:1], 10, "positions must have 2 to 64 steps, got 1"),
        (np.zeros((65, 3, 3)), 10, "positions must have 2 to 64 steps, got 65"),
        (play.shapes[0], 10, r"positions must have shape \(S, V, 3\)"),
        (play.shapes[:, :-1], 10, "positions has 1199 rows but the mesh has 1200 vertices"),
        (np.where(play.shapes == play.shapes[3, 7, 1], np.nan, play.shapes), 10, "positions"),
        (play.shapes, 1, "frames must be"),
        (play.shapes, 2.5, "frames must be"),
        (play.shapes, True, "frames must be"),
        (play.shapes, 10**7, "frames must be"),
    ]
    for shapes, frames, words in cases:
        with pytest.raises(ValueError, match=f"expect_animation: {words}"):
            play.expect(shapes, frames)
    assert "200 frames" in play.commit().reason
    for builder in ("spatial", "sweep"):
        mesh = play.scene.add_mesh(*meshes.sphere(4, 6), build=perfect_bvh.BuildConfig(builder=builder))
        with pytest.raises(ValueError, match=f"expect_animation: mesh {mesh} is built with .*add it with build='auto'"):
            play.scene.expect_animation(mesh, np.zeros((2, 20, 3)), 5)


@pytest.mark.parametrize("kind", ["curves", "points"])
def test_curves_and_points_are_refused_by_name(kind):
    scene = perfect_bvh.Scene()
    points = np.random.default_rng(1).random((6, 3))
    mesh = scene.add_points(points, 0.1) if kind == "points" else scene.add_curves(points, 0.1, [0, 6])
    with pytest.raises(ValueError, match=f"expect_animation: mesh {mesh} must have triangles, but has {kind}"):
        scene.expect_animation(mesh, np.zeros((2, 6, 3)), 5)
