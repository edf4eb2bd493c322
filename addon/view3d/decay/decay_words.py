"""What is written in a chart of trees that decay. Knows no Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...statistics.words import count_of, number, sentence

if TYPE_CHECKING:
    from .decay import Decay, DecayFrame

LABELS = {"refit": "Refitted", "governed": "Governed", "rebuild": "Rebuilt"}
ACTIONS = {
    "rebuilt": "Rebuilt",
    "partly_rebuilt": "Parts rebuilt",
    "rotated": "Rotated",
    "refitted": "Refitted",
    "built": "Built",
}


def heading_of(decay: Decay, *, is_old: bool = False) -> str:
    """What is shown, how far it is, and whether the scene is another one by now."""
    done = f"{len(decay.rows):,} of " if len(decay.rows) < len(decay.frames) else ""
    since = " (the scene has changed since)" if is_old else ""
    return f"Decay of {decay.name}: {decay.measure}, {done}{count_of(len(decay.frames), 'frame')}{since}"


def key_of(decay: Decay, policy: str, row: int | None) -> str:
    """Of a curve; with its number in a row."""
    return LABELS[policy] if row is None else f"{LABELS[policy]} {number(decay.costs(policy)[row], 3)}"


def sentence_of(row: DecayFrame) -> str:
    """What the governor did in a frame, and why."""
    done = row.policies["governed"]
    if not done.action:
        return f"Frame {row.frame}: nothing moved, the tree is kept"
    return f"Frame {row.frame}: {ACTIONS[done.action]}. {sentence(done.reason)}"


def summary_of(decay: Decay) -> str:
    """All frames in two sentences."""
    counts = dict.fromkeys(ACTIONS, 0)
    for row in decay.rows[1:]:
        action = row.policies["governed"].action
        if action:
            counts[action] += 1
    told = [f"{ACTIONS[action].lower()} {count}" for action, count in counts.items() if count]
    done = ", ".join(told) if told else "nothing"
    costs = {policy: decay.costs(policy) for policy in LABELS}
    last = ", ".join(f"{LABELS[policy].lower()} {number(values[-1], 3)}" for policy, values in costs.items())
    return f"{decay.measure} in the end: {last}. What the governor did: {done}"
