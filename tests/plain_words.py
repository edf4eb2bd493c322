"""Find words that readers stumble over: `python tests/plain_words.py` prints each with a better one, and fails.

PLAIN lists the documents to check: those whose words have been revised. Add others once theirs have been.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PLAIN = ("README.md", "SECURITY.md", "CONTRIBUTING.md", "docs/**/*.md", ".github/**/*.md", ".github/**/*.yml")
PLAIN += ("examples/README.md", "native/README.md", "blend_scenes/README.md", "tests/charts/README.md")
PLAIN += ("addon/scanning/light/README.md", "ARCHITECTURE.md", "tests/benchmarks/README.md")
# A pattern, and its replacement.
INSTEAD = {
    r"whatever|whoever|wherever|whichever": "any, all, or who and what it is",
    r"beside": "next to, with, compared with",
    r"meanwhile": "during that, at the same time",
    r"anew": "again",
    r"nobody": "no one, or name who",
    r"all but for|but for|all but": "except",
    r"stands? (?:for|in|at|there)": "means, is in, is",
    r"tells? (?:of|how|which|what|apart)|told of": "say, report, show",
    r"knows? (?:no|nothing)": "has no, does not depend on",
    r"as it is, is|as they are, are": "unchanged",
    r"so (?:many|long|far) (?:as|of)": "as many as, while, until",
    r"key moments?": "time sample",
    r"pieces?": "chunk (of frames)",
    r"balls?": "sphere",
    r"things?": "object, object instance, or name it",
    r"what (?:is|was|has|does) (?:met|to be)": "name it",
    r"comes? of": "results from",
}
# Of the words, names and phrases that are the field's.
ALLOWED = re.compile(r"`[^`]*`|--piece|things in the picture|everything|nothing|anything|something|\]\([^)]*\)")


def find_words(text: str) -> list[tuple[int, str, str]]:
    """Return (line, word, better) of each that is found; code and links are left out."""
    found, is_code = [], False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            is_code = not is_code
        if is_code:
            continue
        plain = ALLOWED.sub(" ", line)
        for pattern, better in INSTEAD.items():
            found += [(number, match[0], better) for match in re.finditer(rf"\b(?:{pattern})\b", plain, re.IGNORECASE)]
    return found


def main() -> int:
    """Print the words found; return the exit status."""
    paths = sorted({path for pattern in PLAIN for path in REPOSITORY.glob(pattern)})
    count = 0
    for path in paths:
        for number, word, better in find_words(path.read_text(encoding="utf-8")):
            count += 1
            sys.stdout.write(f"{path.relative_to(REPOSITORY).as_posix()}:{number}: {word!r}; better: {better}\n")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
