"""`Camera.pixel_rays`: those of the renderer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh import Camera, Scene

SIZE = (31, 17)


@pytest.mark.parametrize("projection", ["perspective", "orthographic", "equirectangular"])
def test_they_meet_what_the_renderer_sees(projection: Any) -> None:
    scene = Scene()
    scene.add_instance(scene.add_mesh(*meshes.sphere(16, 24, 1.0)))
    scene.commit()
    camera = replace(
        Camera.look_at((0.4, -2.5, 0.3), (0.0, 0.0, 0.1), aspect=31 / 17),
        projection=projection,
        window=(-1.1, 1.2, -0.7, 0.8),
    )
    passes = perfect_bvh.render_passes(scene, camera, size=SIZE, passes=("depth", "primitive"))
    origins, directions = camera.pixel_rays(SIZE)
    assert origins.shape == directions.shape == (17, 31, 3)
    hits = scene.cast_rays(origins, directions, t_min=camera.clip_start, t_max=camera.clip_end)
    assert (passes["primitive"] >= 0).sum() > 50
    same = passes["primitive"] == hits.primitive_ids
    assert same.all() if projection != "equirectangular" else same.mean() > 0.99
    found = np.where(hits.is_hit, hits.t_hit, 1e10)
    np.testing.assert_allclose(found[same], passes["depth"][same], rtol=0 if projection != "equirectangular" else 1e-6)
    some = camera.pixel_rays(SIZE, slice(3, 9))
    assert np.array_equal(some[1], directions[3:9]) and some[0].shape == (6, 31, 3)


def test_bad_sizes_and_matrices_are_refused() -> None:
    with pytest.raises(ValueError, match="pixel_rays: size"):
        Camera().pixel_rays((0, 4))
    flat = replace(Camera(), matrix=np.diag([1.0, 0.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="has no length"):
        flat.pixel_rays(SIZE)
