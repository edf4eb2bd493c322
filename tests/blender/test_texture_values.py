"""`cycles_values` gives each point its own value, unchanged: tests of textures rely on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.texture_values import cycles_values  # noqa: E402


def points_of(count: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(count)
    return random.uniform(-50.0, 50.0, (count, 3)).astype(np.float32), random.uniform(-50.0, 50.0, count)


@pytest.mark.parametrize("count", [1, 3, 17, 1000])
def test_points_come_back_as_they_are(count: int) -> None:
    points, w = points_of(count)
    (found,) = cycles_values(lambda tree: tree.nodes.new("ShaderNodeVectorMath"), points, w, "Vector")
    assert found.tolist() == points.tolist()


def test_outputs_of_numbers_and_colors_come_together() -> None:
    def white_noise(tree: Any) -> Any:
        node = tree.nodes.new("ShaderNodeTexWhiteNoise")
        node.noise_dimensions = "4D"
        return node

    points, w = points_of(100)
    value, color = cycles_values(white_noise, points, w, "Value", "Color")
    assert value.shape == (100,)
    assert color.shape == (100, 3)
    assert color[:, 0].tolist() == value.tolist()
    assert len(set(value.tolist())) == 100


def test_w_is_linked() -> None:
    def grid(tree: Any) -> Any:
        node = tree.nodes.new("ShaderNodeTexVoronoi")
        node.voronoi_dimensions = "1D"
        node.inputs["Scale"].default_value, node.inputs["Randomness"].default_value = 1.0, 0.0
        return node

    points, w = points_of(100)
    (nearest,) = cycles_values(grid, points, w, "W")
    assert nearest.tolist() == np.round(w).tolist()
