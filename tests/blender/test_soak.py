"""A small part of the random edits that `nox -s soak` runs: see `soak.py`."""

from __future__ import annotations

import pytest
from blender.soak import Kind, Soak
from blender.soak_halves import HALVES

# Every case has each of these for any seed: usual edits, and those that syncs of this kind tend to miss.
USUAL_EDITS = {
    *("add", "delete", "move", "deform", "retopologise", "parent", "unparent", "hide", "hide_with_the_eye"),
    *("link_data", "unlink", "relink", "duplicate", "add_modifier", "remove_modifier", "switch_modifier"),
    *("sway", "thicken", "grow", "replace_round", "sprout", "comb_particles", "count_strands", "dye", "change_dye"),
    *("change_frame", "undo", "redo", "edit_in_edit_mode", "rename", "reopen"),
}

# Events of updates in halves.
HAPPENED = {"hold", "look", "look_all", "stop", "ask_to_stop", "update", "linger", "joined", "not yet", "WorkerError"}


@pytest.mark.parametrize(
    ("watches", "kind", "seed"),
    [
        (True, "objects", 11),
        (True, "mixed", 63),
        (False, "mixed", 13),
        pytest.param(True, "geometry", 8, marks=pytest.mark.long),
        pytest.param(False, "objects", 10, marks=pytest.mark.long),
        pytest.param(False, "geometry", 8, marks=pytest.mark.long),
    ],
)
def test_random_edits(watches: bool, kind: Kind, seed: int) -> None:
    """Take 125 steps, and up to 400 until every edit and event that the test is about has happened.

    watches: whether Blender's handlers log the evaluated data.
    """
    usual = USUAL_EDITS | {HALVES + name for name in HAPPENED} | {"render", "render of the engine"}
    usual |= {"change_fur"} if kind == "mixed" else set()
    soak, steps = Soak(seed, watches=watches, kind=kind), 0
    try:
        while steps < 125 or (steps < 400 and any(soak.counts[name] == 0 for name in usual)):
            soak.step()
            steps += 1
    finally:
        soak.close()
    assert not {name for name in usual if soak.counts[name] == 0}
    assert soak.counts["meshes"] > 500
    assert (soak.counts["meshes passed over"] > 100) == watches
    assert watches or soak.counts["read again"] == 0
    assert kind != "objects" or (soak.counts["read again"] > 5) == watches
    assert (soak.counts["instances read from geometry"] > 100) == (kind != "objects")
    assert kind != "mixed" or soak.counts["objects looked up in the list"] > 0
    assert soak.counts["strands"] > 10
    assert soak.counts[HALVES + "an image"] > 20
