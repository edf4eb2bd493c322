"""The survey of other people's files: its counts, and that a file that fails is listed with its reason."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks.survey import LIMITS, count, count_groups, feature_of, find_files, format_markdown, read_groups

ANSWERS = [
    {"file": "a.blend", "not_shown": ["material: Bevel", "material: Bevel", "object: volume"]},
    {"file": "b.glb", "not_shown": ["material: Bevel"]},
    {"file": "c.glb", "error": "it took more than 5 s"},
]


@pytest.mark.parametrize(
    ("kind", "text", "feature"),
    [
        ("material", "Bevel is unsupported; black is used", "material: Bevel"),
        (
            "material",
            "A (b) c (Ambient Occlusion) is unsupported; its flat colour is used",
            "material: Ambient Occlusion",
        ),
        (
            "material",
            "Old (Squeeze Value (Legacy)) is unsupported; its flat colour is used",
            "material: Squeeze Value (Legacy)",
        ),
        ("material", "Squeeze Value (Legacy) is unsupported; black is used", "material: Squeeze Value (Legacy)"),
        ("material", "varying Coat is unsupported; 0.31 is used", "material: varying Coat"),
        (
            "image",
            "it could not be loaded from '//a b.png'; magenta is",
            "image: it could not be loaded from ...",
        ),
    ],
)
def test_a_feature_has_no_names_of_a_file(kind: str, text: str, feature: str) -> None:
    assert feature_of(kind, text) == feature


def test_features_are_counted_by_files_and_by_times() -> None:
    rows = count(ANSWERS)
    assert [(row["feature"], row["files"], row["times"]) for row in rows] == [
        ("material: Bevel", 2, 3),
        ("object: volume", 1, 1),
    ]
    table = format_markdown(ANSWERS, rows)
    assert "2 files were read" in table and "1 could not be" in table
    assert "| material: Bevel | 2 | 3 |" in table
    assert "| c.glb | it took more than 5 s |" in table


def test_files_are_counted_by_the_rows_of_the_readme() -> None:
    groups = {"traced": ("Bevel",), "shaders": ("Hair BSDF",), "hair": ("hair",)}
    answers = [*ANSWERS, {"file": "d.glb", "not_shown": ["material: Hair BSDF"]}]
    assert count_groups(answers, groups) == {"traced": 2, "shaders": 1, "hair": 0, "": 1}
    groups = read_groups(LIMITS.read_text(encoding="utf-8"))
    assert "Bevel" in groups["what nodes trace"]


def test_files_of_a_folder_are_surveyed(repository: Path, tmp_path: Path) -> None:
    """One file that opens, one that does not."""
    bpy = pytest.importorskip("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    material = bpy.data.materials.new("Made")
    material.use_nodes = True
    tree = material.node_tree
    occlusion = tree.nodes.new("ShaderNodeAmbientOcclusion")
    occlusion.label = "Mine"
    tree.links.new(occlusion.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.context.object.data.materials.append(material)
    folder = tmp_path / "files" / "deep"
    folder.mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "cube.blend"), compress=True)
    (folder / "none.gltf").write_text("{}")
    assert [path.name for path in find_files(tmp_path)] == ["cube.blend", "none.gltf"]
    assert [path.name for path in find_files(tmp_path, 1)] == ["cube.blend"]
    script, out = repository / "tests" / "benchmarks" / "survey.py", tmp_path / "out.json"
    command = [sys.executable, str(script), str(folder), "--json", str(out), "--table", str(tmp_path / "out.md")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    figures = json.loads(out.read_text())
    cube, none = figures["files"]
    assert cube == {"file": "deep/cube.blend", "not_shown": ["material: Ambient Occlusion"]}
    assert none["file"] == "deep/none.gltf"
    assert none["error"]
    assert [row["feature"] for row in figures["features"]] == ["material: Ambient Occlusion"]
