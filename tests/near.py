"""Which tests are near a change: those that were changed, bear a changed file's name, or import or include it.

`nox -s quick` runs them. A guess, made to be quick: what a change breaks further away, the whole suite finds.
"""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
# Where Python packages are, by the names that tests import them by.
PACKAGES = {"addon": "perfect_bvh_addon", "native/python/perfect_bvh": "perfect_bvh", "tests": "", "blend_scenes": ""}
NATIVE_SUFFIXES = (".cpp", ".h", ".inl")
# What holds for all sources: layers, documents, stubs.
ALWAYS = ("tests/test_architecture.py", "tests/test_contributing.py", "tests/test_layers.py", "tests/test_stubs.py")
_SUITE = re.compile(r"^(?:TYPED_)?TEST(?:_P|_F)?\((\w+),", re.MULTILINE)


def changed_files(base: str = "origin/main") -> list[str]:
    """Paths that differ from where this branch left `base` (or from HEAD without it), and untracked ones."""
    merge_base = _git("merge-base", "HEAD", base, check=False).strip() or "HEAD"
    listed = _git("diff", "--name-only", "--diff-filter=d", merge_base) + _git(
        "ls-files", "--others", "--exclude-standard"
    )
    return sorted(set(listed.splitlines()))


def near_python_tests(changed: Iterable[str], root: Path = REPOSITORY) -> list[str]:
    """Test files, the nearest first."""
    paths = [path for path in changed if path.endswith(".py")]
    modules = {name for path in paths if (name := module_name(path)) is not None}
    stems = {Path(path).stem for path in paths} - {"__init__"}
    ranked = []
    for test in sorted((root / "tests").rglob("test_*.py")):
        name = test.relative_to(root).as_posix()
        rank = _rank(name, paths, stems, modules, test)
        if rank is not None and name not in ALWAYS:
            ranked.append((rank, name))
    return [*(name for name in ALWAYS if (root / name).is_file()), *(name for _, name in sorted(ranked))]


def _rank(name: str, paths: list[str], stems: set[str], modules: set[str], test: Path) -> int | None:
    if name in paths:
        return 0
    if any(Path(name).stem in (f"test_{stem}", f"test_{stem}s") for stem in stems):
        return 1
    return 2 if modules.intersection(_imports(test)) else None


def module_name(path: str) -> str | None:
    """The name that tests import a file by; None for what no test can import."""
    for folder, package in PACKAGES.items():
        if path.startswith(f"{folder}/"):
            parts = Path(path[len(folder) + 1 :]).with_suffix("").parts
            return ".".join((*([package] if package else []), *(part for part in parts if part != "__init__")))
    return None


def _imports(test: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(test.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def near_native_suites(changed: Iterable[str], root: Path = REPOSITORY) -> list[str]:
    """GoogleTest suites of the test files that were changed, or include a changed file or the header of its name."""
    paths = [path for path in changed if path.startswith("native/") and path.endswith(NATIVE_SUFFIXES)]
    included = {str(Path(path).relative_to("native/src").with_suffix(".h")) for path in paths if "/src/" in path}
    suites: set[str] = set()
    for test in sorted((root / "native" / "tests").glob("test_*.cpp")):
        text = test.read_text(encoding="utf-8")
        is_changed = test.relative_to(root).as_posix() in paths
        is_named = any(test.stem == f"test_{Path(path).stem}" for path in paths)
        if is_changed or is_named or any(f'"{name}"' in text for name in included):
            suites.update(_SUITE.findall(text))
    return sorted(suites)


def _git(*arguments: str, check: bool = True) -> str:
    command = ("git", *arguments)
    return subprocess.run(command, cwd=REPOSITORY, check=check, capture_output=True, text=True).stdout
