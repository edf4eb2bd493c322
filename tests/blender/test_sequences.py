"""Images that change: files of a sequence, movies, packed files, and the files that a resumed job depends on."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.node_setups import add  # noqa: E402
from blender.test_layers_cycles import emissive, scene  # noqa: E402, F401
from blender.test_udim_cycles import save  # noqa: E402
from perfect_bvh_addon import AttributeRequest, SceneSync  # noqa: E402
from perfect_bvh_addon.pieces.piece import scene_inputs  # noqa: E402

REDS = (0.0, 0.2, 0.4, 0.6, 0.8)  # of the files 0 to 4


@pytest.fixture
def sequence(scene: Any, tmp_path: Path) -> Any:  # noqa: F811
    """The image user of a sequence of the files 0 to 4."""
    for number, red in enumerate(REDS):
        save(tmp_path / f"shot_1.{number:04}.png", red, 0.5, 0.5)
    image = bpy.data.images.load(str(tmp_path / "shot_1.0001.png"))
    image.source = "SEQUENCE"
    return shown(scene, image).image_user


def shown(scene: Any, image: Any) -> Any:  # noqa: F811
    """The node that shows an image."""
    nodes = []

    def output(tree: Any) -> Any:
        node = add(tree, "TexImage")
        node.image = image
        nodes.append(node)
        return node.outputs[0]

    emissive(scene, output)
    return nodes[0]


def first_pixels(frames: range, sync: SceneSync) -> list[int]:
    """Return the red byte of the image's first pixel in each frame."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        sync.update(bpy.context.evaluated_depsgraph_get())
        (record,) = sync.record.images
        found.append(int(record.pixels[0, 0, 0]))
    return found


@pytest.fixture
def sync(scene: Any) -> Any:  # noqa: F811
    sync = SceneSync(AttributeRequest(shading=True))
    yield sync
    sync.close()


@pytest.mark.parametrize(
    ("settings", "numbers"),
    [
        ({"frame_start": 1, "frame_duration": 3}, [0, 0, 1, 2, 3, 3, 3]),
        ({"frame_start": 2, "frame_duration": 3, "frame_offset": 1}, [1, 1, 1, 2, 3, 4, 4]),
        ({"frame_start": 2, "frame_duration": 3, "frame_offset": -1}, [0, 0, 0, 0, 1, 2, 2]),
        ({"frame_start": 1, "frame_duration": 2, "use_cyclic": True}, [1, 2, 1, 2, 1, 2, 1]),
    ],
)
def test_each_frame_shows_its_file(
    sequence: Any, sync: SceneSync, settings: dict[str, Any], numbers: list[int]
) -> None:
    """As in Blender, frames before the first show the previous file, and frames after the last show the last file."""
    for name, value in settings.items():
        setattr(sequence, name, value)
    assert first_pixels(range(-1, 6), sync) == [round(255 * REDS[number]) for number in numbers]
    assert not sync.record.not_shown


def test_a_file_that_is_missing_is_magenta_and_named(sequence: Any, sync: SceneSync, tmp_path: Path) -> None:
    sequence.frame_duration = 10
    (tmp_path / "shot_1.0002.png").unlink()
    assert first_pixels(range(1, 3), sync) == [51, 255]
    (row,) = sync.record.not_shown
    assert "shot_1.0002.png" in str(row)


def test_a_query_right_after_the_update_is_answered(sequence: Any, sync: SceneSync) -> None:
    bpy.data.images.load(bpy.data.images[0].filepath, check_existing=False)
    sync.update(bpy.context.evaluated_depsgraph_get())
    sync.scene.cast_rays((0.0, 0.0, 4.0), (0.0, 0.0, -1.0))  # raises if anything is stale


def test_a_packed_image_that_was_painted_shows(scene: Any, sync: SceneSync) -> None:  # noqa: F811
    """Packed a second time, it has the same number of bytes."""
    image = bpy.data.images.new("painted", 8, 8)
    shown(scene, image)
    found = []
    for color in ((0.0, 1.0, 0.0, 1.0), (1.0, 1.0, 0.0, 1.0)):
        image.pixels.foreach_set(np.tile(np.float32(color), 64))
        image.update()
        image.pack()
        sync.update(bpy.context.evaluated_depsgraph_get())
        found.append(sync.record.images[0].pixels[0, 0].tolist())
    assert found == [[0, 255, 0, 255], [255, 255, 0, 255]]


def test_a_movie_is_named(scene: Any, sync: SceneSync, tmp_path: Path) -> None:  # noqa: F811
    """Blender gives Python only the first frame of a movie."""
    image = bpy.data.images.new("clip", 8, 8)
    image.source, image.filepath = "MOVIE", str(tmp_path / "clip.avi")
    shown(scene, image)
    sync.update(bpy.context.evaluated_depsgraph_get())
    assert any("movies are unsupported" in str(row) for row in sync.record.not_shown)


@pytest.mark.parametrize("kind", ["sequence", "tiles"])
def test_what_a_resumed_job_depends_on_has_every_file(sequence: Any, tmp_path: Path, kind: str) -> None:
    image = bpy.data.images[0]
    if kind == "tiles":
        for number in (1001, 1002):
            save(tmp_path / f"t.{number}.png", 0.5, 0.5, 0.5)
        image.source, image.filepath = "TILED", str(tmp_path / "t.<UDIM>.png")
    changed = tmp_path / ("shot_1.0003.png" if kind == "sequence" else "t.1002.png")
    arguments = SimpleNamespace(file=str(tmp_path / "none.blend"), autoexec=False, allow_missing=False)
    before = scene_inputs(arguments)
    assert changed.name in before["files"]
    save(changed, 0.9, 0.1, 0.1)
    assert scene_inputs(arguments) != before
