"""Rays are read in place, and answers are written into the caller's arrays: the same bits as with copies."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh._arrays import ray_batch

FIELDS = tuple(perfect_bvh.hits.FIELD_TYPES)


@pytest.fixture(scope="module")
def scene():
    made = perfect_bvh.Scene()
    mesh = made.add_mesh(*meshes.soup(400, 1))
    made.add_instances([mesh] * 3, [moved(x) for x in (-1.0, 0.0, 1.5)])
    made.commit()
    return made


def moved(x):
    place = np.eye(4)
    place[0, 3] = x
    return place


def rows_of_six(shape, dtype, seed):
    """(..., 6): origins and directions side by side."""
    count = int(np.prod(shape))
    return np.concatenate(meshes.random_rays(count, seed), axis=1).reshape(*shape, 6).astype(dtype)


def assert_same(hits, expected):
    assert hits.columns.keys() == expected.columns.keys()
    for name, column in expected.columns.items():
        assert hits.columns[name].tobytes() == column.tobytes(), name


def is_read_in_place(origins, directions):
    """Whether the engine gets the memory of these arrays, all rays at once."""
    batch = ray_batch("cast_rays", origins, directions, 0.0, 1.0, 1, 0.0, "none", 0)
    pieces = list(batch.pieces(None))
    return len(pieces) == 1 and all(
        np.shares_memory(given, taken) for given, taken in zip((origins, directions), pieces[0].columns, strict=False)
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(5000,), (50, 100), (5, 10, 100)])
def test_columns_of_a_wider_array(scene, dtype, shape):
    rays = rows_of_six(shape, dtype, 7)
    origins, directions = rays[..., :3], rays[..., 3:]
    assert is_read_in_place(origins, directions)
    expected = scene.cast_rays(origins.copy(), directions.copy(), fields=FIELDS)
    assert expected.is_hit.any() and not expected.is_hit.all()
    assert_same(scene.cast_rays(origins, directions, fields=FIELDS), expected)
    occluded = scene.test_occlusions(origins, directions)
    assert np.array_equal(occluded, expected.is_hit)
    counts = scene.count_intersections(origins, directions)
    assert np.array_equal(counts > 0, expected.is_hit)


@pytest.mark.parametrize("view", ["every other row", "backwards", "transposed"])
def test_rows_in_other_orders(scene, view):
    rays = rows_of_six((60, 80), np.float32, 8)
    rays = {"every other row": rays[::2], "backwards": rays[:, ::-1], "transposed": rays.swapaxes(0, 1)}[view]
    origins, directions = rays[..., :3], rays[..., 3:]
    expected = scene.cast_rays(origins.copy(), directions.copy(), fields=FIELDS)
    assert_same(scene.cast_rays(origins, directions, fields=FIELDS), expected)


def test_rows_backwards_are_read_in_place(scene):
    rays = rows_of_six((3000,), np.float64, 9)[::-1]
    assert is_read_in_place(rays[:, :3], rays[:, 3:])
    assert is_read_in_place(rays[:, None, :3], rays[:, None, 3:])
    expected = scene.cast_rays(rays[:, :3].copy(), rays[:, 3:].copy(), fields=FIELDS)
    assert_same(scene.cast_rays(rays[:, :3], rays[:, 3:], fields=FIELDS), expected)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_one_origin_or_direction_for_all(scene, dtype):
    rays = rows_of_six((40, 50), dtype, 10)
    origin, direction = np.array((0.3, -2.0, 0.1), dtype), np.array((0.1, 1.0, -0.2), dtype)
    for origins, directions in ((origin, rays[..., 3:].copy()), (rays[..., :3].copy(), direction)):
        assert is_read_in_place(origins, directions)
        copies = [np.broadcast_to(each, (40, 50, 3)).copy() for each in (origins, directions)]
        expected = scene.cast_rays(*copies, fields=FIELDS)
        assert expected.is_hit.any() and expected.t_hit.shape == (40, 50)
        assert_same(scene.cast_rays(origins, directions, fields=FIELDS), expected)
        audited = scene.cast_rays(origins, directions, audit=1.0)
        assert audited.audit.checked_count == 2000 and len(audited.audit.wrong_rows) == 0


def test_broadcast_in_part_in_pieces(scene, monkeypatch):
    monkeypatch.setattr("perfect_bvh._arrays.PIECE_ROWS", 70)
    rays = rows_of_six((1, 50), np.float32, 11)
    origins = np.random.default_rng(12).uniform(-2.0, 2.0, (30, 1, 3)).astype(np.float32)
    copies = [np.broadcast_to(each, (30, 50, 3)).copy() for each in (origins, rays[..., 3:])]
    expected = scene.cast_rays(*copies, fields=FIELDS)
    assert_same(scene.cast_rays(origins, rays[..., 3:], fields=FIELDS), expected)


def test_no_rays_from_one_origin(scene):
    assert scene.cast_rays(np.zeros(3), np.empty((0, 3))).t_hit.shape == (0,)
    assert scene.cast_rays(np.empty((4, 0, 3)), np.ones(3)).primitive_uvs.shape == (4, 0, 2)
    assert scene.cast_rays(np.empty((0, 6))[:, ::2], np.ones(3)).t_hit.shape == (0,)


def test_memory_that_is_not_aligned_is_copied(scene):
    """Packed records, as files have them."""
    records = np.zeros(500, np.dtype([("kind", np.uint8), ("ray", np.float32, 6)]))
    records["ray"] = rows_of_six((500,), np.float32, 13)
    origins, directions = records["ray"][:, :3], records["ray"][:, 3:]
    assert not origins.flags.aligned
    expected = scene.cast_rays(origins.copy(), directions.copy(), fields=FIELDS)
    assert_same(scene.cast_rays(origins, directions, fields=FIELDS), expected)


def shifted(array):
    """The same numbers, one byte off their alignment."""
    moved = np.empty(array.nbytes + 1, np.uint8)[1:].view(array.dtype).reshape(array.shape)
    moved[...] = array
    assert not moved.flags.aligned and moved.flags.c_contiguous
    return moved


def test_contiguous_memory_that_is_not_aligned_is_copied(scene):
    rays = rows_of_six((500,), np.float64, 18)
    origin, directions, far = np.array((0.3, -2.0, 0.1)), rays[:, 3:].copy(), np.full(500, 2.0, np.float32)
    expected = scene.cast_rays(origin, directions, t_max=far, fields=FIELDS)
    assert expected.is_hit.any()
    assert_same(scene.cast_rays(shifted(origin), shifted(directions), t_max=shifted(far), fields=FIELDS), expected)


def test_hits_are_written_over_earlier_ones(scene):
    first, second = rows_of_six((40, 50), np.float32, 14), rows_of_six((40, 50), np.float32, 15)
    fields = ("t_hit", "primitive_ids", "geometric_normals")
    earlier = scene.cast_rays(first[..., :3], first[..., 3:], fields=fields)
    arrays = dict(earlier.columns)
    hits = scene.cast_rays(second[..., :3], second[..., 3:], out=earlier)
    assert all(hits.columns[name] is array for name, array in arrays.items()) and tuple(hits.columns) == fields
    assert_same(hits, scene.cast_rays(second[..., :3], second[..., 3:], fields=fields))


def test_some_arrays_are_given_and_the_others_made(scene):
    rays = rows_of_six((300,), np.float32, 16)
    given = {"t_hit": np.full(300, -1.0, np.float32), "positions": np.empty((300, 3))}
    fields = ("t_hit", "positions", "mesh_ids")
    hits = scene.cast_rays(rays[:, :3], rays[:, 3:], fields=fields, out=given)
    assert hits.t_hit is given["t_hit"] and hits.positions is given["positions"]
    assert_same(hits, scene.cast_rays(rays[:, :3], rays[:, 3:], fields=fields))


@pytest.mark.parametrize("pieces", [False, True])
def test_occlusion_is_written_where_it_is_wanted(scene, monkeypatch, pieces):
    rays = rows_of_six((30, 40), np.float32, 17)
    origins, directions = rays[..., :3], rays[..., 3:]
    expected = scene.test_occlusions(origins, directions)
    assert expected.any() and not expected.all()
    if pieces:
        monkeypatch.setattr("perfect_bvh._arrays.PIECE_ROWS", 100)
        origins = origins.astype(np.float16).astype(">f4")
        expected = scene.test_occlusions(origins.astype(np.float32), directions)
    for fill in (False, True):
        out = np.full((30, 40), fill)
        assert scene.test_occlusions(origins, directions, out=out) is out
        assert np.array_equal(out, expected)


RAYS = np.zeros((4, 3)), np.ones((4, 3))
READ_ONLY = np.zeros(4, np.bool_)
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ([False] * 4, "got list"),
        (np.zeros(4, np.uint8), "got uint8 of shape"),
        (np.zeros((4, 1), np.bool_), r"got bool of shape \(4, 1\)"),
        (np.zeros(8, np.bool_)[::2], "got bool of shape .*, one that is not contiguous"),
        (READ_ONLY, "got bool of shape .*, one that is read-only"),
    ],
)
def test_arrays_that_occlusion_cannot_be_written_into(scene, out, message):
    expected = r"test_occlusions: out must be a writable C-contiguous bool array of shape \(4,\)"
    with pytest.raises(ValueError, match=f"{expected}, {message}"):
        scene.test_occlusions(*RAYS, out=out)


def test_occlusion_is_not_written_over_the_rays(scene):
    origins = np.zeros((4, 3))
    with pytest.raises(ValueError, match="test_occlusions: out shares memory with the rays"):
        scene.test_occlusions(origins, RAYS[1], out=origins.view(np.bool_).reshape(-1)[:4])


def test_what_is_no_array_to_write_into(scene):
    with pytest.raises(ValueError, match="cast_rays: out must be a dict of arrays by the fields' names or a Hits, got"):
        scene.cast_rays(*RAYS, out=np.zeros(4, np.float32))
    earlier = scene.cast_rays(np.zeros((5, 3)), np.ones((5, 3)))
    with pytest.raises(ValueError, match=r"out\['t_hit'\] must be .* of shape \(4,\), got float32 of shape \(5,\)"):
        scene.cast_rays(*RAYS, out=earlier)
    with pytest.raises(ValueError, match="out has 'instance_ids', which is not among the fields t_hit"):
        scene.cast_rays(*RAYS, out=scene.cast_rays(*RAYS), fields=("t_hit",))


def test_hits_without_ids_and_t_say_what_is_hit_needs() -> None:
    scene = perfect_bvh.Scene()
    scene.commit()
    hits = scene.cast_rays(np.zeros((2, 3)), np.ones((2, 3)), fields=("positions",))
    with pytest.raises(AttributeError, match="it needs t_hit or an id"):
        hits.is_hit  # noqa: B018
