"""Edits that a copy of the scene does not hear of: answers about something that is no longer there."""

from __future__ import annotations

import numpy as np

from .case import Body, FailureCase, State, body, rays_around
from .shapes import ball, gravel, moved, turned


def deleted_objects() -> tuple[State, ...]:
    """Balls in a row; some are deleted, then others hidden, renamed and duplicated, then all come back."""
    names = [f"Ball {k}" for k in range(12)]
    balls = [body(name, ball(1), [moved((2.2 * k, 0.0, 0.0))]) for k, name in enumerate(names)]
    fewer = tuple(part for k, part in enumerate(balls) if k % 3)
    again = [
        Body(f"Copy of {part.name}", part.positions, part.triangles, moved((0, 2, 0)) @ part.transforms)
        for part in fewer[:3]
    ]
    renamed = (*fewer[3:], *again)
    return tuple(balls), fewer, renamed, tuple(balls)


def stopped_halfway() -> tuple[State, ...]:
    """Six balls; then six heaps of gravel in their places."""
    heaps = [
        (body(f"Heap {k}", shape, [moved((2.5 * k, 0.0, 0.0))]) for k, shape in enumerate(shapes))
        for shapes in (
            [ball(4)] * 6,
            [gravel(2000, 40 + k, 0.05) for k in range(6)],
        )
    ]
    return tuple(tuple(parts) for parts in heaps)


def edited_while_traced() -> tuple[State, ...]:
    """A crowd of balls that are elsewhere after every edit."""
    random = np.random.default_rng(20)
    states = []
    for _ in range(4):
        places = [moved(random.uniform(-4.0, 4.0, 3)) @ turned(0, turn) for turn in random.uniform(0, 6, 30)]
        states.append((body("Ball", ball(2), places),))
    return tuple(states)


def one_frame_late() -> tuple[State, ...]:
    """A ball that rolls by its own radius on every frame."""
    return tuple((body("Ball", ball(3), [moved((frame, 0.0, 0.0)) @ turned(1, frame)]),) for frame in range(5))


DELETED_OBJECTS = FailureCase(
    "deleted_objects",
    "Deleted, hidden, renamed, duplicated objects",
    "The list of updates never names what was deleted or hidden: its rays still hit.",
    "IfcOpenShell 9003, Blender add-ons",
    "Every sync compares the whole list of instances by keys that are not names; what is missing is removed.",
    deleted_objects,
    rays_around,
)
EDITED_WHILE_TRACED = FailureCase(
    "edited_while_traced",
    "An edit in the middle of a batch",
    "A tree that is edited in place: one batch is answered from two scenes, or crashes.",
    "RPR 276, evertims 3",
    "Immutable snapshots: a batch, a render and a thread keep theirs, whatever is committed meanwhile.",
    edited_while_traced,
    rays_around,
)
STOPPED_HALFWAY = FailureCase(
    "stopped_halfway",
    "A build that is stopped half-way",
    "Trees are exchanged one by one: after Esc some are of the new scene, some of the old, and nothing says so.",
    "RPR 276",
    "A commit replaces everything at its end or nothing: snapshots stay, and queries refuse until one has succeeded.",
    stopped_halfway,
    rays_around,
    grid=2.0**-10,
)
ONE_FRAME_LATE = FailureCase(
    "one_frame_late",
    "Trees of the frame before",
    "The frame is set and the trees are built from what was evaluated before it.",
    "a range scanner's source",
    "After any change in Blender queries raise `StaleSceneError` until `update()` has read the evaluated frame.",
    one_frame_late,
    rays_around,
)
CASES = (DELETED_OBJECTS, STOPPED_HALFWAY, EDITED_WHILE_TRACED, ONE_FRAME_LATE)
