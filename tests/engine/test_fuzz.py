"""Any array in, never a crash: an answer of the right shape or a ValueError that names the function.

Examples are derived from the code alone, so that a run repeats.
"""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from oracles.brute_force import WorldTriangles, certain_hits, judge
from oracles.closest_point import distances_to_triangles

# A failure is shown as it was found: making it small takes minutes.
repeatable = settings(
    derandomize=True, deadline=None, max_examples=80, database=None, phases=(Phase.explicit, Phase.generate)
)
oracle = settings(repeatable, max_examples=40)

DTYPES = st.sampled_from([np.float16, np.float32, ">f4", np.float64, ">f8", np.int8, np.uint16, np.int64, np.bool_])
STRANGE = st.sampled_from(["U2", "S3", "complex64", "datetime64[s]", "O"])
VALUES = st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.25, 1e-45, 1e-310, 3e38, 1e300, -1e19, np.inf, -np.inf, np.nan])
SIZES = st.lists(st.integers(0, 4), max_size=3).map(tuple)
THREE = st.just(3)
LAYOUTS = st.sampled_from(["C", "F", "reversed", "strided", "read-only", "broadcast", "list"])


def lay_out(array, layout):
    if layout == "F":
        return np.asfortranarray(array)
    if layout == "reversed" and array.ndim:
        return array[::-1]
    if layout == "strided" and array.ndim:
        return np.repeat(array, 2, axis=0)[::2]
    if layout == "read-only":
        array.flags.writeable = False
    if layout == "broadcast" and array.ndim > 1 and len(array):
        return np.broadcast_to(array[:1], array.shape)
    return array.tolist() if layout == "list" else array


@st.composite
def arrays(draw, last=THREE, dtypes=DTYPES):
    width = draw(last)
    shape = draw(SIZES) + (() if width is None else (width,))
    dtype = np.dtype(draw(dtypes))
    if dtype.kind in "OUScM":
        return np.zeros(shape, dtype)
    values = np.array(draw(st.lists(VALUES, min_size=1, max_size=8)))
    with np.errstate(all="ignore"):
        array = np.resize(values, shape)
        if dtype.kind in "iub":
            array = np.nan_to_num(array, posinf=2.0, neginf=-2.0).clip(0 if dtype.kind == "u" else -100, 100)
        array = np.asarray(array, dtype)  # a number would become a scalar
    return lay_out(array, draw(LAYOUTS))


anything = st.one_of(
    arrays(), arrays(), arrays(last=st.sampled_from([None, 0, 2, 4])), arrays(dtypes=STRANGE), st.none(), st.text()
)
numbers = st.one_of(
    VALUES, arrays(last=st.none()), arrays(last=st.sampled_from([1, 2])), st.none(), st.text(max_size=2)
)
bits = arrays(last=st.none(), dtypes=st.sampled_from([np.int64, np.uint8, np.float32]))
masks = st.one_of(st.integers(-1, 2**33), bits)
culls = st.sampled_from(["none", "back", "front", "both", "", None])


@pytest.fixture(scope="module")
def scene():
    made = perfect_bvh.Scene()
    corners = np.random.default_rng(1).normal(size=(30, 3)).astype(np.float32)
    mesh = made.add_mesh(corners, np.arange(30).reshape(-1, 3), build=perfect_bvh.BuildConfig(builder="spatial"))
    shear = np.array([[1.0, 0.5, 0, 0], [0, -2.0, 0, 1], [0, 0, 0.1, 0]])
    for transform in (None, shear, np.diag([1.0, 1.0, 0.0, 1.0])):
        made.add_instance(mesh, transform)
    made.commit()
    return made


def ask(query, name, *arguments, **keywords):
    """The answer, or None after an error that says where it happened."""
    try:
        return query(*arguments, **keywords)
    except ValueError as error:
        message = str(error)
    assert message.startswith(f"{name}: ")
    return None


