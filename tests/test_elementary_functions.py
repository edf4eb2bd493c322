"""Code behind answers and images calls no elementary function of a C library, as each system's rounds differently."""

from __future__ import annotations

import re
from pathlib import Path

NAMES = "sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot"
CALL = re.compile(rf"std::({NAMES})\(")
# Which tree is built, and how good one is: the same rays hit the same triangles either way.
DECISIONS = {"update/governor.cpp", "builders/quality.cpp"}


def test_answers_and_images_are_made_without_them(repository: Path) -> None:
    source = repository / "native" / "src"
    files = [path for path in source.rglob("*") if path.suffix in {".h", ".inl", ".cpp"}]
    callers = {path.relative_to(source).as_posix() for path in files if CALL.search(path.read_text(encoding="utf-8"))}
    assert len(files) > 150
    assert callers == DECISIONS, "native/src/math/elementary.h has them"


def test_bindings_call_none(repository: Path) -> None:
    for path in (repository / "native" / "bindings").rglob("*.cpp"):
        assert not CALL.search(path.read_text(encoding="utf-8")), path
