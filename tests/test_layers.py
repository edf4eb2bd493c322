"""The architecture's import rules, checked by reading the sources: no layer reaches upwards.

A layer may use itself and those before it in its list, and nothing after it. Imports between the files and folders of a
Python folder have no cycle.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

# `stats` holds plain structs, so it comes first: everything may include it, and it includes nothing.
NATIVE_LAYERS = (
    "stats",
    "core",
    "math",
    "mesh",
    "builders",
    "wide",
    "update",
    "traverse",
    "blas",
    "tlas",
    "query",
    "scene",
    "render",
)

# The renderer has its own layers: folders in `render`, from the lowest up.
RENDER_LAYERS = ("sampling", "appearance", "surface", "light", "filter", "modes", "image")

# Lower layers that a layer must not include all the same.
NATIVE_IGNORANCE = {
    "math": ("core/thread_pool.h",),
    "mesh": ("core/thread_pool.h",),
    "builders": ("mesh/", "math/ray.h", "math/triangle"),
    "traverse": ("core/thread_pool.h",),
}

# Packages of the add-on in one group do not import each other; a group may import those above it in this list.
ADDON_LAYERS = (
    ("support", "events", "settings", "sync"),
    ("extract", "statistics"),
    ("live",),
    ("pieces",),
    ("image", "scanning", "labels", "baking"),
    ("view3d", "bench", "datasets"),
    ("engine", "operators", "panels"),
    ("__init__",),
    ("cli",),
)
ADDON_RANKS = {module: rank for rank, modules in enumerate(ADDON_LAYERS) for module in modules}

NATIVE_SUFFIXES = (".h", ".inl", ".cpp")
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)', re.MULTILINE)


# C++ ---------------------------------------------------------------------------------------------------------------


def includes_of(path: Path) -> Iterator[str]:
    for quoted, angled in INCLUDE.findall(path.read_text(encoding="utf-8")):
        yield quoted or angled


def native_violations(src: Path) -> list[str]:
    """Includes under `src` that break the order of the layers, as sentences."""
    found = []
    for path in sorted(path for path in src.rglob("*") if path.suffix in NATIVE_SUFFIXES):
        layer = path.relative_to(src).parts[0]
        if layer not in NATIVE_LAYERS:
            found.append(f"{path.relative_to(src)} belongs to no layer")
            continue
        found += [
            f"{path.relative_to(src)} includes {name}: {reason}"
            for name in includes_of(path)
            if (reason := native_objection(src, path.relative_to(src), name))
        ]
    return found


def native_objection(src: Path, path: Path, name: str) -> str | None:
    """Why the file `path`, relative to `src`, may not include `name`, or None."""
    layer, *inside = path.parts
    if name == "Python.h" or name.startswith(("pybind11/", "numpy/")):
        return "the engine must not depend on Python"
    target = name.split("/")[0]
    if target not in NATIVE_LAYERS:
        return None if not (src / layer / name).exists() else "includes start at src"
    if NATIVE_LAYERS.index(target) > NATIVE_LAYERS.index(layer):
        return f"{target} is above {layer}"
    if layer == target == "render":
        return render_objection(inside, name)
    if layer != target and layer == "stats":
        return "stats holds plain structs only"
    if any(name.startswith(unknown) for unknown in NATIVE_IGNORANCE.get(layer, ())):
        return f"{layer} must not know it"
    return None


def render_objection(inside: list[str], name: str) -> str | None:
    """The same within the renderer. inside: the file's path below `render`."""
    own, target = inside[0], name.split("/")[1]
    for folder in (own, target):
        if folder not in RENDER_LAYERS:
            return f"render/{folder} is no layer"
    return f"{target} is above {own}" if RENDER_LAYERS.index(target) > RENDER_LAYERS.index(own) else None


def test_native_layers_include_only_what_is_below_them(repository: Path) -> None:
    assert native_violations(repository / "native" / "src") == []


@pytest.mark.parametrize(
    ("file", "include", "complaint"),
    [
        ("math/vec3.h", '#include "mesh/mesh.h"', "mesh is above math"),
        ("builders/builder.cpp", '#  include "math/ray.h"', "builders must not know it"),
        ("stats/counts.h", '#include "core/errors.h"', "core is above stats"),
        ("scene/scene.h", "#include <pybind11/pybind11.h>", "must not depend on Python"),
        ("shapes/box.h", "#include <vector>", "belongs to no layer"),
        ("render/surface/surface.h", '#include "render/light/illumination.h"', "light is above surface"),
        ("render/shapes/box.h", '#include "render/light/light.h"', "render/shapes is no layer"),
    ],
)
def test_a_wrong_include_is_found(tmp_path: Path, file: str, include: str, complaint: str) -> None:
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(f"#pragma once\n{include}\n")
    violations = native_violations(tmp_path)
    assert len(violations) == 1
    assert complaint in violations[0]


