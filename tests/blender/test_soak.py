"""A share of the random edits that `nox -s soak` goes on with: see `soak.py`."""

from __future__ import annotations

import pytest
from blender.soak import KINDS, Kind, Soak


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("watches", [True, False], ids=["handlers on", "handlers off"])
def test_random_edits(watches: bool, kind: Kind) -> None:
    soak = Soak(3, watches=watches, kind=kind)
    try:
        for _ in range(125):
            soak.step()
    finally:
        soak.close()
    # What the test is about has happened.
    assert soak.counts["meshes"] > 500
    assert (soak.counts["meshes passed over"] > 100) == watches
    assert watches or soak.counts["read again"] == 0
    assert kind != "objects" or (soak.counts["read again"] > 5) == watches
    assert (soak.counts["instances read from geometry"] > 100) == (kind != "objects")
    assert (soak.counts["objects looked up in the list"] > 0) == (kind == "mixed")
    assert soak.counts["render"] > 0
    assert soak.counts["render of the engine"] > 0
    assert soak.counts["reopen"] > 0
