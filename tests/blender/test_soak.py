"""A share of the random edits that `nox -s soak` goes on with: see `soak.py`."""

from __future__ import annotations

import pytest
from blender.soak import Soak


@pytest.mark.parametrize("is_plain", [True, False], ids=["read from geometry", "partly from the list"])
@pytest.mark.parametrize("watches", [True, False], ids=["handlers on", "handlers off"])
def test_random_edits(watches: bool, is_plain: bool) -> None:
    soak = Soak(7, watches=watches, is_plain=is_plain)
    try:
        for _ in range(125):
            soak.step()
    finally:
        soak.close()
    # What the test is about has happened.
    assert soak.counts["meshes"] > 500
    assert (soak.counts["meshes passed over"] > 100) == watches
    assert soak.counts["instances read from geometry"] > 200
    assert (soak.counts["objects looked up in the list"] > 20) != is_plain
    assert soak.counts["render"] > 0
