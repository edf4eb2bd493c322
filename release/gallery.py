"""Run all examples and write a page of their pictures, with the charts and the other pictures of the repository.

python release/gallery.py FOLDER [--width W]

FOLDER gets the page and the files of each example. Its links to charts hold in the site's sources, where `nox -s docs`
makes it.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
CHARTS = "tests/charts"
CHART = re.compile(r"^## (.+?)$.*?^!\[[^\]]*\]\(pictures/(\w+\.png)\)", re.MULTILINE | re.DOTALL)
# Other pictures of the repository, and the programs that made them.
OTHERS = {
    "blend_scenes/pictures/courtyard.png": "`perfect-bvh render blend_scenes/courtyard.blend -o courtyard.png`",
    "blend_scenes/pictures/meadow.jpg": "`perfect-bvh render blend_scenes/meadow.blend -o meadow.png --samples 10`",
    "blend_scenes/pictures/in_blender.jpg": "a screenshot of a Rendered viewport in Blender 5.2",
    "blend_scenes/pictures/walk_a_ray.jpg": "a screenshot of *Walk a Ray* in Blender 5.2",
    "blend_scenes/pictures/bake_rays.jpg": "a screenshot of *Bake Sun, Sky and Thickness* over a year in Blender 5.2",
    "docs/pictures/walk.png": "[a data set, step by step](../docs/data_set.md)",
}


@dataclass(frozen=True)
class Made:
    """An example's output, and the files that it wrote."""

    printed: str
    files: tuple[Path, ...]


def list_examples() -> list[Path]:
    """Return the examples: each file of `examples/` except the one that they share."""
    return sorted(path for path in (REPOSITORY / "examples").glob("*.py") if path.name != "shared.py")


def run_example(example: Path, folder: Path, width: int | None) -> Made:
    """Run an example; its files go into a new folder of its name. Raises RuntimeError with its output if it fails."""
    own = folder / example.stem
    command = [sys.executable, str(example), str(own), *([] if width is None else [str(width)])]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{example.name} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return Made(done.stdout, tuple(sorted(own.iterdir())))


def make_gallery(folder: Path, width: int | None = None) -> dict[str, Made]:
    """Run all examples into a folder and write its page. Return the results of each, by its name."""
    made = {example.name: run_example(example, folder, width) for example in list_examples()}
    (folder / "index.md").write_text(page_of(made, folder), encoding="utf-8")
    return made


def page_of(made: dict[str, Made], folder: Path) -> str:
    """Return the page: each example with its pictures, then the charts, then other pictures."""
    charts = CHART.findall((REPOSITORY / CHARTS / "README.md").read_text(encoding="utf-8"))
    count = count_pictures(made) + len(charts) + len(OTHERS)
    lines = [
        "# Gallery",
        "",
        f"{count} pictures, and what made each. Numbers are drawn from violet, the least, to yellow.",
        "",
    ]
    for name, result in made.items():
        about = ast.get_docstring(ast.parse((REPOSITORY / "examples" / name).read_text(encoding="utf-8")))
        lines += [f"## {name.removesuffix('.py').replace('_', ' ').capitalize()}", "", about or "", ""]
        lines += [f"`python examples/{name}`", ""]
        pictures = [path for path in result.files if path.suffix == ".png"]
        look = "{ width=300 }" if len(pictures) > 1 else "{ width=640 }"
        lines += [f"![{path.stem}]({path.relative_to(folder).as_posix()}){look}" for path in pictures]
        lines += (
            ["", f"From left to right: {', '.join(path.stem for path in pictures)}.", ""] if len(pictures) > 1 else [""]
        )
    lines += ["## Charts", "", f"Drawn by `nox -s charts`; [what each says](../{CHARTS}/README.md).", ""]
    lines += [f"![{title}](../{CHARTS}/pictures/{name}){{ width=640 }}" for title, name in charts]
    lines += ["", "## Other pictures", ""]
    for path, how in OTHERS.items():
        lines += [f"![{Path(path).stem}](../{path}){{ width=640 }}", "", f"Made by {how}.", ""]
    return "\n".join(lines)


def count_pictures(made: dict[str, Made]) -> int:
    """Return how many pictures the examples wrote."""
    return sum(path.suffix == ".png" for result in made.values() for path in result.files)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Run all examples and write a page of their pictures.")
    parser.add_argument("folder", type=Path, help="new folder for the page and the examples' files")
    parser.add_argument("--width", type=int, help="width of pictures in pixels (default: each example's own)")
    arguments = parser.parse_args()
    made = make_gallery(arguments.folder, arguments.width)
    sys.stdout.write(f"{count_pictures(made)} pictures by {len(made)} examples in {arguments.folder}\n")


if __name__ == "__main__":
    main()
