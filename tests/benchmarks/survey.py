"""Which features of other people's files are not shown: counts over folders of .blend, .gltf and .glb files.

    python tests/benchmarks/survey.py FOLDER ... --json survey.json [--table OUT] [--sheets FOLDER]

Each file is rendered in a separate process, with one sample on a few pixels. The entries of `report.not_shown` are
counted by feature, and by the files that they occur in: names of materials, images and nodes are left out of a feature.
Files that cannot be opened, that take longer than --timeout, or whose render fails are listed with the reason.
`--sheets` also renders files at `--size`, with Cycles too: ours, Cycles' and four times the difference, side by side. A
file without a camera is rendered from the front, above and aside; one without any light gets a grey world and a sun.
"""

from __future__ import annotations

import argparse
import datetime
import json
import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import takewhile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.rows import write_rows

SUFFIXES = (".blend", ".gltf", ".glb")
LIMITS = Path(__file__).resolve().parents[2] / "docs" / "preview.md"
GROUPS_HEAD = "| not shown | such as |"
ANSWER = "survey: "  # before the JSON of a child process
PROBE_SIZE, SHEET_SAMPLES, GAIN = 16, 64, 4.0
# Parts of a row's text that name data of the file: (pattern, the part to keep).
_NAMES = (
    (re.compile(r"'[^']*'"), "..."),
    (re.compile(r"^.* \((?!Legacy\))([^()]*(?:\(Legacy\))?)\)(?= |$)"), r"\1"),  # a node's label comes before its type
    (re.compile(r"^(the projection \w+) of .*"), r"\1"),
    (re.compile(r"^.* as Color$"), "an image as the color of a light"),
    (re.compile(r"\d[\d.,]*"), "N"),
)


def feature_of(kind: str, text: str, name: str = "") -> str:
    """Return the subject of a row of `not_shown`, without the names that a file has given.

    name: of a setting, as Blender defines it.
    """
    what = text.split(" is unsupported; ")[0].split("; ")[0]
    for pattern, kept in _NAMES:
        what = pattern.sub(kept, what)
    setting = re.sub("^View Layer .*", "View Layer", name) + ": " if kind == "setting" else ""
    return f"{kind}: {setting}{what}"


