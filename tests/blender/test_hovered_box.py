"""The box under the mouse: it is found in any view and for any transform, with the triangles that it holds."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix  # noqa: E402
from perfect_bvh_addon.live.sync_cache import sync_of  # noqa: E402
from perfect_bvh_addon.view3d.tree_overlay import hovered_box, scene_overlay, tree_lines  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")

WIDTH, HEIGHT = 200, 100


@pytest.fixture
def sync(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(tree_lines, "_make_batch", lambda lines: object())
    bpy.ops.mesh.primitive_monkey_add(location=(4.0, 0.0, 0.0), rotation=(0.3, 0.2, 0.1))
    bpy.context.object.scale = (1.0, 2.0, 0.5)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = sync_of(depsgraph)
    found.update(depsgraph)
    return found


def trees_of(sync: Any, level: int) -> tuple[tree_lines.TreeLines, int, Any]:
    settings = SimpleNamespace(level=level, use_all_to_level=False, color_by="LEVEL")
    lines = tree_lines.TreeLines()
    mesh, matrix = scene_overlay.find_object(sync, bpy.context.object)
    lines.follow(sync.scene.snapshot(), mesh, settings)
    return lines, mesh, matrix


def looking_down(is_perspective: bool) -> SimpleNamespace:
    """A view from above onto (4, 0, 0), 4 units wide there."""
    view = Matrix.Translation((4.0, 0.0, 10.0)).inverted()
    if is_perspective:
        window = Matrix(((5.0, 0, 0, 0), (0, 10.0, 0, 0), (0, 0, -1.0, -0.2), (0, 0, -1.0, 0)))
    else:
        window = Matrix(((0.5, 0, 0, 0), (0, 1.0, 0, 0), (0, 0, -0.01, 0), (0, 0, 0, 1.0)))
    data = SimpleNamespace(
        view_matrix=view,
        window_matrix=window,
        perspective_matrix=window @ view,
        is_perspective=is_perspective,
        view_perspective="PERSP" if is_perspective else "ORTHO",
    )
    return SimpleNamespace(region=SimpleNamespace(width=WIDTH, height=HEIGHT), region_data=data)


@pytest.mark.parametrize("is_perspective", [True, False])
def test_the_box_under_the_mouse_is_found_through_any_view(sync: Any, is_perspective: bool) -> None:
    tree = trees_of(sync, level=0)
    context = looking_down(is_perspective)
    found = hovered_box.box_under(context, (WIDTH // 2, HEIGHT // 2), [tree])
    assert found is not None and found.row == 0 and found.tree is tree[0]
    assert hovered_box.box_under(context, (1, 1), [tree]) is None
    assert hovered_box.box_under(context, (WIDTH // 2, HEIGHT // 2), []) is None


def test_the_first_tree_with_a_box_is_taken(sync: Any) -> None:
    active = trees_of(sync, level=1)
    top = tree_lines.TreeLines()
    top.follow(sync.scene.snapshot(), None, SimpleNamespace(level=0, use_all_to_level=False, color_by="LEVEL"))
    context, middle = looking_down(True), (WIDTH // 2, HEIGHT // 2)
    assert hovered_box.box_under(context, middle, [active, (top, None, None)]).tree is active[0]
    flat = np.diag([1.0, 1.0, 0.0, 1.0])
    assert hovered_box.box_under(context, middle, [(active[0], active[1], flat), (top, None, None)]).tree is top


def test_a_box_tells_and_shows_what_it_holds(sync: Any) -> None:
    lines, mesh, matrix = trees_of(sync, level=1)
    for row in range(len(lines.boxes)):
        box = hovered_box.HoveredBox(lines, lines.number, row, mesh, matrix)
        corners = hovered_box.corners_of(box, sync)
        held = lines.boxes.primitives_of(row)
        assert len(corners) == 3 * len(held)
        lower, upper = lines.boxes.boxes[row]
        np.testing.assert_allclose((corners.min(axis=0), corners.max(axis=0)), (lower, upper), atol=1e-6)
        assert f"{len(held)} triangles" in box.lines(sync)[0]
    top = tree_lines.TreeLines()
    top.follow(sync.scene.snapshot(), None, SimpleNamespace(level=9, use_all_to_level=False, color_by="LEVEL"))
    (row,) = range(len(top.boxes))
    assert hovered_box.HoveredBox(top, top.number, row, None, None).lines(sync)[0] == "Leaf on level 0: Suzanne"
