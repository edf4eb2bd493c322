"""Trees that several views share, as one of them sees them: waited for a moment, then built while Blender goes on.

The Rendered viewports of a scene, its overlay and views that are rendered to an image look at the same trees. Any of
them may read Blender again, which stops what another has begun, and Esc gives up what others wait for. So all wait for
whatever was begun last, and what one view has given up is begun again by the next that needs it. All of this is on
Blender's main thread.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..sync.report import SyncReport
    from .scene_sync import SceneSync, UpdateCommit


# Trees that take no longer are waited for: their image comes in the redraw in which the scene was edited. Others are
# built while Blender goes on, and every redraw looks for so long whether they are there.
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
        """Has a scene read, and its trees built; the report if they are there at once, None if they are not yet.

        to_the_end: wait however long it takes. Raises what the engine raises.
        """
        self.sync = self._building = None  # a failed update must not leave what was there before
        building = begin_update()
        report = building.result() if to_the_end or building.wait(BUILDING_SECONDS) else None
        self.sync, self._building = sync, building if report is None else None
        return report

    def are_there(self, restart: Callable[[], object]) -> bool:
        """Whether there are trees of what was read last; if not, they are being built.

        restart: calls `begin`. Raises what the engine raises.
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
        """Whether what was not there then has come since."""
        return self._building is not None and not self._building.is_running

    @property
    def state(self) -> str | None:
        """How far they are, as words for the user; None if nothing is being built."""
        return None if self._building is None else f"Building BVHs {self._building.share:.0%}"
