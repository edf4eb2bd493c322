"""A sensor's noise: its statistics over many rays, and that it depends on the ray and not on the caller."""

from __future__ import annotations

import math
from itertools import product
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.light_scenes import add_plate, diffuse, empty_scene, simple  # noqa: E402
from perfect_bvh_addon import Beam, Light, Noise, PointCloud, Raster, SpinningLidar, scan  # noqa: E402
from perfect_bvh_addon.scanning import stretch_sync  # noqa: E402
from perfect_bvh_addon.scanning.light.model import RayNoise, _mixed, _normal_of  # noqa: E402
from perfect_bvh_addon.scanning.point_cloud import COLUMNS  # noqa: E402

COUNT = 20_000
MASK = 2**64 - 1
MOST_SEED = 2**31 - 1


def mixed(value: int) -> int:
    """SplitMix64's finaliser, in Python's integers."""
    value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9 & MASK
    value = (value ^ (value >> 27)) * 0x94D049BB133111EB & MASK
    return value ^ (value >> 31)


def test_numbers_are_mixed_as_splitmix64_mixes_them() -> None:
    values = np.array([0, 1, 2, MASK, 1 << 63, 0x9E3779B97F4A7C15], np.uint64)
    assert _mixed(values).tolist() == [mixed(int(value)) for value in values]
    # The published generator gives this number first if its state is 0.
    assert mixed(0x9E3779B97F4A7C15) == 0xE220A8397B1DCDAF


def test_shares_become_normal_as_the_standard_librarys() -> None:
    shares = np.concatenate([np.linspace(1e-6, 1 - 1e-6, 2001), 2.0 ** -np.arange(2, 53), 1 - 2.0 ** -np.arange(2, 53)])
    exact = [NormalDist().inv_cdf(share) for share in shares.tolist()]
    assert _normal_of(shares) == pytest.approx(exact, rel=1e-6, abs=1e-6)


def test_numbers_are_spread_evenly_and_know_nothing_of_each_other() -> None:
    ids = np.arange(200_000)
    columns = [RayNoise(seed).uniform(ids, channel) for seed, channel in product((0, 1, MOST_SEED), (0, 1, 3))]
    for column in columns:
        assert column.min() > 0.0 and column.max() < 1.0
        counts = np.bincount((column * 64).astype(np.int64), minlength=64)
        chi_square = ((counts - len(ids) / 64) ** 2 / (len(ids) / 64)).sum()
        assert chi_square < 63 + 5 * math.sqrt(2 * 63)
    correlations = np.corrcoef([*columns, np.roll(columns[0], 1)])
    assert np.abs(correlations - np.eye(len(correlations))).max() < 5 / math.sqrt(len(ids))
    assert np.array_equal(RayNoise(7).uniform(ids[5:9], 2), RayNoise(7).uniform(ids, 2)[5:9])


@pytest.mark.parametrize("seed", [-1, MOST_SEED + 1, 1.0, True, "1", None])
def test_a_seed_is_a_whole_number(seed: Any) -> None:
    with pytest.raises(ValueError, match="scan: seed must be"):
        RayNoise(seed)


# Of points -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def head() -> Any:
    """A mount in front of a wall at distance 10."""
    made = empty_scene()
    add_plate(10.0, diffuse(0.5), size=400.0)
    return made


def wall_points(head: Any, noise: Noise, seed: int = 3) -> PointCloud:
    """Cast 20,000 rays in a cone so narrow that all are 10 long, within a millionth."""
    narrow = Raster(width=200, height=100, horizontal=0.02, vertical=0.02)
    return scan(narrow, head, light=Light(noise=noise), seed=seed)


def assert_normal(values: np.ndarray, mean: float, sigma: float) -> None:
    """Check mean and standard deviation within four standard errors."""
    count = len(values)
    assert abs(values.mean() - mean) < 4.0 * sigma / math.sqrt(count)
    assert abs(values.std(ddof=1) - sigma) < 4.0 * sigma / math.sqrt(2.0 * count)


def test_distances_have_their_bias_and_deviation(head) -> None:
    noise = Noise(range=0.02, range_square=0.0003, bias=0.5)
    cloud = wall_points(head, noise)
    assert len(cloud) == COUNT
    assert_normal(cloud.distances, 10.5, 0.05)
    assert np.linalg.norm(cloud.positions, axis=1) == pytest.approx(cloud.distances, rel=1e-12)
    assert np.array_equal(cloud.distances, wall_points(head, noise).distances)
    other = wall_points(head, noise, seed=4)
    assert abs(np.corrcoef(cloud.distances, other.distances)[0, 1]) < 4.0 / math.sqrt(COUNT)


