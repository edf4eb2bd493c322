"""A `SceneSync` that goes from key moment to key moment, and has what moves between two of them move.

Each key moment is evaluated once and read once: what was read where a stretch ends is where the next one begins, unless
Blender has changed anything in between. So where nothing moves, a scan reads no more than a moment a stretch, and what
Blender has not evaluated again is not read again.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from ..events.changes import listen, stop_listening, watch_again
from ..live.scene_sync import SceneSync, UpdateCommit
from ..sync.moments import MomentRecord, MotionSettings
from ..sync.motion import add_motion
from ..sync.records import AttributeRequest, SceneRecord
from ..sync.scene_difference import AppliedDifference, SceneDifference
from ..sync.stretch_words import StretchWords
from .mount import Mount
from .scene_bend import SceneBend

_BEGIN, _END = Fraction(0), Fraction(1)


class StretchSync(SceneSync):
    """For scans: it watches nothing, so that its snapshots do not go stale by what the user does meanwhile.

    hidden: what no ray meets, of all that is read from then on.
    """

    hidden: Mount | None = None

    def __init__(self, attributes: AttributeRequest) -> None:
        super().__init__(attributes, watch=False)
        self._ahead: SceneRecord | None = None  # what was read at the last stretch's end, if it is so still
        self._bend = SceneBend()
        listen(self)  # of what is heard the next reading knows which meshes it may keep

    @property
    def scene_error(self) -> float:
        """See `PointCloud.scene_error`; of the stretches so far."""
        return self._bend.largest

    def begin_moment(self, depsgraph: Any, expected_rays: int) -> UpdateCommit:
        """The scene as it is, for a sensor that is no camera."""
        return self.begin_update(depsgraph, expected_rays, camera=_no_camera)

    def begin_stretch(self, depsgraph: Any, expected_rays: int, go_on: Callable[[], Any]) -> UpdateCommit:
        """The scene from here, time 0 of the rays, to the next key moment, time 1; the rest is as for `begin_update`.

        depsgraph: evaluated where the stretch begins. go_on: has Blender evaluate where it ends, and returns what is to
        be read there. Blender is left there. Everything is followed: Cycles' switches of motion blur are for its
        pictures. What cannot be is still in `warnings`.
        """
        return self._begin(lambda: self._read_stretch(depsgraph, go_on), expected_rays)

    def _read_stretch(self, depsgraph: Any, go_on: Callable[[], Any]) -> SceneRecord:
        watch_again()  # if handlers were missing, nobody has told of changes
        record = self._read_here(depsgraph) if self._ahead is None else self._ahead
        ahead = self._read_here(go_on())
        self._ahead = ahead
        count = len(record.objects)
        settings = MotionSettings(steps=np.full(count, 2, np.int32), deforms=np.ones(count, np.bool_))
        return add_motion(record, {_BEGIN: _moment(record), _END: _moment(ahead)}, settings, StretchWords)

    def _read_record(self, depsgraph: Any, view: dict[str, Any], **how: Any) -> SceneRecord:
        record = super()._read_record(depsgraph, view, **how)
        return record if self.hidden is None else self.hidden.hide(record)

    def _read_here(self, depsgraph: Any) -> SceneRecord:
        return self._read_record(depsgraph, {"camera": _no_camera}, cache=self._cache)

    def _apply(self, difference: SceneDifference) -> AppliedDifference:
        self._bend.add(difference.last, difference.record, difference.instances.held_rows)
        return super()._apply(difference)

    def close(self) -> None:
        """Forgets the scene, and listens no more."""
        stop_listening(self)
        self._ahead = None
        super().close()

    # Whatever has changed, by whomever, what was read ahead is not where the next stretch begins.

    def on_change(self, what: str) -> None:
        """The stretch under way goes on: it is about what was read."""
        self._ahead = None

    def on_file_change(self) -> None:
        """The next stretch finds no scene, and says so."""
        self._ahead = None


def _moment(record: SceneRecord) -> MomentRecord:
    return MomentRecord(record.meshes, record.objects, record.instances)


def _no_camera(_: Any) -> None:
    """Whether the scene has a camera is nothing to such a sensor."""
