"""Inputs that once did something new, played again, and as many never played before as a few seconds allow.

The new ones are the same in every run, as far as it gets; `nox -s fuzz` looks elsewhere each time.
"""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from stress.fuzz import CORPUS, TARGETS, mutated, read_corpus, run

SECONDS = float(os.environ.get("PERFECT_BVH_FUZZ_SECONDS", "2"))  # for the new ones of each target
SHOWN = {  # the reasons for which a target's corpus was kept, by the first word of its features
    "edits": {"built", "refitted", "rebuilt", "refused", "top", "hit", "line"},
    "hard_mesh": {"built", "met", "hit", "invalid", "line"},
    "rays": {"refused", "cast", "line"},
    "closest_points": {"refused", "found", "line"},
    "meshes_and_instances": {"refused", "filled", "line"},
    "curves_and_points": {"refused", "taken", "held", "line"},
}

every_target = pytest.mark.parametrize("target", TARGETS)


@every_target
def test_kept_inputs_still_do_what_they_were_kept_for(target: str) -> None:
    features = set().union(*(run(target, data) for data in read_corpus(target)))
    assert {feature[0] for feature in features} >= SHOWN[target]


@every_target
def test_new_inputs(target: str) -> None:
    corpus, random = read_corpus(target), np.random.default_rng(0)
    until = time.monotonic() + SECONDS
    while time.monotonic() < until:
        run(target, mutated(corpus, random))


def test_every_target_keeps_a_corpus() -> None:
    assert {path.stem for path in CORPUS.glob("*.txt")} == TARGETS.keys() == SHOWN.keys()