def test_directions_have_their_deviation(head) -> None:
    exact, cloud = wall_points(head, Noise()), wall_points(head, Noise(angle=2.0))
    aside = (cloud.positions - exact.positions)[:, [0, 2]] / 10.0
    for axis in range(2):
        assert_normal(aside[:, axis], 0.0, 0.002)
    assert abs(np.corrcoef(aside.T)[0, 1]) < 4.0 / math.sqrt(COUNT)
    assert np.array_equal(exact.distances, cloud.distances)


def test_a_share_of_beams_is_lost(head) -> None:
    cloud = wall_points(head, Noise(dropout=0.2))
    assert abs(len(cloud) - 0.8 * COUNT) < 4.0 * math.sqrt(COUNT * 0.2 * 0.8)
    assert cloud.distances == pytest.approx(10.0, rel=1e-6)
    assert len(wall_points(head, Noise(dropout=1.0))) == 0


def test_each_line_has_a_bias_of_its_own(head) -> None:
    lidar = SpinningLidar(elevations=tuple(np.linspace(-1.0, 1.0, 200).tolist()), columns=20, sweep=1.0)
    exact, cloud = (scan(lidar, head, light=Light(noise=Noise(line_bias=each)), seed=5) for each in (0.0, 0.3))
    off = (cloud.distances - exact.distances).reshape(20, 200)
    assert np.ptp(off, axis=0).max() < 1e-12
    assert_normal(off[0], 0.0, 0.3)


# Of pieces -----------------------------------------------------------------------------------------------------------

NOISE = Noise(range=0.02, angle=1.0, dropout=0.1, bias=0.01, line_bias=0.02)
LIGHT = Light(Beam(divergence=5.0, rays=7, returns=3, keep=("strongest", "last"), resolution=0.2), noise=NOISE)


@pytest.fixture
def moving() -> tuple[Any, SpinningLidar]:
    """A mount that flies past panes, mirrors and walls, one of which moves."""
    head = empty_scene()
    add_plate(3.0, simple("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.4), size=3.0, turn=0.3)
    add_plate(-4.0, simple("ShaderNodeBsdfAnisotropic", Roughness=0.0), size=8.0, turn=0.5)
    wall = add_plate(8.0, diffuse(0.5), size=9.0)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(2.0, 1.0, 0.0))
    for obj, frame, x in ((head, 1, -1.0), (head, 5, 1.0), (wall, 1, -3.0), (wall, 5, 3.0)):
        obj.location.x = x
        obj.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    return head, SpinningLidar(elevations=tuple(np.linspace(-12.0, 12.0, 5).tolist()), columns=400)


def test_batches_and_threads_change_no_byte(moving, monkeypatch: pytest.MonkeyPatch) -> None:
    head, lidar = moving
    whole = scan(lidar, head, frames=(1, 4), light=LIGHT, seed=11)
    assert len(whole) > 700 and whole.return_counts.max() > 1
    for size, threads in ((700, 1), (64, 2)):
        monkeypatch.setattr(stretch_sync, "RAYS_IN_A_STEP", size)
        other = scan(lidar, head, frames=(1, 4), light=LIGHT, seed=11, threads=threads)
        for name in COLUMNS:
            if not name.endswith(("object_ids", "instance_ids", "material_ids")):
                assert getattr(other, name).tobytes() == getattr(whole, name).tobytes(), (name, size)


def test_parts_together_are_the_whole(moving) -> None:
    head, lidar = moving
    whole = scan(lidar, head, frames=(1, 4), light=LIGHT, seed=11)
    parts = [scan(lidar, head, frames=frames, since=1, light=LIGHT, seed=11) for frames in ((1, 1), (2, 3), (4, 4))]
    for name in COLUMNS:
        if not name.endswith(("object_ids", "instance_ids", "material_ids")):
            together = np.concatenate([getattr(part, name) for part in parts])
            assert together.tobytes() == getattr(whole, name).tobytes(), name
    other = scan(lidar, head, frames=(1, 4), light=LIGHT, seed=12)
    assert len(other) != len(whole) or (other.distances != whole.distances).any()
