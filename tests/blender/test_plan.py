"""The classes of the example scenes' meshes: from the scene alone at first, and from observed motion later."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.builders import collection, evaluated, mesh_data, mesh_object  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.image.plan import owners_of  # noqa: E402
from perfect_bvh_addon.statistics.updates import (  # noqa: E402
    find_updates,
    what_to_do,
    what_was_done,
)


def classes_of(path: Path, frames: int) -> list[dict[str, tuple[str, str, int]]]:
    """(class, reason, triangles) of each mesh by name, frame by frame; the largest where names are equal."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    sync = SceneSync()
    found = []
    for frame in range(scene.frame_start, scene.frame_start + frames):
        scene.frame_set(frame)
        report = sync.update(bpy.context.evaluated_depsgraph_get(), expected_rays=100_000)
        rows = sorted(report.meshes, key=lambda mesh: mesh.triangle_count)
        found.append({mesh.name: (mesh.usage, mesh.usage_reason, mesh.triangle_count) for mesh in rows})
        assert all(mesh.usage_reason for mesh in report.meshes)
        assert {row["class"] for row in report.ledger} <= {"static", "rigid", "deforming", "changing"}
        assert len(report.ledger) == len(report.commit.meshes) + len(report.commit.resting)
    sync.close()
    return found


@pytest.mark.parametrize(
    ("name", "usage", "word"),
    [
        ("tree_in_wind", "deforming", "modifier"),
        ("cloth", "deforming", "shape keys"),
        ("ocean", "changing", ""),
        ("gears", "rigid", "animated"),
        ("meadow", "deforming", "geometry nodes"),
    ],
)
def test_the_largest_moving_mesh_has_its_class_from_the_first_frame(
    repository: Path, name: str, usage: str, word: str
) -> None:
    first, _, third = classes_of(repository / "blend_scenes" / f"{name}.blend", 3)
    of_class = [row for row in first.values() if row[0] == usage]
    assert of_class, first
    assert any(word in reason for _, reason, _ in of_class)
    # Later observations did not revoke the class.
    for mesh, row in first.items():
        if row[0] == usage and mesh in third:
            assert third[mesh][0] == usage


def test_flags_deform_and_spectators_do_not(repository: Path) -> None:
    first, second = classes_of(repository / "blend_scenes" / "crowd.blend", 2)
    usages = {row[0] for row in second.values()}
    assert "deforming" in usages and usages & {"static", "rigid"}
    assert set(first) == set(second)


def test_what_no_ray_can_meet_is_unseen_and_not_read(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reason is given. A mesh that another object shows is seen, and a mesh that is shown again is built."""
    from perfect_bvh_addon.extract.geometry import mesh_table

    read: list[str] = []
    original = mesh_table.read_mesh
    monkeypatch.setattr(mesh_table, "read_mesh", lambda mesh, *rest: read.append(mesh.name) or original(mesh, *rest))
    shared = mesh_data("shared")
    for name, data in (("shown", shared), ("hidden", shared), ("rays", mesh_data("rays"))):
        mesh_object(name, data)
    mesh_object("eye", mesh_data("eye"), collection=collection("eyed"))
    objects = bpy.data.objects
    evaluated()
    objects["hidden"].hide_set(True)
    eye = bpy.context.view_layer.layer_collection.children["eyed"]
    eye.hide_viewport = True
    for switch in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(objects["rays"], f"visible_{switch}", False)
    sync = SceneSync()
    report = sync.update(evaluated())
    assert read == ["shared"]
    reasons = {mesh.name: mesh.reason for mesh in report.unseen}
    assert reasons == {
        "eye": "its instancer is hidden",
        "rays": "its instancer is visible to no kind of ray",
    }
    updates = find_updates(report, owners_of(sync))
    rows = {row.name: row for row in (*updates.changed, *updates.unchanged)}
    assert {name: row.state for name, row in rows.items()} == {"shown": "built", "eye": "unseen", "rays": "unseen"}
    assert rows["shown"].mesh.usage == "static"
    assert all(what_was_done(row) and what_to_do(row) for row in rows.values())
    assert all(reasons[row.name] in what_was_done(row) for row in updates.unchanged)
    objects["shown"].location.x = 1.0
    assert sync.update(evaluated()).unseen == report.unseen
    objects["rays"].visible_shadow = True
    eye.hide_viewport = False
    report = sync.update(evaluated(), verify=True)
    assert (report.unseen, report.mismatches, report.commit.count("built")) == ((), (), 2)
    sync.close()