# Python ------------------------------------------------------------------------------------------------------------


def imports_of(path: Path, package: tuple[str, ...]) -> Iterator[str]:
    """Dotted names of everything that `path`, a module in `package`, imports anywhere; relative ones resolved."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            prefix = ".".join((*base, *(node.module.split(".") if node.module else ())))
            yield from (f"{prefix}.{alias.name}" for alias in node.names)


def modules_in(root: Path, package: str) -> Iterator[tuple[Path, tuple[str, ...], tuple[str, ...]]]:
    """Every module under `root`, which is the package `package`: its path, its package, its name inside `root`."""
    for path in sorted(root.rglob("*.py")):
        inside = path.relative_to(root).with_suffix("").parts
        yield path, (package, *inside[:-1]), inside


def addon_violations(addon: Path) -> list[str]:
    """Imports in the folder `addon` that break the order of its layers, as sentences."""
    found = []
    for path, package, inside in modules_in(addon, "perfect_bvh_addon"):
        layer = inside[0]
        if layer not in ADDON_RANKS:
            found.append(f"{path.relative_to(addon)} belongs to no layer")
            continue
        found += [
            f"{path.relative_to(addon)} imports {name}: {reason}"
            for name in imports_of(path, package)
            if (reason := addon_objection(layer, name))
        ]
    return found


def addon_objection(layer: str, name: str) -> str | None:
    """Why a module of `layer` may not import `name`, or None."""
    top, *rest = name.split(".")
    if layer == "sync" and top in ("bpy", "bpy_extras", "bmesh", "mathutils", "gpu", "blf", "idprop"):
        return "sync must not depend on Blender"
    if name.startswith("perfect_bvh._core"):
        return "only the facade imports the compiled module"
    if top != "perfect_bvh_addon":
        return None
    target = rest[0] if rest and rest[0] in ADDON_RANKS else "__init__"
    if target == layer or ADDON_RANKS[target] < ADDON_RANKS[layer]:
        return None
    return f"{target} is {'above' if ADDON_RANKS[target] > ADDON_RANKS[layer] else 'next to'} {layer}"


def circles_in(root: Path) -> list[str]:
    """Cycles of imports between the files and folders in one folder under `root`, as sentences."""
    modules = list(modules_in(root, root.name))
    files = {(root.name, *inside): inside for _, _, inside in modules}
    uses: dict[tuple[str, ...], dict[str, set[str]]] = {}  # by folder: each of its entries' imports from it
    for path, package, inside in modules:
        for name in imports_of(path, package):
            parts = tuple(name.replace("perfect_bvh_addon", root.name, 1).split("."))
            target = file_of(parts, files)
            if target is None or target == inside or "_core" in parts:  # which is no file
                continue
            depth = next(at for at, (own, other) in enumerate(zip(inside, target, strict=False)) if own != other)
            uses.setdefault(inside[:depth], {}).setdefault(inside[depth], set()).add(target[depth])
    found = {"/".join((root.name, *folder)): circle_of(TopologicalSorter(graph)) for folder, graph in uses.items()}
    return [f"{folder}: {circle}" for folder, circle in found.items() if circle is not None]


def file_of(name: tuple[str, ...], files: dict[tuple[str, ...], tuple[str, ...]]) -> tuple[str, ...] | None:
    """The file of an imported name: a module, a package, or a name within one of these; None if there is no file."""
    for each in (name, name[:-1]):
        found = files.get(each) or files.get((*each, "__init__"))
        if found is not None:
            return found
    return None


def circle_of(sorter: TopologicalSorter[str]) -> str | None:
    """One circle, if there is any."""
    try:
        sorter.prepare()
    except CycleError as error:
        return " -> ".join(error.args[1])
    return None


def facade_violations(facade: Path) -> list[str]:
    """Imports of the package perfect_bvh that tie it to Blender or to the add-on."""
    return [
        f"{path.relative_to(facade)} imports {name}"
        for path, package, _ in modules_in(facade, "perfect_bvh")
        for name in imports_of(path, package)
        if name.split(".")[0] in ("bpy", "bmesh", "mathutils", "gpu", "perfect_bvh_addon")
    ]


def core_importers(folder: Path) -> list[str]:
    """Files under `folder` that import the compiled module."""
    return [
        str(path.relative_to(folder))
        for path, package, _ in modules_in(folder, folder.name)
        if any("_core" in name.split(".") for name in imports_of(path, package))
    ]


def test_the_addon_imports_nothing_above(repository: Path) -> None:
    assert addon_violations(repository / "addon") == []


@pytest.mark.parametrize("folder", ["addon", "native/python/perfect_bvh"])
def test_no_folder_has_a_circle(repository: Path, folder: str) -> None:
    assert circles_in(repository / folder) == []


@pytest.mark.parametrize(
    ("files", "folder", "circle"),
    [
        ({"sync/a.py": "from .b import B", "sync/b.py": "def f():\n    from .a import A"}, "addon/sync", {"a", "b"}),
        ({"cli/a.py": "from .farm.run import do", "cli/farm/run.py": "from ..a import B"}, "addon/cli", {"a", "farm"}),
        ({"cli/__init__.py": "from .a import run", "cli/a.py": "from . import X"}, "addon/cli", {"__init__", "a"}),
        ({"sync/a.py": "from ..cli.b import B", "cli/b.py": "from ..sync import a"}, "addon", {"sync", "cli"}),
    ],
)
def test_a_circle_is_found(tmp_path: Path, files: dict[str, str], folder: str, circle: set[str]) -> None:
    for file, text in files.items():
        path = tmp_path / "addon" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    (found,) = circles_in(tmp_path / "addon")
    assert found.startswith(f"{folder}: ")
    assert set(found.removeprefix(f"{folder}: ").split(" -> ")) == circle


def test_the_facade_knows_neither_blender_nor_the_addon(repository: Path) -> None:
    assert facade_violations(repository / "native" / "python" / "perfect_bvh") == []


@pytest.mark.parametrize("folder", ["addon", "blend_scenes", "tests"])
def test_only_the_facade_imports_the_compiled_module(repository: Path, folder: str) -> None:
    assert [file for file in core_importers(repository / folder) if file != "test_stubs.py"] == []


@pytest.mark.parametrize(
    ("file", "statement", "complaint"),
    [
        ("sync/apply.py", "import bpy", "sync must not depend on Blender"),
        ("sync/apply.py", "from mathutils import Matrix", "sync must not depend on Blender"),
        ("sync/apply.py", "from ..extract import meshes", "extract is above sync"),
        ("sync/apply.py", "from ..live import sync_cache", "live is above sync"),
        ("sync/apply.py", "from .. import register", "__init__ is above sync"),
        ("extract/meshes.py", "def later():\n    from ..live.scene_sync import SceneSync", "live is above extract"),
        ("engine.py", "from .panels import draw", "panels is next to engine"),
        ("engine.py", "from perfect_bvh_addon.cli import main", "cli is above engine"),
        ("engine.py", "from perfect_bvh import _core", "only the facade"),
        ("helpers.py", "import math", "belongs to no layer"),
    ],
)
def test_a_wrong_import_is_found(tmp_path: Path, file: str, statement: str, complaint: str) -> None:
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    path.write_text(statement + "\n")
    violations = addon_violations(tmp_path)
    assert len(violations) == 1
    assert complaint in violations[0]


@pytest.mark.parametrize(
    ("file", "statement"),
    [
        ("sync/apply.py", "from .records import MeshRecord"),
        ("extract/meshes.py", "import bpy\nfrom ..sync.records import MeshRecord"),
        ("operators/bake.py", "from ..live.sync_cache import sync_of\nfrom ..view3d.rendered.viewport import Viewport"),
        ("__init__.py", "from . import engine, panels"),
    ],
)
def test_a_right_import_is_let_through(tmp_path: Path, file: str, statement: str) -> None:
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    path.write_text(statement + "\n")
    assert addon_violations(tmp_path) == []


def test_a_facade_that_knows_blender_is_found(tmp_path: Path) -> None:
    (tmp_path / "scene.py").write_text("from . import _core\nimport bpy\n")
    assert facade_violations(tmp_path) == ["scene.py imports bpy"]
    assert core_importers(tmp_path) == ["scene.py"]
