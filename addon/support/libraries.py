"""Libraries that only some files need, imported when they do."""

from __future__ import annotations

import importlib
from typing import Any


def data_library(name: str, who_needs: str) -> Any:
    """A module of the extra `data`. who_needs: it, as in "EXR files need OpenEXR".

    Raises ImportError, which says that and what to install.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{who_needs}: pip install 'perfect-bvh[data]'") from error
