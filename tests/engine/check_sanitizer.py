"""AddressSanitizer watches this process and the engine's module. Not collected unless named: `nox -s sanitize` does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import perfect_bvh

OVERRUN = """
import ctypes
malloc = ctypes.CDLL(None).malloc
malloc.restype = ctypes.c_void_p
ctypes.string_at(malloc(64), 65)
"""


def test_the_engine_is_the_instrumented_one() -> None:
    module = Path(str(sys.modules["perfect_bvh._core"].__file__))
    assert module.parent == Path(perfect_bvh.__file__).parent
    program = module.read_bytes()
    assert b"__asan_report_load" in program
    assert b"__ubsan_handle" in program


def test_an_overrun_ends_the_process() -> None:
    result = subprocess.run([sys.executable, "-c", OVERRUN], capture_output=True, text=True, check=False)
    assert result.returncode != 0
    assert "AddressSanitizer: heap-buffer-overflow" in result.stderr
