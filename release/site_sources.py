"""Gather the sources of the site: the repository's documents and pictures, and pages of reference.

python release/site_sources.py SOURCES PACKAGES

Documents keep their places, so that their links hold. A link to a file that is no page becomes its path; one to an
example, alone on its line, becomes its code. PACKAGES gets both packages under the names that they are imported by, for
mkdocstrings to read.
"""

from __future__ import annotations

import argparse
import ast
import posixpath
import re
import shutil
import subprocess
import sys
from pathlib import Path

import site_tables

REPOSITORY = Path(__file__).resolve().parent.parent
SHOWN = (".md", ".png", ".jpg")
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)", re.DOTALL)
EXAMPLE = re.compile(r"^\[`(examples/\w+\.py)`\]\([^)]*\)$", re.MULTILINE)
COMMANDS = ("render", "scan", "labels", "info", "bench", "calibrate")


def list_files() -> list[str]:
    """Return the paths of all files that git tracks, from the repository's root."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, check=True).stdout
    return [name for name in listed.decode().split("\0") if name]


def with_page_links(text: str, page: str, pages: set[str]) -> str:
    """Return a page's text, in which links to files that are no pages are replaced by their texts and paths."""

    def shown(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(page), link[2]))
        if target in pages:
            return link[0]
        is_known = target in link[1] or target.startswith("..")  # targets outside of the repository have no path
        return link[1] if is_known else f"{link[1]} (`{target}`)"

    return LINK.sub(shown, text)


def with_examples(text: str) -> str:
    """Return a page's text, in which links to examples that are alone on their lines are replaced by their code."""

    def shown(link: re.Match[str]) -> str:
        code = (REPOSITORY / link[1]).read_text(encoding="utf-8").strip()
        return f'```python title="{link[1]}"\n{code}\n```'

    return EXAMPLE.sub(shown, text)


def copy_documents(sources: Path) -> None:
    """Copy documents and pictures."""
    pages = {name for name in list_files() if name.endswith(SHOWN) and not name.startswith(".")}
    for name in pages:
        target = sources / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if name.endswith(".md"):
            text = (REPOSITORY / name).read_text(encoding="utf-8")
            target.write_text(with_page_links(with_examples(text), name, pages), encoding="utf-8")
        else:
            shutil.copyfile(REPOSITORY / name, target)


def exports_of(package: Path) -> dict[str, str]:
    """Return the add-on's public names, and the modules in which they are, as its `_EXPORTS` has them."""
    tree = ast.parse((package / "__init__.py").read_text(encoding="utf-8"))
    (found,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "_EXPORTS"
    )
    exports: dict[str, str] = ast.literal_eval(found)
    return exports


def write_reference(sources: Path) -> None:
    """Write a page for each package, one of the command line's help, and tables of classes' attributes."""
    folder = sources / "reference"
    folder.mkdir()
    (folder / "perfect_bvh.md").write_text(
        "# perfect_bvh\n\nThe engine. It needs no Blender.\n\n::: perfect_bvh\n\n::: perfect_bvh.trimesh\n"
    )
    names = exports_of(REPOSITORY / "addon")
    entries = "".join(f"::: perfect_bvh_addon{module}.{name}\n\n" for name, module in names.items())
    lead = "# perfect_bvh_addon\n\nThe add-on's functions for scripts: a synced scene, scans, labels.\n\n"
    (folder / "perfect_bvh_addon.md").write_text(lead + entries)
    lines = ["# Command line", "", "What `perfect-bvh COMMAND --help` prints.", ""]
    for command in COMMANDS:
        lines += [f"## {command}", "", "```text", help_of(command).strip(), "```", ""]
    (folder / "command_line.md").write_text("\n".join(lines))
    for name, text in site_tables.pages().items():
        (folder / name).write_text(text, encoding="utf-8")


def help_of(command: str) -> str:
    """Return the command's output for `--help`, in lines of 100 letters."""
    script = "import sys; from perfect_bvh_addon.cli import main; sys.argv[0] = 'perfect-bvh'; main()"
    run = (sys.executable, "-c", script, command, "--help")
    return subprocess.run(run, capture_output=True, text=True, check=True, env={"COLUMNS": "100"}).stdout


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Gather the sources of the site.")
    parser.add_argument("sources", type=Path, help="folder for pages")
    parser.add_argument("packages", type=Path, help="folder for links to both packages")
    arguments = parser.parse_args()
    for folder in (arguments.sources, arguments.packages):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    copy_documents(arguments.sources)
    (arguments.packages / "perfect_bvh").symlink_to(REPOSITORY / "native/python/perfect_bvh")
    (arguments.packages / "perfect_bvh_addon").symlink_to(REPOSITORY / "addon")
    write_reference(arguments.sources)


if __name__ == "__main__":
    main()
