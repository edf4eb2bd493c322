"""Audits agree with the double-precision oracle, find wrong answers, and cost in proportion to the checked rays."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge

SHEAR = np.array([[1.0, 0.7, 0.0, 0.3], [0.0, 0.4, 0.2, -0.2], [0.1, 0.0, 1.9, 0.1], [0.0, 0.0, 0.0, 1.0]])
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def scene_and_triangles():
    soup, ball = meshes.soup(150, 3), meshes.sphere(12, 16, 0.6)
    soup, ball = ((mesh[0].astype(np.float32), mesh[1]) for mesh in (soup, ball))
    scene = perfect_bvh.Scene()
    parts = []
    for mesh, transform, mask in ((soup, SHEAR, 1), (soup, MIRROR, 2), (ball, np.eye(4), 4)):
        parts.append((scene.add_instance(scene.add_mesh(*mesh), transform, mask), *mesh, transform, mask))
    scene.commit()
    return scene, WorldTriangles.of(parts)


@pytest.mark.parametrize("cull", ["none", "back"])
def test_right_answers_pass(scene_and_triangles, cull):
    scene, _ = scene_and_triangles
    random = np.random.default_rng(4)
    rays = meshes.random_rays(3000, 5)
    t_min = random.uniform(0.0, 0.5, 3000).astype(np.float32)
    mask = random.integers(0, 8, 3000, dtype=np.uint32)
    hits = scene.cast_rays(*rays, t_min=t_min, t_max=t_min + np.float32(1.5), mask=mask, cull=cull, audit=1.0)
    assert hits.is_hit.sum() > 300
    assert hits.audit.checked_count == 3000
    assert hits.audit.wrong_rows.size == 0
    assert 0 <= hits.audit.ambiguous_count < 300


def test_triangles_tiny_beside_their_distance_raise_no_alarm():
    size = 0.985 ** np.arange(3000)
    zero = np.zeros_like(size)
    corners = np.stack([(zero, zero, zero), (size, zero, size), (zero, size, size)]).transpose(2, 0, 1)
    positions = corners.reshape(-1, 3).astype(np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3)))
    scene.commit()
    random = np.random.default_rng(13)
    origins = random.uniform(-1.0, 1.0, (300, 3))
    towards = corners[random.integers(0, len(corners), 300)].mean(axis=1)
    assert scene.cast_rays(origins, towards - origins, audit=1.0).audit.wrong_rows.size == 0


def spoil(hits: perfect_bvh.Hits) -> list[np.ndarray]:
    """Answers of which many are wrong in one of several ways: t, triangle, instance, missed, invented."""
    random = np.random.default_rng(6)
    columns = [hits.t_hit.copy(), hits.instance_ids.copy(), hits.primitive_ids.copy()]
    t_hit, instance_ids, primitive_ids = columns
    kind = random.integers(0, 10, len(t_hit))
    t_hit[kind == 0] *= np.float32(1.0 + 1e-4)
    primitive_ids[(kind == 1) & hits.is_hit] = 7
    instance_ids[(kind == 2) & hits.is_hit] = 1
    for column, value in zip(columns, (np.inf, -1, -1), strict=True):
        column[kind == 3] = value
    invented = (kind == 4) & ~hits.is_hit
    for column, value in zip(columns, (1.0, 2, 0), strict=True):
        column[invented] = value
    return columns


def audit_natively(scene, origins, directions, columns) -> tuple[np.ndarray, np.ndarray]:
    """Which answers are wrong, and which rays are ambiguous."""
    limits = (np.zeros(1, np.float32), np.full(1, np.inf, np.float32), np.full(1, 0xFFFFFFFF, np.uint32))
    core = scene.snapshot()._committed()
    times = np.zeros(1, np.float32)
    verdicts = core.audit_answers((origins, directions, *limits, times, "none"), *columns, 0, None)
    return verdicts & 1 != 0, verdicts & 2 != 0


def test_wrong_answers_are_found_as_the_oracle_finds_them(scene_and_triangles):
    scene, triangles = scene_and_triangles
    rays = meshes.random_rays(4000, 8)
    columns = spoil(scene.cast_rays(*rays))
    verdict = judge(triangles, *rays, *columns)
    wrong, ambiguous = audit_natively(scene, *rays, columns)
    assert verdict.wrong.sum() > 500
    # The two take a different margin: the audit's is that of boxes, a little wider.
    unlike = wrong != verdict.wrong
    assert not (unlike & ~(ambiguous | verdict.ambiguous)).any()
    assert unlike.sum() <= 4


def test_share(scene_and_triangles):
    scene, _ = scene_and_triangles
    rays = meshes.random_rays(20000, 9)
    audit = scene.cast_rays(*rays, fields="mesh_ids", audit=0.05).audit
    assert 800 < audit.checked_count < 1200
    assert scene.cast_rays(*rays, audit=0.05).audit.ambiguous_count == audit.ambiguous_count
    assert scene.cast_rays(*rays).audit is None


def test_answers_are_those_of_the_same_rays_without_an_audit(scene_and_triangles):
    scene, _ = scene_and_triangles
    rays = meshes.random_rays(1000, 10)
    plain, audited = (scene.cast_rays(*rays, fields="primitive_ids", audit=share) for share in (0.0, 0.5))
    assert list(audited.columns) == ["primitive_ids"]
    assert np.array_equal(plain.primitive_ids, audited.primitive_ids)


def test_broadcast_strided_and_invalid_rays(scene_and_triangles):
    scene, _ = scene_and_triangles
    directions = meshes.random_rays(600, 11)[1].reshape(20, 30, 3)[:, ::-1]
    directions[3, 4] = np.nan
    hits = scene.cast_rays(np.array([0.0, -3.0, 0.0]), directions, audit=1.0)
    assert hits.audit.checked_count == 600
    assert hits.audit.wrong_rows.size == 0
    one = scene.cast_rays([0.0, -3.0, 0.0], [0.0, 1.0, 0.0], audit=1.0)
    assert one.audit.checked_count == 1
    assert scene.cast_rays(np.empty((0, 3)), np.empty((0, 3)), audit=1.0).audit.checked_count == 0


def test_interval():
    """Wilson's interval, worked out by hand for none of 1,000 and for half of 100."""
    none = perfect_bvh.Audit(1000, np.empty(0, np.int64), 0)
    assert none.interval[0] == 0.0
    assert none.interval[1] == pytest.approx(3826.8, abs=0.1)
    half = perfect_bvh.Audit(100, np.arange(50), 0)
    assert half.wrong_per_million == 5e5
    assert half.interval == pytest.approx((403_831.5, 596_168.5), abs=1.0)
    assert perfect_bvh.Audit(0, np.empty(0, np.int64), 0).interval == (0.0, 1e6)
    assert "1,000 rays checked, 0 wrong" in str(none)


