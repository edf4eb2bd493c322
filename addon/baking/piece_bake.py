"""Bakes of frames into a folder of tables, chunk by chunk, for the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy

from ..live.scene_view import SceneView
from ..pieces.piece import Piece, PieceFolder, runs_of
from ..pieces.work import Done, PieceWork, Steps
from .bake import Baker
from .settings import NAME, BakeSettings

BEFORE = "bake_"  # of the names of all files


class BakeWork(PieceWork):
    """A table for each frame; for exposure one for all of them together, since it counts frames.

    Args:
        view: The scene.
        settings: For elements as modifiers make them; its frames are not used.
        frames: In any order.
        names: Of the objects; empty for all meshes that the scene shows.
        place: Where tables go. suffix: ".csv" or ".parquet".
        size: The largest number of frames of a chunk. warnings: Of the settings, told with those of each chunk.
    """

    def __init__(
        self,
        view: SceneView,
        settings: BakeSettings,
        frames: tuple[int, ...],
        names: Sequence[str],
        place: PieceFolder,
        suffix: str,
        *,
        size: int = 10,
        threads: int = 0,
        warnings: Sequence[str] = (),
    ) -> None:
        super().__init__(view, frames)
        self._settings, self._names, self._threads, self._warnings = settings, names, threads, warnings
        self._write = "write_csv" if suffix == ".csv" else "write_parquet"
        self.place, together = place, settings.kind == "EXPOSURE"
        self.pieces = []
        for run in runs_of(frames, len(frames) if together else size, has_gaps=True):
            stem = f"{BEFORE}{run[0]:04d}-{run[-1]:04d}"
            parts = [run] if together else [(frame,) for frame in run]
            files = tuple(f"{stem if together else f'{BEFORE}{part[0]:04d}'}{suffix}" for part in parts)
            self.pieces.append(Piece(run, stem, files))

    def make(self, piece: Piece) -> Steps:
        """Bakes each frame with a separate engine scene. Raises ValueError for an object, and OSError for a file."""
        warnings, rays = dict.fromkeys(self._warnings), 0
        for number, name in enumerate(piece.files):
            frames = piece.frames if len(piece.files) < len(piece.frames) else (piece.frames[number],)
            with bpy.context.temp_override(scene=self.view.find(), view_layer=self.view.find_layer()):
                how = {"threads": self._threads, "for_viewport": self.view.for_viewport}
                settings = replace(self._settings, frames=frames)
                baker = Baker(self._objects(), settings, skip_missing=not self._names, **how)
            for done in baker.steps():
                yield (number + done) / len(piece.files)
            bake = baker.result()
            getattr(bake, self._write)(self.place.path_of(name))
            warnings |= dict.fromkeys(bake.warnings)
            rays += bake.ray_count
        self.place.finish(piece, rays=rays, units=self._settings.units, warnings=list(warnings))
        yield Done({"frames": len(piece.frames), "rays": rays}, tuple(warnings))

    def _objects(self) -> list[bpy.types.Object]:
        objects = self.view.find().objects
        gone = [name for name in self._names if name not in objects]
        if gone:
            raise ValueError(f"{NAME}: scene {self.view.find().name!r} has no object {gone[0]!r}")
        return [objects[name] for name in self._names] or [obj for obj in objects if obj.type == "MESH"]
