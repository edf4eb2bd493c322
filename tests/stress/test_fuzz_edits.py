"""Series of edits that once did something new, played again, and a few never played before."""

from __future__ import annotations

import numpy as np
import pytest

from stress.edits import Play
from stress.fuzz import mutated, read_corpus

NEW_SERIES = 40


def play(data: bytes) -> set[tuple[str, ...]]:
    try:
        return Play(data).run()
    except Exception as failure:
        raise AssertionError(f"python tests/stress/fuzz.py --replay {data.hex()}") from failure


def test_kept_series_still_do_what_they_were_kept_for() -> None:
    features = set().union(*map(play, read_corpus()))
    assert {"built", "refitted", "rebuilt", "refused", "top", "hit"} <= {feature[0] for feature in features}


@pytest.mark.parametrize("seed", range(4))
def test_new_series(seed: int) -> None:
    corpus, random = read_corpus(), np.random.default_rng(seed)
    for _ in range(NEW_SERIES // 4):
        play(mutated(corpus, random))
