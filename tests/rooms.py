"""Print files and lines of each folder of the product, and the change since the last release.

`python tests/rooms.py` prints them; `--release` stores today's counts as the last release's.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
RELEASED = Path(__file__).with_name("rooms.json")
PRODUCT = ("addon", "native/src", "native/bindings", "native/python")


def count_rooms(root: Path = REPOSITORY) -> dict[str, tuple[int, int]]:
    """Files and lines that git lists, by folder."""
    listed = subprocess.run(("git", "ls-files", *PRODUCT), cwd=root, check=True, capture_output=True, text=True).stdout
    files, lines = Counter[str](), Counter[str]()
    for name in listed.splitlines():
        path = root / name
        if path.is_file():
            files[str(Path(name).parent)] += 1
            lines[str(Path(name).parent)] += path.read_bytes().count(b"\n")
    return {room: (files[room], lines[room]) for room in sorted(files)}


def table(now: Mapping[str, Sequence[int]], released: Mapping[str, Sequence[int]]) -> str:
    """A row for each folder, and one for all: files and lines, each followed by its change since the release."""
    none = (0, 0)
    rows = [(room, now.get(room, none), released.get(room, none)) for room in sorted({*now, *released})]
    rows.append(("all", _total(now), _total(released)))
    written = [f"{'folder':30} {'files':>5} {'':>5} {'lines':>6} {'':>6}"]
    for room, here, there in rows:
        more_files, more_lines = here[0] - there[0], here[1] - there[1]
        written.append(f"{room:30} {here[0]:5} {more_files:+5} {here[1]:6} {more_lines:+6}")
    return "\n".join(written)


def _total(rooms: Mapping[str, Sequence[int]]) -> tuple[int, int]:
    return sum(counts[0] for counts in rooms.values()), sum(counts[1] for counts in rooms.values())


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Print files and lines by folder, and the change since the last release."
    )
    parser.add_argument("--release", action="store_true", help="store today's counts as the last release's")
    now = count_rooms()
    if parser.parse_args().release:
        rows = ",\n".join(f"  {json.dumps(room)}: {json.dumps(counts)}" for room, counts in now.items())
        RELEASED.write_text(f"{{\n{rows}\n}}\n", encoding="utf-8")
    released = json.loads(RELEASED.read_text(encoding="utf-8"))
    sys.stdout.write(table(now, released) + "\n")


if __name__ == "__main__":
    main()
