"""Trees that several views share: a view waits for them for a moment; then they are built while Blender continues.

The Rendered viewports of a scene, its overlay and views that are rendered to an image use the same trees. Any of
them may read Blender again, which stops the build that another has begun, and Esc cancels a build that others wait
for. Therefore all wait for the build that began last, and the next view that needs trees restarts a cancelled build.
All of this is on Blender's main thread.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..sync.report import SyncReport
    from .scene_sync import SceneSync, UpdateCommit


# Views wait for trees that take no longer: their image appears in the redraw in which the scene was edited. Other trees
# are built while Blender continues, and every redraw waits this long for them.
BUILDING_SECONDS = 0.25
LOOKING_SECONDS = 0.03


class PendingCommit:
    """sync: whose trees they are; None as long as nothing was read, and after a failure."""

    def __init__(self) -> None:
        self.sync: SceneSync | None = None
        self._building: UpdateCommit | None = None

    def begin(
        self, sync: SceneSync, begin_update: Callable[[], UpdateCommit], *, to_the_end: bool = False
    ) -> SyncReport | None:
        """Reads a scene and builds its trees; returns the report if they are ready at once, else None.

        to_the_end: wait for any length of time. Raises the engine's errors.
        """
        self.sync = self._building = None  # a failed update must not leave the previous state
        building = begin_update()
        report = building.result() if to_the_end or building.wait(BUILDING_SECONDS) else None
        self.sync, self._building = sync, building if report is None else None
        return report

    def are_there(self, restart: Callable[[], object]) -> bool:
        """Whether there are trees of the data that was read last; if not, they are being built.

        restart: calls `begin`. Raises the engine's errors.
        """
        import perfect_bvh

        assert self.sync is not None
        building, self._building = self._building or self.sync.building, None
        if building is not None:
            if not building.wait(LOOKING_SECONDS):
                self._building = building
                return False
            try:
                building.result()
            except perfect_bvh.Cancelled:
                self._building = self.sync.building
            except BaseException:
                self.sync = None  # as after an update that fails at once
                raise
        if self._building is None and not self.sync.scene.is_current:
            restart()
        return self._building is None

    @property
    def is_building(self) -> bool:
        """Whether they were not there when they were looked for last."""
        return self._building is not None

    @property
    def is_over(self) -> bool:
        """Whether trees that were not ready then have become ready since."""
        return self._building is not None and not self._building.is_running

    @property
    def state(self) -> str | None:
        """How far they are, as words for the user; None if nothing is being built."""
        return None if self._building is None else f"Building BVHs {self._building.share:.0%}"
