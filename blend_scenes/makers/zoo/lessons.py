"""The start of each file: the instructions, the result to see, and the mode and frame in which it opens.

Depends neither on Blender nor on the engine.
"""

from __future__ import annotations

import json
import textwrap
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from . import FailureCase
from .instructions import DO, PICTURED

FIGURES = Path(__file__).resolve().parents[3] / "tests" / "charts" / "data" / "zoo.json"
SCRIPTS = Path(__file__).parent / "scripts"
WIDTH = 76  # of lines in scripts
PICTURES = {
    "COST": "The picture shows how many boxes and triangles each pixel's ray tests, on one fixed scale.",
    "WIREFRAME": "The picture shows the triangles that the rays meet, by their edges.",
    "NORMAL": "The picture shows the normals of what the rays meet; a ray that is lost leaves a hole.",
    "INSTANCE": "The picture shows the objects that the rays meet, each in a colour of its own.",
}
_BELOW = "Below it is the same picture as the usual method gives it."
_COMPARE = (
    "To see both trees press Compare in the sidebar of the view (N), tab Perfect BVH, under Trees: on the left is the "
    "usual method's, on the right this engine's."
)
_DECAY = "Bench, below that, measures what trees cost that are refitted only, governed or rebuilt, frame by frame."
# The two sides of Compare for each usual method.
COMPARED = {
    "median splits": ("MEDIAN", "AUTO"),
    "the best of all object splits": ("SWEEP", "SPATIAL"),
    "refit only": ("REFITTED", "AUTO"),
}


@dataclass(frozen=True, slots=True)
class Lesson:
    """How a file opens.

    state: index of the state on whose frame. text: content of its Text Editor, as `text_name`. method: the usual one.
    compare: the two sides that the sidebar compares, as the scene keeps them.
    """

    mode: str
    state: int
    text_name: str
    text: str
    method: str
    compare: tuple[str, str] | None


def lesson_of(case: FailureCase) -> Lesson:
    """The lesson of a case; its figures are those that the zoo's table has."""
    do = DO[case.name]
    states = len(case.states())
    state = states - 1 if do.state is None else do.state
    method = _figures()[case.name]["method"]
    rest = method, COMPARED.get(method)
    paragraphs = _paragraphs(case, do.words, do.mode, states)
    if do.script:
        words = "\n\n".join(textwrap.fill(part, WIDTH) for part in paragraphs)
        return Lesson(do.mode, state, f"{case.name}.py", f'"""{words}\n"""\n\n{_script(case.name)}', *rest)
    return Lesson(do.mode, state, case.title, "\n\n".join(paragraphs) + "\n", *rest)  # the editor wraps it


def _paragraphs(case: FailureCase, do: str, mode: str, states: int) -> list[str]:
    figures = _figures()[case.name]
    loses, ours = (_shown(figures[key], figures["unit"]) for key in ("naive", "ours"))
    played = [f"The {states} states are eight frames apart."] if states > 1 else []
    below = [_BELOW] if case.name in PICTURED else []
    method = figures["method"]
    trees = [_COMPARE] if method in COMPARED else []
    trees += [_DECAY] if method == "refit only" else []
    return [
        " ".join([do, *played]),
        " ".join([PICTURES[mode], *below]),
        *([" ".join(trees)] if trees else []),
        f"{case.title}.",
        f"What fails: {case.breaks}",
        f"The usual method, {figures['method']}: {loses}. This engine: {ours}.",
        f"How this engine answers: {case.held}",
        f"Seen in: {case.source}.",
    ]


def _script(name: str) -> str:
    """A self-contained script: the functions that it imports from common are copied into it."""
    source, common = ((SCRIPTS / f"{part}.py").read_text(encoding="utf-8") for part in (name, "common"))
    head, body = source.split("\n\n\n", 1)
    imports, functions = common.split("\n\n\n", 1)
    lines = {line for line in (head + "\n" + imports).splitlines() if line and not line.startswith("from .common")}
    return "\n".join([*sorted(lines), "\n", functions.rstrip(), "\n", body])


@cache
def _figures() -> dict[str, dict[str, Any]]:
    cases = json.loads(FIGURES.read_text(encoding="utf-8"))["cases"]
    return {case["name"]: case for case in cases}


def _shown(value: float, unit: str) -> str:
    """Two digits: further ones change with each change of a builder."""
    number = float(f"{value:.2g}")
    return f"{number:.1f} {unit}" if unit == "times the work" else f"{number:,.0f} {unit}"