@repeatable
@given(origins=anything, directions=anything, t_min=numbers, t_max=numbers, mask=masks, cull=culls)
def test_rays_of_any_kind(scene, origins, directions, t_min, t_max, mask, cull):
    arguments = (origins, directions, t_min, t_max, mask, cull)
    hits = ask(scene.cast_rays, "cast_rays", *arguments)
    occluded = ask(scene.test_occlusions, "test_occlusions", *arguments)
    counts = ask(scene.count_intersections, "count_intersections", *arguments)
    found = ask(scene.list_intersections, "list_intersections", *arguments, max_hits=2)
    assert (hits is None) == (occluded is None) == (counts is None) == (found is None)
    if hits is None:
        return
    shape = np.broadcast_shapes(np.shape(origins), np.shape(directions))[:-1]
    assert hits.t_hit.shape == occluded.shape == counts.shape == shape
    assert np.array_equal(hits.is_hit, occluded) and np.array_equal(hits.is_hit, counts > 0)
    assert not np.isnan(hits.t_hit).any() and not np.isnan(found.hits.t_hit).any()
    assert np.array_equal(np.diff(found.ray_splits), np.minimum(counts.reshape(-1), 2))
    assert found.hits.invalid_count == hits.invalid_count <= occluded.size


@repeatable
@given(points=anything, max_distance=numbers, mask=masks)
def test_points_of_any_kind(scene, points, max_distance, mask):
    found = ask(scene.compute_closest_points, "compute_closest_points", points, max_distance, mask)
    if found is None:
        return
    assert found.distances.shape == np.shape(points)[:-1]
    assert not np.isnan(found.distances).any() and np.isfinite(found.points).all()
    assert np.array_equal(np.isfinite(found.distances), found.is_found)


@repeatable
@given(positions=anything, triangles=anything, transform=st.one_of(st.none(), anything, arrays(last=st.just(4))))
def test_edits_of_any_kind(positions, triangles, transform):
    made = perfect_bvh.Scene()
    mesh = ask(made.add_mesh, "add_mesh", positions, triangles)
    if mesh is not None and ask(made.add_instance, "add_instances", mesh, transform) is not None:
        made.commit()
        made.cast_rays(np.zeros((4, 3)), np.eye(4)[:, :3])
    assert made.mesh_count == (mesh is not None)


coordinates = st.sampled_from([0.0, 1.0, -1.0, 0.5, 0.25, 1.0 + 2.0**-23, 1e-7, -1e-3, 3.0, 0.1])
scales = st.sampled_from([1e-20, 1e-6, 1.0, 1e5, 1e12])


@oracle
@given(
    corners=hnp.arrays(np.float32, (12, 3), elements=coordinates.map(np.float32)),
    triangles=hnp.arrays(np.int32, (10, 3), elements=st.integers(0, 11)),
    rays=hnp.arrays(np.float32, (2, 40, 3), elements=coordinates.map(np.float32)),
    scale=scales,
    builder=st.sampled_from(["auto", "median", "spatial", "fast"]),
    lazy=st.booleans(),
)
def test_meshes_of_any_kind_against_the_oracle(corners, triangles, rays, scale, builder, lazy):
    """Coincident, degenerate, flat and thin triangles, rays on their planes, edges and corners, at any size."""
    positions, (origins, targets) = (array * np.float32(scale) for array in (corners, rays))
    directions = targets - origins
    made = perfect_bvh.Scene()
    build = builder if builder == "auto" else perfect_bvh.BuildConfig(builder=builder)
    ident = made.add_instance(made.add_mesh(positions, triangles, build=build, lazy=lazy))
    made.commit()
    world = WorldTriangles.of([(ident, positions, triangles, np.eye(4), 0xFFFFFFFF)])
    hits = made.cast_rays(origins, directions)
    valid = np.any(directions != 0.0, axis=1)
    assert hits.invalid_count == (~valid).sum() and not hits.is_hit[~valid].any()
    sent = origins[valid], directions[valid]
    with np.errstate(all="ignore"):
        verdict = judge(world, *sent, hits.t_hit[valid], hits.instance_ids[valid], hits.primitive_ids[valid])
    assert not verdict.wrong.any(), str(verdict)
    every, splits = made.list_intersections(*sent)
    with np.errstate(all="ignore"):
        sure, possible, _, _ = certain_hits(world, *sent)
    listed = np.zeros(sure.shape, int)
    np.add.at(listed, (np.repeat(np.arange(len(sure)), np.diff(splits)), every.primitive_ids), 1)
    assert listed.max(initial=0) <= 1 and not (sure & (listed == 0)).any() and not ((listed == 1) & ~possible).any()
    found = made.compute_closest_points(origins)
    expected = distances_to_triangles(origins, positions[triangles]).min(axis=1)
    assert np.abs(found.distances - expected).max() <= 1e-12 * 10.0 * scale
