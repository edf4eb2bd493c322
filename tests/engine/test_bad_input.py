"""Bad input: a clear ValueError or a miss, never a crash, and never a change."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes

TRIANGLE = (np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32), np.array([(0, 1, 2)], np.int32))
NAN, INF = np.nan, np.inf


@pytest.fixture
def scene():
    made = perfect_bvh.Scene()
    made.add_instance(made.add_mesh(*TRIANGLE))
    made.commit()
    return made


@pytest.mark.parametrize(
    ("positions", "triangles", "message"),
    [
        (np.zeros((3, 2)), TRIANGLE[1], r"add_mesh: positions must have shape \(V, 3\)"),
        (TRIANGLE[0], np.zeros((1, 4), int), r"add_mesh: triangles must have shape \(T, 3\)"),
        (TRIANGLE[0], np.array([[0, 1, 512]]), r"triangles\[0\] refers to vertex 512 but positions has 3 rows"),
        (TRIANGLE[0], np.array([[0, 1, -1]]), r"triangles\[0\] refers to vertex -1"),
        (TRIANGLE[0], np.array([[0.0, 1.0, 2.0]]), "triangles must hold integers"),
        (TRIANGLE[0], np.array([[0, 1, 2**40]]), "triangles has values outside"),
        (TRIANGLE[0] * NAN, TRIANGLE[1], r"positions\[0\] is not finite"),
        (TRIANGLE[0] + (0, INF, 0), TRIANGLE[1], r"positions\[0\] is not finite"),
        (TRIANGLE[0] * 1e30, TRIANGLE[1], "below 1e18"),
        ("abc", TRIANGLE[1], "must hold numbers"),
        ([[1, 2, 3], [4, 5]], TRIANGLE[1], "not a regular array"),
    ],
)
def test_meshes(scene, positions, triangles, message):
    with pytest.raises(ValueError, match=message):
        scene.add_mesh(positions, triangles)
    assert scene.is_current and scene.mesh_count == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.add_mesh(*TRIANGLE, build="best"), "build must be 'auto' or a BuildConfig"),
        (lambda s: s.add_mesh(*TRIANGLE, usage="still"), "usage must be"),
        (lambda s: s.add_instance(7), "add_instances: there is no mesh with id 7"),
        (lambda s: s.add_instance(0, np.eye(3)), "transforms must have shape"),
        (lambda s: s.add_instance(0, np.eye(4) * NAN), "transforms must be affine"),
        (lambda s: s.add_instance(0, np.full((3, 4), INF)), r"transforms\[0\] must be finite and at most 1e18"),
        (lambda s: s.add_instance(0, np.diag([1e40, 1.0, 1.0, 1.0])), r"transforms\[0\] must be finite and at"),
        (lambda s: s.set_transforms([0], [np.diag([1e300, 1.0, 1.0, 1.0])]), r"transforms\[0\] must be finite"),
        (lambda s: s.add_instance(0, mask=-1), "masks has values outside"),
        (lambda s: s.add_instances([0, 0], np.eye(4)[None]), "transforms must have 2 rows, one an instance, got 1"),
        (lambda s: s.set_transforms([0, 5], np.stack([np.eye(4)] * 2)), "no instance with id 5"),
        (lambda s: s.set_masks([0], [1, 2]), "masks must have shape"),
        (lambda s: s.remove_instances([0, 9]), "no instance with id 9"),
        (lambda s: s.remove_mesh(0), "still used by 1 instances"),
        (lambda s: s.update_mesh(0, np.zeros((4, 3))), "positions has 4 rows but the mesh has 3"),
        (lambda s: s.update_mesh(3, np.zeros((4, 3))), "no mesh with id 3"),
    ],
)
def test_edits_check_everything_before_they_change_anything(scene, call, message):
    with pytest.raises(ValueError, match=message):
        call(scene)
    assert scene.is_current and (scene.mesh_count, scene.instance_count) == (1, 1)


@pytest.mark.skipif(np.finfo(np.longdouble).max == np.finfo(float).max, reason="a long double is a double here")
def test_what_no_double_holds_is_refused_without_a_warning(scene):
    """Warnings are errors in these tests."""
    huge = np.longdouble("1e4000")
    place = np.eye(4, dtype=np.longdouble)
    place[0, 3] = huge
    with pytest.raises(ValueError, match=r"positions\[0\] is not finite"):
        scene.add_mesh(TRIANGLE[0] + huge, TRIANGLE[1])
    with pytest.raises(ValueError, match="transforms"):
        scene.set_transforms([0], place[None])
    with pytest.raises(ValueError, match="time_range must rise by 1e-6 or more"):
        scene.set_mesh_motion(0, np.stack([TRIANGLE[0]] * 2), (0.0, huge))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"origins": np.zeros((2, 4))}, r"origins must have shape \(\.\.\., 3\)"),
        ({"origins": np.zeros((2, 3)), "directions": np.zeros((3, 3))}, "do not fit together"),
        ({"origins": np.zeros((2, 3)), "t_max": np.zeros(3)}, r"t_max must be .* got shape \(3,\)"),
        ({"mask": 1.5}, "mask must hold integers"),
        ({"mask": 2**32}, "mask has values outside"),
        ({"cull": "both"}, "cull must be one of none, back; got 'both'"),
        ({"cull": "front"}, "cull must be one of none, back; got 'front'"),
        ({"threads": -1}, "threads must be"),
        ({"threads": 1.5}, "threads must be"),
        ({"origins": [["a", "b", "c"]]}, "must hold numbers"),
    ],
)
def test_queries(scene, arguments, message):
    usual = {"origins": np.zeros((1, 3)), "directions": np.ones((1, 3))}
    for query in (scene.cast_rays, scene.test_occlusions, scene.count_intersections, scene.list_intersections):
        with pytest.raises(ValueError, match=message):
            query(**{**usual, **arguments})


def test_unknown_arguments(scene):
    camera = perfect_bvh.Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    for call in (
        lambda **how: scene.cast_rays(np.zeros((1, 3)), np.ones((1, 3)), **how),
        lambda **how: scene.test_occlusions(np.zeros((1, 3)), np.ones((1, 3)), **how),
        lambda **how: perfect_bvh.render(scene, camera, size=(2, 2), **how),
    ):
        call()
        for name in ("precision", "strategy", "policy"):
            with pytest.raises(TypeError, match=name):
                call(**{name: "fast"})
    for add in (
        lambda **how: scene.add_mesh(np.zeros((3, 3)), [[0, 1, 2]], **how),
        lambda **how: scene.add_points(np.zeros((1, 3)), 1.0, **how),
        lambda **how: scene.add_curves(np.zeros((2, 3)), 1.0, [0, 2], **how),
    ):
        add()
        with pytest.raises(TypeError, match="lazy"):
            add(lazy=True)
    with pytest.raises(TypeError, match="policy"):
        perfect_bvh.Scene(policy="refit")
    with pytest.raises(TypeError, match="traversal_cost"):
        scene.statistics(traversal_cost=1.0)


def test_unknown_field(scene):
    with pytest.raises(ValueError, match="unknown field 'depth'"):
        scene.cast_rays(np.zeros((1, 3)), np.ones((1, 3)), fields=("depth",))


def test_one_field_needs_no_tuple(scene):
    assert list(scene.cast_rays(np.zeros((1, 3)), np.ones((1, 3)), fields="mesh_ids").columns) == ["mesh_ids"]


@pytest.mark.parametrize("audit", [-0.1, 1.5, NAN])
def test_audit_is_a_share(scene, audit):
    with pytest.raises(ValueError, match="cast_rays: audit must be a number from 0 to 1, got"):
        scene.cast_rays(np.zeros((1, 3)), np.ones((1, 3)), audit=audit)


RAYS = np.zeros((4, 3)), np.ones((4, 3))
SHARED = np.zeros(8, np.int32)


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ({"positions": np.empty((4, 3))}, "out has 'positions', which is not among the fields"),
        ({"t_hit": [0.0] * 4}, r"out\['t_hit'\] must be .* got list"),
        ({"t_hit": np.empty(4)}, "must be a writable C-contiguous float32 array .* got float64"),
        ({"t_hit": np.empty(5, np.float32)}, r"of shape \(4,\), got float32 of shape \(5,\)"),
        ({"t_hit": np.empty(8, np.float32)[::2]}, "C-contiguous"),
        ({"mesh_ids": SHARED[:4], "instance_ids": SHARED[3:7]}, "shares memory"),
    ],
)
def test_arrays_to_write_into(scene, out, message):
    with pytest.raises(ValueError, match=f"cast_rays: out.*{message}|cast_rays: {message}"):
        scene.cast_rays(*RAYS, out=out)


def test_hits_are_not_written_over_the_rays(scene):
    origins = np.zeros((4, 3))
    with pytest.raises(ValueError, match=r"out\['positions'\] shares memory with the rays"):
        scene.cast_rays(origins, RAYS[1], fields=("positions",), out={"positions": origins})
    halves = {"mesh_ids": SHARED[:4], "instance_ids": SHARED[4:]}
    assert scene.cast_rays(*RAYS, out=halves).mesh_ids.base is SHARED


INVALID = [
    ((NAN, 0, 1), (0, 0, -1), 0.0, INF),
    ((INF, 0, 1), (0, 0, -1), 0.0, INF),
    ((0.2, 0.2, 1), (0, NAN, -1), 0.0, INF),
    ((0.2, 0.2, 1), (0, 0, -INF), 0.0, INF),
    ((0.2, 0.2, 1), (0, 0, 0), 0.0, INF),
    ((0.2, 0.2, 1), (-0.0, 0, 0), 0.0, INF),
    ((0.2, 0.2, 1), (0, 0, -1), 2.0, 0.0),
    ((0.2, 0.2, 1), (0, 0, -1), NAN, INF),
    ((0.2, 0.2, 1), (0, 0, -1), 0.0, NAN),
]


@pytest.mark.parametrize(("origin", "direction", "t_min", "t_max"), INVALID)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_invalid_rays_are_misses(scene, origin, direction, t_min, t_max, dtype):
    origins, directions = np.array([origin, (0.2, 0.2, 1)], dtype), np.array([direction, (0, 0, -1)], dtype)
    hits = scene.cast_rays(origins, directions, t_min=[t_min, 0.0], t_max=[t_max, INF])
    assert hits.is_hit.tolist() == [False, True] and hits.invalid_count == 1
    assert scene.test_occlusions(origins, directions, t_min=[t_min, 0], t_max=[t_max, INF]).tolist() == [False, True]
    fields = scene.cast_rays(
        origins, directions, t_min=[t_min, 0.0], t_max=[t_max, INF], fields=("t_hit", "distances", "positions")
    )
    assert fields.t_hit.tolist() == fields.distances.tolist() == [INF, 1.0]
    np.testing.assert_allclose(fields.positions, [(0, 0, 0), (0.2, 0.2, 0)], rtol=0, atol=1e-7)


@pytest.mark.parametrize(("origin", "direction", "t_min", "t_max"), INVALID)
def test_invalid_rays_meet_nothing(scene, origin, direction, t_min, t_max):
    rays = np.array([origin, (0.2, 0.2, 1)]), np.array([direction, (0, 0, -1)])
    limits = {"t_min": [t_min, 0.0], "t_max": [t_max, INF]}
    assert scene.count_intersections(*rays, **limits).tolist() == [0, 1]
    hits, splits = scene.list_intersections(*rays, **limits)
    assert splits.tolist() == [0, 0, 1] and hits.invalid_count == 1


def nothing_to_hit():
    empty, bare, placed = perfect_bvh.Scene(), perfect_bvh.Scene(), perfect_bvh.Scene()
    bare.add_mesh(*TRIANGLE)
    placed.add_instance(placed.add_mesh(np.zeros((3, 3)), np.zeros((0, 3), int)))
    masked = perfect_bvh.Scene()
    masked.add_instance(masked.add_mesh(*TRIANGLE), mask=0)
    for made in (empty, bare, placed, masked):
        made.commit()
    return empty, bare, placed, masked


@pytest.mark.parametrize("count", [0, 1, 5000])
def test_scenes_with_nothing_to_hit(count):
    rays = np.zeros((count, 3)) + (0.2, 0.2, 1.0), (0.0, 0.0, -1.0)
    for made in nothing_to_hit():
        assert not made.cast_rays(*rays).is_hit.any()
        assert not made.test_occlusions(*rays).any()
        assert not made.count_intersections(*rays).any()
        hits, splits = made.list_intersections(*rays)
        assert len(hits.t_hit) == 0 and splits.tolist() == [0] * (count + 1)
        assert not made.compute_closest_points(rays[0]).is_found.any()


def test_a_mask_of_no_bits_sees_nothing(scene):
    rays = np.zeros((3, 3)) + (0.2, 0.2, 1.0), (0.0, 0.0, -1.0)
    mask = [0, 1, 0]
    expected = [False, True, False]
    assert scene.cast_rays(*rays, mask=mask).is_hit.tolist() == expected
    assert scene.test_occlusions(*rays, mask=mask).tolist() == expected
    assert scene.count_intersections(*rays, mask=mask).tolist() == [0, 1, 0]
    assert scene.compute_closest_points(rays[0], mask=mask).is_found.tolist() == expected


def test_nested_boxes_100000_deep():
    """Each triangle around the next: no split separates them, and every ray goes through all of them."""
    count = 100_000
    sizes = np.linspace(1.0, 2.0, count, dtype=np.float32)[:, None, None]
    corners = sizes * np.array([(-2, -2, 0), (2, -2, 0), (0, 2, 0)], np.float32)
    corners[:, :, 2] = np.linspace(0.0, 1.0, count, dtype=np.float32)[:, None]
    made = perfect_bvh.Scene()
    made.add_instance(made.add_mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)))
    made.commit()
    down = np.array([(0.0, 0.0, 9.0)]), np.array([(0.0, 0.0, -1.0)])
    assert made.cast_rays(*down).t_hit.tolist() == [8.0]
    assert made.count_intersections(*down).tolist() == [count]
    hits, _ = made.list_intersections(*down, fields=("t_hit", "primitive_ids"))
    assert hits.primitive_ids.tolist() == list(range(count - 1, -1, -1))
    assert made.compute_closest_points([(0.0, 0.0, 9.0)]).primitive_ids.tolist() == [count - 1]


@pytest.mark.parametrize(
    "direction", [(0, 0, -1e-45), (0, 0, -1e-310), (0, 0, -3e38), (1e-45, 1e-45, -1e-45), (0, 0, -1e300)]
)
def test_extreme_directions_never_crash(scene, direction):
    hits = scene.cast_rays(
        np.array([(0.2, 0.2, 1.0)]), np.array([direction]), fields=("t_hit", "mesh_ids", "distances")
    )
    assert hits.is_hit[0] == np.isfinite(hits.t_hit[0]) == np.isfinite(hits.distances[0])
    assert not np.isnan(hits.distances[0])


def test_array_layouts(scene):
    """Strided, Fortran-ordered, read-only, big-endian and integer arrays answer alike."""
    origins = np.random.default_rng(0).uniform(0, 0.4, (40, 3)) + (0, 0, 1)
    directions = np.broadcast_to((0.0, 0.0, -1.0), origins.shape)
    expected = scene.cast_rays(origins, directions).t_hit
    read_only = origins.copy()
    read_only.flags.writeable = False
    variants = [
        np.asfortranarray(origins),
        np.repeat(origins, 2, axis=0)[::2],
        read_only,
        origins.astype(">f8"),
        origins.tolist(),
    ]
    for variant in variants:
        assert np.array_equal(scene.cast_rays(variant, directions).t_hit, expected)
    whole = scene.cast_rays(np.array([[0, 0, 3]]), np.array([[0, 0, -1]]))
    assert whole.t_hit[0] == 3.0


def test_degenerate_triangles_are_harmless():
    positions, triangles = meshes.sphere(10, 12)
    flat = np.stack([triangles[:, 0], triangles[:, 0], triangles[:, 1]], axis=1)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, np.concatenate([flat, triangles])))
    scene.commit()
    hits = scene.cast_rays(np.zeros((500, 3)), np.random.default_rng(1).normal(size=(500, 3)))
    assert hits.is_hit.all() and hits.primitive_ids.min() >= len(flat)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 1000])
def test_identical_triangles(count):
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(TRIANGLE[0], np.repeat(TRIANGLE[1], count, axis=0)))
    scene.commit()
    assert scene.cast_rays([(0.2, 0.2, 1)], [(0, 0, -1)]).primitive_ids[0] == 0


@pytest.mark.parametrize(
    "settings",
    [
        {"builder": "best"},
        {"bins": 1},
        {"bins": 16.5},
        {"max_leaf_size": "8"},
        {"axes": 2},
        {"max_leaf_size": 0},
    ],
)
def test_build_settings(settings):
    with pytest.raises(ValueError, match="BuildConfig"):
        perfect_bvh.BuildConfig(**settings)