def test_progress_and_cancel():
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.sphere(200, 300)))
    scene.commit()
    rays = meshes.random_rays(20_000, 12)
    with pytest.raises(perfect_bvh.Cancelled):  # after half of it, which is the rays, come seconds of audit
        scene.cast_rays(*rays, audit=1.0, threads=1, progress=lambda done: done < 0.5)


# Of renders ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def camera() -> perfect_bvh.Camera:
    return perfect_bvh.Camera.look_at((0.0, -3.0, 1.0), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("mode", ["clay", "normal", "depth"])
@pytest.mark.parametrize("samples", [1, 5])
def test_a_render_can_be_audited(scene_and_triangles, camera, mode, samples):
    scene, _ = scene_and_triangles
    audit = perfect_bvh.RenderAudit(0.1)
    image = perfect_bvh.render(scene, camera, mode, (80, 45), samples, audit=audit)
    ray_count = 80 * 45 * (1 if mode == "depth" else samples)
    assert 0.07 * ray_count < audit.result.checked_count < 0.13 * ray_count
    assert audit.result.wrong_rows.size == 0
    assert audit.seconds > 0.0
    np.testing.assert_array_equal(image, perfect_bvh.render(scene, camera, mode, (80, 45), samples))


def test_the_rays_of_an_audit_do_not_depend_on_threads_or_rounds(scene_and_triangles, camera):
    scene, _ = scene_and_triangles
    audits = [perfect_bvh.RenderAudit(0.2) for _ in range(3)]
    for threads, audit in enumerate(audits[:2], 1):
        perfect_bvh.render(scene, camera, "normal", (80, 45), 4, threads=threads, audit=audit)
    for _ in perfect_bvh.render_progressively(scene, camera, mode="normal", size=(80, 45), samples=4, audit=audits[2]):
        pass
    assert audits[0].result.checked_count == audits[1].result.checked_count
    # The first of several rounds uses the pixels' centres: the same rows, though not quite the same rays.
    assert audits[0].result.checked_count == audits[2].result.checked_count


def test_an_audit_of_a_render_finds_what_is_wrong(scene_and_triangles, camera, monkeypatch):
    """Every answer that a render keeps is taken away or moved before it is checked."""
    scene, _ = scene_and_triangles
    honest = perfect_bvh._core.render
    truth = {}

    def lie(*arguments):
        kept = honest(*arguments)
        truth["hit"] = kept["instance_ids"] >= 0
        truth["pixels"] = kept["pixels"]
        kept["t_hit"][::2] *= np.float32(1.01)
        kept["t_hit"][1::2] = np.inf
        kept["instance_ids"][1::2] = kept["primitive_ids"][1::2] = -1
        return kept

    monkeypatch.setattr(perfect_bvh._core, "render", lie)
    audit = perfect_bvh.RenderAudit(1.0)
    perfect_bvh.render(scene, camera, "normal", (60, 40), audit=audit)
    sure = truth["hit"].sum() - audit.result.ambiguous_count
    assert sure > 100
    assert sure <= len(audit.result.wrong_rows) <= truth["hit"].sum()
    assert set(audit.result.wrong_rows) <= set(truth["pixels"][truth["hit"]])


@pytest.mark.parametrize("share", [0.0, -1.0, 1.5, float("nan")])
def test_an_impossible_share_is_refused(share):
    with pytest.raises(ValueError, match="RenderAudit: share must be a number above 0 and up to 1, got"):
        perfect_bvh.RenderAudit(share)


def test_what_no_float_holds_is_no_answer_that_is_missing() -> None:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], [(0, 1, 2)]))
    scene.commit()
    hit = scene.cast_rays([0, 0, 5.0], [0, 0, -1e-39], audit=1.0)
    assert not hit.is_hit
    assert hit.audit.wrong_rows.size == 0


