"""Which tests are near a change: those that were changed, bear a changed file's name, or import or include it.

Tests that import it through other modules are near as well, and come later. `nox -s quick` runs as many as fit into its
time; the whole suite finds breakages further away.
"""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
# Where Python packages are, by the names that tests import them by.
PACKAGES = {"addon": "perfect_bvh_addon", "native/python/perfect_bvh": "perfect_bvh", "tests": "", "blend_scenes": ""}
NATIVE_SUFFIXES = (".cpp", ".h", ".inl")
# Tests of all sources: layers, documents, stubs.
ALWAYS = ("tests/test_architecture.py", "tests/test_contributing.py", "tests/test_layers.py", "tests/test_stubs.py")
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
_SUITE = re.compile(r"^(?:TYPED_)?TEST(?:_P|_F)?\((\w+),", re.MULTILINE)


def changed_files(base: str = "origin/main") -> list[str]:
    """Paths that differ from where this branch left `base` (or from HEAD without it), and untracked ones."""
    merge_base = _git("merge-base", "HEAD", base, check=False).strip() or "HEAD"
    listed = _git("diff", "--name-only", "--diff-filter=d", merge_base) + _git(
        "ls-files", "--others", "--exclude-standard"
    )
    return sorted(set(listed.splitlines()))


def near_python_tests(changed: Iterable[str], root: Path = REPOSITORY) -> list[str]:
    """Test files, the nearest first: each import between a test and a changed file counts as one step."""
    paths = [path for path in changed if path.endswith(".py")]
    stems = {Path(path).stem for path in paths} - {"__init__"}
    steps = _steps_to({name for path in paths if (name := module_name(path)) is not None}, _all_imports(root))
    ranked = []
    for test in sorted((root / "tests").rglob("test_*.py")):
        name = test.relative_to(root).as_posix()
        if name in ALWAYS:
            continue
        if name in paths:
            ranked.append((0, name))
        elif any(test.stem in (f"test_{stem}", f"test_{stem}s") for stem in stems):
            ranked.append((1, name))
        elif (module := module_name(name)) in steps:
            ranked.append((1 + steps[module], name))
    return [*(name for name in ALWAYS if (root / name).is_file()), *(name for _, name in sorted(ranked))]


@lru_cache
def _all_imports(root: Path) -> dict[str, set[str]]:
    """The imports of each module, by name."""
    files = {
        name: path
        for folder in PACKAGES
        for path in sorted((root / folder).rglob("*.py"))
        if (name := module_name(path.relative_to(root).as_posix())) is not None
    }
    return {name: files.keys() & set(_imports(path, name)) for name, path in files.items()}


def _steps_to(found: set[str], needs: Mapping[str, set[str]]) -> dict[str | None, int]:
    """The number of imports that lead to one of `found`, by importing module; 0 for those themselves."""
    steps: dict[str | None, int] = dict.fromkeys(found, 0)
    while found:
        far = max(steps.values()) + 1
        found = {name for name, needed in needs.items() if name not in steps and not found.isdisjoint(needed)}
        steps.update(dict.fromkeys(found, far))
    return steps


def module_name(path: str) -> str | None:
    """The name that tests import a file by; None for files that no test can import."""
    for folder, package in PACKAGES.items():
        if path.startswith(f"{folder}/"):
            parts = Path(path[len(folder) + 1 :]).with_suffix("").parts
            return ".".join((*([package] if package else []), *(part for part in parts if part != "__init__")))
    return None


def _imports(path: Path, name: str) -> Iterator[str]:
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def near_native_suites(changed: Iterable[str], root: Path = REPOSITORY) -> list[str]:
    """GoogleTest suites of the test files that were changed, or include a changed file, directly or through others.

    A changed source counts as its header.
    """
    paths = {path for path in changed if path.startswith("native/") and path.endswith(NATIVE_SUFFIXES)}
    sources = sorted(path for path in (root / "native").glob("*/**/*") if path.suffix in NATIVE_SUFFIXES)
    needs = {path.relative_to(root).as_posix(): _includes(path) for path in sources}
    near = _steps_to(paths | {str(Path(path).with_suffix(".h")) for path in paths}, needs)
    suites: set[str] = set()
    for test in sorted((root / "native" / "tests").glob("test_*.cpp")):
        is_named = any(test.stem == f"test_{Path(path).stem}" for path in paths)
        if is_named or test.relative_to(root).as_posix() in near:
            suites.update(_SUITE.findall(test.read_text(encoding="utf-8")))
    return sorted(suites)


def _includes(path: Path) -> set[str]:
    """Paths of a file's includes, from `native/src` or `native`."""
    names = _INCLUDE.findall(path.read_text(encoding="utf-8"))
    return {f"{folder}/{name}" for folder in ("native/src", "native") for name in names}


def _git(*arguments: str, check: bool = True) -> str:
    command = ("git", *arguments)
    return subprocess.run(command, cwd=REPOSITORY, check=check, capture_output=True, text=True).stdout
