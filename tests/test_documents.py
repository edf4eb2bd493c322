"""Files, folders and modules that documents, docstrings and comments name exist.

The changelog is left out: it names old files.
"""

from __future__ import annotations

import ast
import io
import posixpath
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import pytest

SUFFIXES = "py|pyi|h|inl|cpp|md|sh|toml|yml|blend"
# Neither part of an address, of a pattern or of a system's path, nor begun by a variable or a placeholder.
FILE = re.compile(rf"(?<![\w./*<>{{}}$@:-])(?:\.\./)*(?:[\w-]+/)*\w[\w-]*\.(?:{SUFFIXES})\b(?![\w(*/]|\.\w)")
FOLDER = re.compile(r"`(?:\.\./)*(\w[\w-]*(?:/[\w-]+)*)/`")
LINK = re.compile(r"\]\((?!\w+:)([^)#\s]+)[^)]*\)")
# In a docstring: "name  what it is", "name, name  what they are", "long_name what it is".
LISTED = re.compile(r"^ *(\w+(?:, \w+)*) {2,}\S|^(\w+_\w+) \w", re.MULTILINE)
COMMENTS = {
    **dict.fromkeys((".h", ".inl", ".cpp"), re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)),
    **dict.fromkeys((".sh", ".toml", ".yml"), re.compile(r"(?:^|\s)#[^\n]*", re.MULTILINE)),
}

INVENTED = re.compile(r"(^|[_/])x\.\w+$")  # a placeholder for a file that a reader adds
ELSEWHERE = {
    "the site's that shows the repository": ("../../releases",),
    "any example": ("examples/NAME.py",),
    "the user's": ("FILE.blend", "mine.toml", "random.py", "scene.blend", "shot.blend", "walk.blend"),
    "made by a build": ("dist",),
    "made by a test": ("parts.blend", "sensor.toml", "small.blend"),
    "Python's": ("Python.h", "pyconfig.h"),
    "sources of measurements": (
        "_includes/en/platform/openmanipulator_x/perceptions/camera_humble.md",
        "blendodyne.py",
        "src/sensors/lidar/hdl32e.cpp",
        "test/src/graph/multiReturnTest.cpp",
    ),
}
EXCUSED = {name for names in ELSEWHERE.values() for name in names}


class Tree:
    """The files that git lists, and their folders."""

    def __init__(self, repository: Path) -> None:
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=repository, capture_output=True, check=True).stdout
        self.root = repository
        self.files = sorted(name for name in listed.decode().split("\0") if (repository / name).is_file())
        folders = {str(folder) for name in self.files for folder in PurePosixPath(name).parents}
        self._paths = {*self.files, *folders}
        self._ends: dict[str, list[str]] = {}
        for path in self._paths:
            self._ends.setdefault(posixpath.basename(path), []).append(path)

    def has(self, name: str, file: str) -> bool:
        """Return whether `name` in `file` can mean an existing path: from its folder or one around it, or deeper.

        The add-on has many files of one name, so there it must lie in or around the folder of the file that names it.
        Elsewhere a name counts in any folder.
        """
        folder = PurePosixPath(file).parent
        if any(posixpath.normpath(str(around / name)) in self._paths for around in (folder, *folder.parents)):
            return True
        deep = [path for path in self._ends.get(posixpath.basename(name), ()) if f"/{path}".endswith(f"/{name}")]
        return any(path.startswith(f"{folder}/") for path in deep) if file.startswith("addon/") else bool(deep)


@pytest.fixture(scope="module")
def tree(repository: Path) -> Tree:
    if not (repository / ".git").exists():
        pytest.skip("no .git: the names are those that git lists")
    return Tree(repository)


def python_prose(source: str) -> Iterator[str]:
    """Yield the docstrings and comments of a Python source."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node, clean=False) or ""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string


def prose_of(file: str, source: str) -> str:
    """Return a file's text for readers: all of a document, the docstrings and comments of a source."""
    suffix = PurePosixPath(file).suffix
    if suffix in (".py", ".pyi"):
        return "\n".join(python_prose(source))
    if suffix in COMMENTS:
        return "\n".join(COMMENTS[suffix].findall(source))
    return source if suffix == ".md" and file != "CHANGELOG.md" else ""