def test_needles_whose_normal_is_noise_are_not_judged() -> None:
    random = np.random.default_rng(18)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh([(0, 0, 0), (3, 3, 3), (1, 1, 1)], [(0, 1, 2)])
    wrong = 0
    for _ in range(100):
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        place = np.column_stack([turn, random.normal(size=3)])
        instance = scene.add_instance(mesh, place)
        scene.commit()
        targets = np.concatenate(
            [place[:, 3] + (turn @ np.ones(3)) * random.uniform(0, 3, (50, 1)), [place[:, 3]] * 50]
        )
        directions = random.normal(size=(100, 3))
        directions[::4] = turn @ np.ones(3)  # along it
        wrong += scene.cast_rays(targets - directions, directions, audit=1.0).audit.wrong_rows.size
        scene.remove_instances([instance])
    assert wrong == 0


@pytest.mark.parametrize("exponent", [-120, 0, 126, 140, 149, 160])
def test_a_t_that_is_hardly_a_float_raises_no_alarm(exponent: int) -> None:
    """Floats below 2^-126 have few bits."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], np.float32), [[0, 1, 2]]))
    scene.commit()
    hits = scene.cast_rays([[0, 0, 1.0]], [[0, 0, -1.5 * 2.0**exponent]], audit=1.0)
    assert hits.is_hit.all() and hits.audit.wrong_rows.size == 0 and hits.audit.checked_count == 1