def find_files(folder: Path, most: int | None = None) -> list[Path]:
    """Return the files of the surveyed kinds, sorted; at most this number, evenly spaced among them."""
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    if most is None or len(found) <= most:
        return found
    return [found[row * len(found) // most] for row in range(most)]


def count(answers: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each feature: in how many files it occurs, how often, and a file; most files first."""
    files: dict[str, list[str]] = defaultdict(list)
    times: Counter[str] = Counter()
    for answer in answers:
        rows = answer.get("not_shown", [])
        times.update(rows)
        for feature in dict.fromkeys(rows):
            files[feature].append(answer["file"])
    found = sorted(files, key=lambda feature: (-len(files[feature]), feature))
    return [{"feature": name, "files": len(files[name]), "times": times[name], "in": files[name][0]} for name in found]


def read_groups(text: str) -> dict[str, tuple[str, ...]]:
    """Return the entries of the table of unsupported features: names of features and nodes, by the names of rows."""
    lines = text[text.index(GROUPS_HEAD) :].splitlines()[2:]
    rows = [line.strip("| ").split(" | ") for line in takewhile(lambda line: line.startswith("|"), lines)]
    return {row[0]: tuple(row[1].split(", ")) for row in rows}


def count_groups(answers: Sequence[Mapping[str, Any]], groups: Mapping[str, Sequence[str]]) -> dict[str, int]:
    """Return the number of files in which each group occurs, "" for features in no group; the longest name counts."""
    names = sorted(((name, group) for group in groups for name in groups[group]), key=lambda pair: -len(pair[0]))
    files: Counter[str] = Counter(dict.fromkeys([*groups, ""], 0))
    for answer in answers:
        rows = answer.get("not_shown", [])
        found = [next((group for name, group in names if name.lower() in row.lower()), "") for row in rows]
        files.update(set(found))
    return files


def format_markdown(answers: Sequence[Mapping[str, Any]], rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the counts as a Markdown table."""
    failed = [answer for answer in answers if "error" in answer]
    lines = [
        f"{len(answers) - len(failed)} files were read on {datetime.date.today()}, {len(failed)} could not be.",
        "",
        "| feature | files | times |",
        "|---|--:|--:|",
        *(f"| {row['feature']} | {row['files']} | {row['times']} |" for row in rows),
        *(["", "| not read | why |", "|---|---|"] if failed else []),
        *(f"| {answer['file']} | {answer['error']} |" for answer in failed),
    ]
    return "\n".join(lines) + "\n"


def run(path: Path, name: str, sheet: Path | None, chosen: argparse.Namespace) -> dict[str, Any]:
    """Survey a file in a separate process. name: its name in the figures. sheet: where its images go."""
    command = [sys.executable, __file__, str(path), "--child", "--size", str(chosen.size)]
    command += [] if sheet is None else ["--sheets", str(sheet)]
    try:
        made = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=chosen.timeout)
    except subprocess.TimeoutExpired:
        return {"file": name, "error": f"it took more than {chosen.timeout} s"}
    answers = [line for line in made.stdout.splitlines() if line.startswith(ANSWER)]
    if not answers:
        last = (made.stderr.strip().splitlines() or [""])[-1]
        return {"file": name, "error": f"exit status {made.returncode}: {last}"[:200]}
    return {"file": name, **json.loads(answers[-1].removeprefix(ANSWER))}


# A child's work -------------------------------------------------------------------------------------------------------


def survey(path: Path, sheet: Path | None, size: int) -> dict[str, Any]:
    """Open and render one file. Returns its features that are not shown, or an error; writes the sheet."""
    import bpy
    import perfect_bvh_addon
    from perfect_bvh_addon.statistics.not_shown import told

    perfect_bvh_addon.register()
    try:
        _open(path)
        scene = bpy.context.scene
        _make_renderable(scene)
        scene.render.engine = "PERFECT_BVH"
        scene.render.resolution_x = scene.render.resolution_y = PROBE_SIZE
        scene.render.resolution_percentage, scene.perfect_bvh.samples = 100, 1
        scene.perfect_bvh.mode, scene.render.use_motion_blur = "PREVIEW", False
        scene.render.use_compositing = scene.render.use_sequencer = False
        bpy.ops.render.render()
        answer = {"not_shown": [feature_of(row.kind, row.text, row.name) for row in told(scene)]}
        if sheet is not None:
            answer |= _make_sheet(scene, sheet, path.stem, size)
    except (RuntimeError, ValueError, MemoryError) as error:
        return {"error": (str(error).strip().splitlines() or [type(error).__name__])[-1][:200]}
    return answer


def _open(path: Path) -> None:
    import addon_utils
    import bpy

    if path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
        return
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("io_scene_gltf2")
    bpy.ops.import_scene.gltf(filepath=str(path))


def _make_renderable(scene: Any) -> None:
    """Give a scene a camera and light, where it has none."""
    import bpy
    import numpy as np
    from mathutils import Vector

    shown = [obj for obj in scene.objects if obj.type in {"MESH", "CURVE", "SURFACE", "FONT", "META"}]
    if scene.camera is None:
        boxes = [obj.matrix_world @ Vector(corner) for obj in shown for corner in obj.bound_box]
        low, high = (np.min(boxes, axis=0), np.max(boxes, axis=0)) if boxes else (np.zeros(3), np.ones(3))
        radius = max(float(np.linalg.norm(high - low)) / 2.0, 1e-3)
        camera = bpy.data.objects.new("Survey", bpy.data.cameras.new("Survey"))
        away = Vector((0.55, -1.0, 0.45)).normalized()
        camera.location = Vector((low + high) / 2.0) + away * 2.9 * radius
        camera.rotation_euler = away.to_track_quat("Z", "Y").to_euler()
        camera.data.clip_start, camera.data.clip_end = radius / 100.0, radius * 100.0
        scene.collection.objects.link(camera)
        scene.camera = camera
    if scene.world is None and not any(obj.type == "LIGHT" for obj in scene.objects):
        world = scene.world = bpy.data.worlds.new("Survey")
        world.use_nodes = True
        world.node_tree.nodes["Background"].inputs[0].default_value = (0.4, 0.4, 0.4, 1.0)
        sun = bpy.data.objects.new("Survey sun", bpy.data.lights.new("Survey sun", "SUN"))
        sun.data.energy, sun.rotation_euler = 2.0, (0.7, 0.2, 0.3)
        scene.collection.objects.link(sun)


def _make_sheet(scene: Any, sheet: Path, title: str, size: int) -> dict[str, Any]:
    """Write ours, Cycles' and the difference as one PNG with labels. Returns how the means of channels differ."""
    import numpy as np
    from oracles.cycles import render_beside
    from PIL import Image, ImageDraw

    scene.render.resolution_x = scene.render.resolution_y = size
    ours, theirs = (image[..., :3].astype(np.float64) for image in render_beside(scene, SHEET_SAMPLES))
    bar = 16  # pixels for the labels
    wide = Image.new("RGB", (3 * size, size + bar))
    differences = np.abs(ours - theirs) * GAIN
    off = (ours.mean(axis=(0, 1)) / np.maximum(theirs.mean(axis=(0, 1)), 1e-6) - 1.0).tolist()
    parts = ", ".join(f"{100 * part:+.1f} %" for part in off)
    labels = (f"{title}: Perfect BVH", "Cycles", f"difference x {GAIN:.0f}; means {parts}")
    for column, (image, label) in enumerate(zip((ours, theirs, differences), labels, strict=True)):
        curve = np.where(image <= 0.0031308, 12.92 * image, 1.055 * np.maximum(image, 0.0) ** (1 / 2.4) - 0.055)
        wide.paste(Image.fromarray((np.clip(curve, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)), (column * size, bar))
        ImageDraw.Draw(wide).text((column * size + 3, 2), label, fill="white")
    sheet.parent.mkdir(parents=True, exist_ok=True)
    wide.save(sheet)
    return {"means_off": off}


def main() -> None:
    """Survey all files, write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("folders", nargs="+", type=Path, metavar="FOLDER", help="where files are looked for")
    add("--json", type=Path, metavar="OUT.json", help="where the figures go")
    add("--table", type=Path, metavar="OUT", help="where the table goes; printed without it")
    add("--sheets", type=Path, metavar="FOLDER", help="where images of each file go")
    add("--size", type=int, default=240, metavar="W", help="of the images of sheets, in pixels")
    add("--workers", type=int, default=2, metavar="N", help="how many processes")
    add("--most", type=int, metavar="N", help="files of each folder, evenly spaced among them; all by default")
    add("--timeout", type=int, default=120, metavar="S", help="seconds for each file")
    add("--child", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.child:
        print(ANSWER + json.dumps(survey(chosen.folders[0], chosen.sheets, chosen.size)), flush=True)
        return
    files = [(folder, path) for folder in chosen.folders for path in find_files(folder, chosen.most)]

    def one(place: tuple[Path, Path]) -> dict[str, Any]:
        folder, path = place
        name = str(path.relative_to(folder.parent))
        sheet = None if chosen.sheets is None else chosen.sheets / f"{name.replace('/', '_')}.png"
        answer = run(path, name, sheet, chosen)
        print(f"{name}: {answer.get('error', len(answer.get('not_shown', [])))}", file=sys.stderr, flush=True)
        return answer

    with ThreadPoolExecutor(chosen.workers) as pool:
        answers = list(pool.map(one, files))
    rows = count(answers)
    groups = count_groups(answers, read_groups(LIMITS.read_text(encoding="utf-8")))
    if chosen.json is not None:
        write_rows(
            chosen.json, {"date": str(datetime.date.today()), "groups": groups, "features": rows, "files": answers}
        )
    table = format_markdown(answers, rows)
    if chosen.table is None:
        print(table)
    else:
        chosen.table.write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
