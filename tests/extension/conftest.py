"""The zip that `nox -s extension` has built."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def extension(repository: Path) -> Path:
    found = sorted((repository / "dist").glob("perfect_bvh-*.zip"))
    if not found:
        pytest.skip("no zip in dist: `nox -s extension` builds it")
    return found[-1]
