from __future__ import annotations

from pathlib import Path

import pytest
from extension.zips import need_zip, this_platform


@pytest.fixture(scope="session")
def extension() -> Path:
    """The zip for this machine."""
    return need_zip(this_platform())


@pytest.fixture(scope="session")
def arm64_extension() -> Path:
    """The zip for Linux on 64-bit ARM, which an emulator runs."""
    return need_zip("linux-arm64")
