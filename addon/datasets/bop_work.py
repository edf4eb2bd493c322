"""The chunks of labels as a data set of BOP's format, with the camera's image of each frame."""

from __future__ import annotations

from ..labels.bop import image_name
from ..labels.piece_labels import LabelWork
from ..live.scene_sync import SceneSync
from ..pieces.piece import Piece
from ..pieces.work import Steps
from ..support.files import make_folder
from .shots import shoot


class BopWork(LabelWork):
    """Labels of a plan with `has_bop`; the arguments are those of `LabelWork`, for the camera of each frame."""

    def make(self, piece: Piece) -> Steps:
        """Labels and renders a chunk with separate engine scenes: its content depends on no other chunk."""
        self._image_sync = SceneSync(watch=False)
        try:
            yield from super().make(piece)
        finally:
            self._image_sync.close()

    def picture(self, frame: int) -> tuple[str, ...]:
        """Writes BOP's image of a frame as `perfect-bvh render` makes it. Raises ValueError, OSError."""
        path = self.place.path_of(image_name("rgb", frame))
        make_folder(path.parent)
        return shoot(self.view, self._image_sync, frame, path)[1]
