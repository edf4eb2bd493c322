"""Find words that readers stumble over: `python tests/plain_words.py` prints each with a better one, and fails.

PLAIN lists the documents to check, and PLAIN_CODE the sources, of which comments, docstrings and messages count. Both
list what has been revised. Add others once they have been.
"""

from __future__ import annotations

import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PLAIN = ("README.md", "SECURITY.md", "CONTRIBUTING.md", "docs/**/*.md", ".github/**/*.md", ".github/**/*.yml")
PLAIN += ("examples/README.md", "native/README.md", "blend_scenes/README.md", "tests/charts/README.md")
PLAIN += ("addon/scanning/light/README.md", "ARCHITECTURE.md", "tests/benchmarks/README.md")
PLAIN_CODE = ("addon/**/*.py", "native/python/**/*.py*", "native/src/**/*.*", "native/bindings/**/*.*")
PLAIN_CODE += ("examples/*.py", "release/*.py", "noxfile.py")
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
    r"(?:is|are) not shown; .* (?:is|are)": "X is unsupported; Y is used",
    r"as if sorted anew|next to no time": "again, hardly any time",
    r"rays? (?:meets?|met)": "hit",
    r"(?:given|gives?) (?:it|this|them) up": "drop, abort",
    r"come or go|came or went|comes and goes": "are added or removed, appear, disappear",
    r"(?:is|are) there (?:already|and whole)": "exists, is complete",
    r"whole pass|of one's own|by itself alone": "sweep, your own, alone",
}
# Of the words, names and phrases that are the field's.
ALLOWED = re.compile(
    r"`[^`]*`|--piece|things in the picture|everything|nothing|anything|something|\]\([^)]*\)|Thing \{|\{[^{}]*\}"
    r"|Mirror Ball|\b(?:things?|pieces?)(?:: |  )|pieces is now called|segments and pieces are the same|rows? of things"
)
TEXTS = {tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}  # the last from 3.12
COMMENT_OR_TEXT = re.compile(r'//[^\n]*|"(?:\\.|[^"\\\n])*"')


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


def texts_in(path: str, source: str) -> Iterator[tuple[int, str]]:
    """Yield the texts of a file for readers, with their first lines: of sources comments and strings of some words."""
    if path.endswith((".py", ".pyi")):
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type in TEXTS and " " in token.string:
                yield token.start[0], token.string
    elif path.endswith((".h", ".inl", ".cpp")):
        for found in COMMENT_OR_TEXT.finditer(source):
            if " " in found[0]:
                yield source.count("\n", 0, found.start()) + 1, found[0]
    elif path.endswith((".md", ".yml")):
        yield 1, source


def main() -> int:
    """Print the words found; return the exit status."""
    paths = sorted({path for pattern in PLAIN + PLAIN_CODE for path in REPOSITORY.glob(pattern) if path.is_file()})
    count = 0
    for path in paths:
        for first, text in texts_in(path.name, path.read_text(encoding="utf-8")):
            for number, word, better in find_words(text):
                count += 1
                line = f"{path.relative_to(REPOSITORY).as_posix()}:{first + number - 1}"
                sys.stdout.write(f"{line}: {word!r}; better: {better}\n")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
