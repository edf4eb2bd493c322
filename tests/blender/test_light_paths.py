"""Paths of light through hundreds of sheets, and between mirrors, compared with lists of all surfaces on the rays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.clouds import add_cloud  # noqa: E402
from blender.light_scenes import empty_scene, principled, simple  # noqa: E402
from perfect_bvh_addon import AttributeRequest, Optics, SceneSync  # noqa: E402
from perfect_bvh_addon.scanning.light.paths import LEAST_SHARE, Arrivals, Cast, follow_light, ways_of  # noqa: E402
from perfect_bvh_addon.scanning.light.surface_reader import SurfaceReader  # noqa: E402

COUNT = 400


def cloud_of(material: Callable[[], Any], triangles: int) -> SceneSync:
    """Randomly placed triangles, large enough to cover each other."""
    empty_scene()
    cloud = add_cloud(triangles)
    cloud.data.materials.append(material())
    random = np.random.default_rng(5)
    corners = random.uniform(-10.0, 10.0, (triangles, 1, 3)) + random.normal(scale=3.0, size=(triangles, 3, 3))
    cloud.data.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    cloud.data.update()
    sync = SceneSync(AttributeRequest(shading=True))
    sync.update(bpy.context.evaluated_depsgraph_get())
    return sync


def rays() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(8)
    origins = random.uniform(-10.0, 10.0, (COUNT, 3)) + (0.0, 0.0, 40.0)
    return origins, (random.uniform(-10.0, 10.0, (COUNT, 3)) - origins) / 20.0


def followed(sync: SceneSync, optics: Optics, t_max: float = 80.0) -> tuple[list[Arrivals], np.ndarray, np.ndarray]:
    origins, directions = rays()
    ways, farthest = ways_of(origins, directions, 0.0, t_max)
    surfaces = SurfaceReader(sync, optics.spectrum)
    cast = Cast(sync.scene.snapshot(), surfaces, optics, 0xFFFFFFFF, 0, np.zeros(COUNT), farthest)
    return list(follow_light(cast, ways)), origins, directions


def test_each_sheet_on_a_rays_way_is_met_once_in_its_order() -> None:
    gray = (0.5, 0.5, 0.5, 1.0)
    sync = cloud_of(lambda: principled(Alpha=0.01, IOR=1.0, Roughness=1.0, Base_Color=gray), 500)
    bounces, origins, directions = followed(sync, Optics(bounces=64))
    found = Arrivals.joined(bounces)
    assert found.are_straight.all() and len(bounces) > 15
    hits, splits = sync.scene.list_intersections(origins, directions, t_min=0.0, t_max=80.0)
    order = np.argsort(found.rows, kind="stable")
    assert np.array_equal(np.bincount(found.rows, minlength=COUNT), np.diff(splits))
    assert np.array_equal(found.primitive_ids[order], hits.primitive_ids)
    assert np.allclose(found.ranges[order], np.repeat(np.linalg.norm(directions, axis=1), np.diff(splits)) * hits.t_hit)
    # Each passes 99 % there, and 99 % back.
    before = np.arange(len(order)) - np.repeat(splits[:-1], np.diff(splits))
    cosines = np.abs(np.einsum("ij,ij->i", directions[found.rows[order]], found.normals[order])) / np.linalg.norm(
        directions[found.rows[order]], axis=1
    )
    expected = 0.01 * 0.5 * cosines * 0.99 ** (2 * before)
    assert found.energies[order] == pytest.approx(np.where(expected >= LEAST_SHARE, expected, 0.0), rel=1e-4, abs=1e-9)


def test_mirrors_send_light_where_a_loop_sends_it() -> None:
    gray = (0.9, 0.9, 0.9, 1.0)
    sync = cloud_of(lambda: simple("ShaderNodeBsdfAnisotropic", Color=gray, Roughness=0.0), 200)
    bounces, origins, directions = followed(sync, Optics(bounces=6), t_max=500.0)
    found = Arrivals.joined(bounces)
    chains = {row: np.flatnonzero(found.rows == row) for row in range(COUNT)}
    lengths = []
    for row in range(COUNT):
        place, ahead, length = origins[row], directions[row] / np.linalg.norm(directions[row]), 0.0
        last = -1
        for number in range(7):
            listed, _ = sync.scene.list_intersections(place[None], ahead[None], t_min=0.0, t_max=1e4)
            others = np.flatnonzero(listed.primitive_ids != last)  # a ray does not hit a plane twice in a row
            first = others[0] if len(others) else None
            length += 0.0 if first is None else float(listed.t_hit[first])
            is_met = first is not None and length < 500.0 * np.linalg.norm(directions[row])
            assert is_met == (number < len(chains[row])), (row, number)
            if not is_met:
                break
            at = chains[row][number]
            last = int(listed.primitive_ids[first])
            assert found.primitive_ids[at] == last
            assert found.ranges[at] == pytest.approx(length, rel=1e-6)
            assert found.positions[at] == pytest.approx(place + listed.t_hit[first] * ahead, abs=1e-4)
            place, normal = found.positions[at], found.normals[at].astype(np.float64)
            ahead = ahead - 2.0 * (ahead @ normal) / (normal @ normal) * normal
        lengths.append(len(chains[row]))
    assert max(lengths) == 7 and sum(lengths) > COUNT
