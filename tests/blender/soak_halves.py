"""Updates in two halves amid random edits. Builds are held, stopped, joined, failing, or over before anybody looks.

Two users share one sync, as a viewport and the overlay do. Anything may happen between reading a scene and building its
trees. Each user gets the answers of a scene that was never anything else, or none.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import perfect_bvh
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.live import pending_commit
from perfect_bvh_addon.live.pending_commit import PendingCommit

if TYPE_CHECKING:
    from blender.soak import Soak

MOST_SECONDS = 30.0
HALVES = "halves: "  # prefix of the names of its counts
HOLDS = ("before", "before", "after", "failing", "")
LONG_ENOUGH = 0.003  # most such builds end within this time


class WorkerError(MemoryError):
    """The error of a build that fails on purpose."""


class _HeldScene(perfect_bvh.Scene):
    """A scene whose commits wait on request: before their work, or after it, when stopping has no effect any more."""

    __slots__ = ("gate",)

    def commit(self, expected_rays: int | None = None, *, progress: Any = None) -> perfect_bvh.CommitReport:
        hold = self.gate.hold if progress is not None else ""
        if hold == "failing":
            raise WorkerError("no memory for this build")
        if hold == "before":
            self.gate.wait(progress)
            if progress(0.5) is False:
                raise perfect_bvh.Cancelled("the commit was cancelled")
        report = super().commit(expected_rays, progress=progress)
        if hold == "after":
            self.gate.wait(progress)
        return report


class _Gate:
    """hold: the fate of builds that begin now; one of `HOLDS`."""

    def __init__(self) -> None:
        self.hold = ""
        self._is_open = threading.Event()

    def close(self, hold: str) -> None:
        self.hold = hold
        self._is_open.clear()

    def open(self) -> None:
        self.hold = ""
        self._is_open.set()

    def wait(self, progress: Callable[[float], object]) -> None:
        """Wait until the gate is opened, or the waiting side no longer wants the build."""
        while not self._is_open.wait(0.0005):
            if progress(0.5) is False:
                return

    def make_scene(self) -> _HeldScene:
        made = _HeldScene()
        made.gate = self
        return made


class _User:
    """A user that draws the trees' content. After each edit it reads the scene again before the next image."""

    def __init__(self) -> None:
        self.trees = PendingCommit()
        self.is_stale = True
        self.shown: tuple[int, bytes] | None = None  # the revision of the last image, and the image


class Halves:
    """Plays with the updates of one sync alongside a `Soak`, with separate random numbers.

    share: of the edits and steps that it plays at.
    """

    def __init__(self, soak: Soak, attributes: Any, share: float) -> None:
        self._soak, self._share = soak, share
        self._random = np.random.default_rng((soak.seed, 1))
        self._gate = _Gate()
        self.sync = SceneSync(attributes, watch=False)
        self.sync._make_scene = self._gate.make_scene
        self.sync.close()  # creates its scene again
        self._users = (_User(), _User())
        rare = (self._stop, self._ask_to_stop, self._update, self._linger)
        self._actions = (*(self._hold, self._look, self._look_all) * 2, *rare)

    def close(self) -> None:
        self._gate.open()
        self.sync.close()

    def meddle(self) -> None:
        """Play some of the events that users and trees may cause between two edits."""
        if self._random.random() >= self._share:
            return
        for _ in range(self._random.integers(0, 5)):
            action = self._actions[self._random.integers(len(self._actions))]
            self._soak.counts[f"{HALVES}{action.__name__[1:]}"] += 1
            action()

    def note_edit(self) -> None:
        for user in self._users:
            user.is_stale = True

    def prove(self) -> None:
        """In most calls, release all builds and check that each user gets the right answers after a few looks."""
        if self._random.random() >= 0.7 * self._share:
            return
        if self._random.random() < 0.5:
            self._linger()  # the held builds meet the edits
        self._gate.open()
        for user in self._users:
            for _ in range(4):
                if self._look_as(user, patience=MOST_SECONDS):
                    break
            else:
                self._soak._raise_if([HALVES + "a user waits for ever"])

    # Possible events -------------------------------------------------------------------------------------------------

    def _hold(self) -> None:
        self._gate.open()
        hold = HOLDS[self._random.integers(len(HOLDS))]
        if hold:
            self._gate.close(hold)

    def _look(self) -> None:
        self._look_as(self._users[self._random.integers(2)], patience=0.0)

    def _look_all(self) -> None:
        for user in self._users:
            self._look_as(user, patience=0.0)

    def _stop(self) -> None:
        self.sync.stop_building()

    def _ask_to_stop(self) -> None:
        self.sync.ask_to_stop_building()

    def _update(self) -> None:
        """Update in one go, from a caller that stops all others."""
        self.note_edit()
        self.sync.update(bpy.context.evaluated_depsgraph_get())
        self._check("an update in one go")

    def _linger(self) -> None:
        building = self.sync._building
        if building is not None:
            building.wait(LONG_ENOUGH)

    def _look_as(self, user: _User, patience: float) -> bool:
        """Return whether there was an image. patience: the seconds to wait for it."""
        kept = pending_commit.BUILDING_SECONDS, pending_commit.LOOKING_SECONDS
        pending_commit.BUILDING_SECONDS = pending_commit.LOOKING_SECONDS = patience
        try:
            if user.is_stale or user.trees.sync is None:
                user.is_stale = False
                self._begin(user)
            is_there = user.trees.are_there(lambda: self._begin(user))
        except (WorkerError, perfect_bvh.Cancelled) as problem:
            self._soak.counts[f"{HALVES}{type(problem).__name__}"] += 1
            return False
        finally:
            pending_commit.BUILDING_SECONDS, pending_commit.LOOKING_SECONDS = kept
        if is_there:
            self._check("an image", user)
        else:
            self._soak.counts[HALVES + "not yet"] += 1
        return is_there

    def _begin(self, user: _User) -> None:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        before = self.sync._building
        user.trees.begin(self.sync, lambda: self.sync.begin_update(depsgraph))
        self._soak.counts[HALVES + "joined"] += before is not None and self.sync._building is before

    # Proof -----------------------------------------------------------------------------------------------------------

    def _check(self, what: str, user: _User | None = None) -> None:
        """Check that the current answers are those of the current scene."""
        found = self._soak.find_differences(self.sync, bpy.context.evaluated_depsgraph_get())
        if user is not None:
            image = self.sync.scene.cast_rays(*self._soak.rays).t_hit.tobytes()
            if user.shown is not None and user.shown[0] == self.sync.revision and user.shown[1] != image:
                found.append("another image, but the same revision")
            user.shown = self.sync.revision, image
        self._soak.counts[f"{HALVES}{what}"] += 1
        self._soak._raise_if([f"{HALVES}{what}: {one}" for one in found])
