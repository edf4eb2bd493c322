"""Find alarming lines on a Blender's console; `python console_alarms.py FILE` prints them and fails if there are any.

Imports neither Blender nor another library: windows.sh runs it with any Python, a step within Blender's own.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

# Blender reports unfreed memory last, on quitting: "Error: Not freed memory blocks: 4, total unfreed memory ... MB".
ALARMS = re.compile(
    r"traceback \(most recent call last\)|error: python:|fatal python error|segmentation fault"
    r"|not freed memory|freeing memory after the leak detector",
    re.IGNORECASE,
)


def find_alarms(text: str) -> list[str]:
    """Return the lines of a console that report a crash, an exception or a leak, each behind its number."""
    return [f"{number}: {line}" for number, line in enumerate(text.splitlines(), 1) if ALARMS.search(line)]


def main(file: str) -> int:
    """Print the alarms in a file; return 1 if there are any, else 0."""
    alarms = find_alarms(Path(file).read_text(encoding="utf-8", errors="replace"))
    for alarm in alarms:
        print(alarm)
    return 1 if alarms else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