def names_in(text: str) -> set[str]:
    """Return the paths that a text names."""
    return {*FILE.findall(text), *FOLDER.findall(text), *LINK.findall(text)}


def missing(tree: Tree, file: str, source: str) -> set[str]:
    """Return the paths that a file names and that do not exist."""
    suspects = {name for name in names_in(source) if not INVENTED.search(name) and not tree.has(name, file)}
    return suspects & names_in(prose_of(file, source)) if suspects else suspects  # reading comments takes long


def listed_modules(source: str) -> set[str]:
    """Return the modules and folders that a package's docstring lists."""
    docstring = ast.get_docstring(ast.parse(source), clean=False) or ""
    return {name for row in LISTED.findall(docstring) for name in (row[0] or row[1]).split(", ")}


def modules_in(tree: Tree, folder: str, suffix: str = "") -> set[str]:
    """Return the names of a folder's files that end so, without their endings, and of its folders."""
    inside = {path.removeprefix(f"{folder}/") for path in tree.files if path.startswith(f"{folder}/")}
    return {PurePosixPath(path.split("/")[0]).stem for path in inside if path.endswith(suffix)} - {"__init__"}


def missing_modules(tree: Tree, file: str, source: str) -> set[str]:
    """Return the modules and folders that a package's docstring lists and that are not in its folder."""
    return listed_modules(source) - modules_in(tree, posixpath.dirname(file))


def test_each_path_that_is_named_exists(tree: Tree) -> None:
    readable = tuple(f".{suffix}" for suffix in SUFFIXES.split("|") if suffix != "blend")
    found = {
        (file, name)
        for file in tree.files
        if file.endswith(readable)
        for name in missing(tree, file, (tree.root / file).read_text(encoding="utf-8"))
    }
    assert sorted((file, name) for file, name in found if name not in EXCUSED) == []
    assert EXCUSED - {name for _, name in found} == set()  # excuses that nothing needs


def test_each_module_that_a_package_lists_exists(tree: Tree) -> None:
    packages = [file for file in tree.files if file.endswith("/__init__.py")]
    sources = {file: (tree.root / file).read_text(encoding="utf-8") for file in packages}
    assert {file: names for file, text in sources.items() if (names := missing_modules(tree, file, text))} == {}


def test_each_package_of_the_add_on_lists_its_modules(tree: Tree) -> None:
    """Packages of two modules or fewer are exempt."""
    packages = [file for file in tree.files if file.startswith("addon/") and file.count("/") > 1]
    found = {}
    for file in packages:
        modules = modules_in(tree, posixpath.dirname(file), ".py")
        if file.endswith("/__init__.py") and len(modules) > 2:
            found[file] = modules - listed_modules((tree.root / file).read_text(encoding="utf-8"))
    assert len(found) > 20
    assert {file: names for file, names in found.items() if names} == {}


def test_functions_of_states_are_in_their_files(repository: Path) -> None:
    rows = re.findall(r"\| `([\w:.]+)` \| `([\w/.]+)` \|$", (repository / "docs/states.md").read_text(), re.MULTILINE)
    assert len(rows) > 30
    for name, file in rows:
        *owner, last = re.split(r"\.|::", name)
        source = (repository / file).read_text(encoding="utf-8")
        assert re.search(rf"\b{last}\b", source) and all(part in source for part in owner), (name, file)


def test_names_of_what_has_gone_are_found(tree: Tree) -> None:
    package = '"""Light.\n\nmodel   numbers\npaths, beams   light\nlight_tables   the same\nthe_long_module it\n"""'
    assert missing_modules(tree, "addon/scanning/light/__init__.py", package) == {"light_tables", "the_long_module"}
    module = '"""See `light.py`, `light/model.py`, `scan.py`, `ways/`, `sensors/`."""\nA = "gone.py"  # or left.py'
    assert missing(tree, "addon/scanning/piece_scan.py", module) == {"light.py", "ways", "left.py"}
    assert missing(tree, "docs/farm.md", "[a](../README.md) [b](../READ.md) https://a.org/b.py") == {"../READ.md"}
    header = 'auto a = "b.h";  // as math/triangle.h and math/beam.h'
    assert missing(tree, "native/src/blas/blas.h", header) == {"math/beam.h"}
