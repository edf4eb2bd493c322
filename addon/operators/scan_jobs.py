"""The work of the Scan button, in steps: points of all frames at once, or pieces of the frames into files."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ..settings.scan_settings import label_names
from ..statistics.words import duration
from ..support.files import prepare_folder
from .scan_request import (
    check_colors,
    exclude_mount_of,
    folder_of,
    frames_of,
    plan_of,
    sensor_of,
    threads_of,
)
from .scanned_file import ScannedFile

if TYPE_CHECKING:
    from ..pieces.piece import Piece
    from ..scanning import PointCloud
    from ..scanning.outcomes import RayCounts


_folders_in_use: set[Path] = set()


class PointsJob:
    """All points, as one object. Raises ValueError for what cannot be scanned."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        from ..scanning import Scanner

        settings = scene.perfect_bvh.scan
        check_colors(settings)
        self._scanner: Any = Scanner(
            sensor_of(settings),
            settings.sensor,
            frames=frames_of(scene),
            steps_per_frame=settings.steps_per_frame,
            threads=threads_of(scene),
            labels=label_names(settings),
            seed=settings.seed,
            exclude_mount=exclude_mount_of(scene),
            for_viewport=settings.use_viewport,
        )
        self.where = ""
        """What is worked on, for the status bar."""

    @property
    def built_share(self) -> float | None:
        return self._scanner.built_share

    def steps(self) -> Generator[float, None, None]:
        """Yields the share done, 0 to 1."""
        yield from self._scanner.steps()

    def release(self) -> None:
        """At the end, however it came."""

    def stopped(self) -> str:
        """What to tell who has stopped it."""
        return "The scan was stopped: nothing was made"

    def result(self) -> tuple[list[tuple[str, PointCloud]], list[str]]:
        """Points to be added, with the names of their objects, and warnings."""
        cloud = self._scanner.result()
        if not len(cloud):
            return [], [*cloud.warnings, "No points were made"]
        return [("Scan", cloud)], list(cloud.warnings)

    def ray_outcomes(self) -> RayCounts:
        """What became of the rays."""
        return self._scanner.result().ray_outcomes

    def summary(self, names: list[str], seconds: float) -> str:
        """What was made, in a sentence. names: of the objects that were."""
        cloud = self._scanner.result()
        found = f"{len(cloud):,} points on {len(cloud.object_names):,} objects, {cloud.ray_count:,} rays"
        return f"{names[0]}: {found}, {duration(1e3 * seconds)}"


class FilesJob:
    """Pieces of the frames, as files, and as objects as well if that is asked for: one a piece.

    Raises ValueError for what cannot be scanned and for a folder of another scan, OSError for one that takes no files.
    """

    def __init__(self, scene: bpy.types.Scene, file: ScannedFile) -> None:
        from ..pieces.work import Outcome
        from ..scanning.piece_scan import ScanWork

        settings = scene.perfect_bvh.scan
        if settings.use_points:
            check_colors(settings)
        plan, carrier = plan_of(scene), settings.sensor
        plan.scanner(plan.pieces()[0], carrier)  # what cannot be scanned is refused before a folder is made
        self._folder: Path = folder_of(settings).resolve()
        if self._folder in _folders_in_use:
            raise ValueError(f"Another scan is writing into {self._folder}: let it end, or stop it with Esc")
        prepare_folder(self._folder)
        self._file = file
        self._keeps = settings.use_points
        self._clouds: list[tuple[str, PointCloud]] = []
        place = plan.folder(self._folder, file.inputs_of(plan, carrier))
        place.prepare(plan.pieces(), resume=settings.use_resume)
        self._work = ScanWork(plan, carrier, place, self._take)
        self._outcome = Outcome()
        self._resumes = settings.use_resume
        _folders_in_use.add(self._folder)

    @property
    def built_share(self) -> float | None:
        return self._work.built_share

    @property
    def where(self) -> str:
        """What is worked on, for the status bar."""
        return f", piece {self._outcome.number} of {len(self._work.pieces)}"

    def steps(self) -> Generator[float, None, None]:
        """Yields the share done, 0 to 1."""
        from ..pieces.work import do_pieces

        scene = self._work.view.find()
        frame = scene.frame_current, scene.frame_subframe, scene.camera.session_uid if scene.camera else 0
        try:
            with closing(do_pieces(self._work, self._outcome)) as steps:
                for done in steps:
                    yield done / len(self._work.pieces)
        finally:
            self._work.view.set_frame_back(*frame)

    def release(self) -> None:
        """At the end, however it came: other scans may write there."""
        _folders_in_use.discard(self._folder)

    def stopped(self) -> str:
        """What to tell who has stopped it."""
        how = "Start Scan goes on" if self._resumes else "Start Scan goes on if Resume is chosen"
        done = self._outcome.there
        count = f"{done} of {len(self._work.pieces)} pieces {'is' if done == 1 else 'are'} whole"
        return f"The scan was stopped: {count} in {self._folder}; {how}"

    def result(self) -> tuple[list[tuple[str, PointCloud]], list[str]]:
        """Points to be added, with the names of their objects, and warnings."""
        warnings, kept = list(self._outcome.warnings), self._outcome.kept
        if self._keeps and kept:
            warnings.append(f"The points of {kept} pieces that were there are not added; without Resume all are")
        return [(name, cloud) for name, cloud in self._clouds if len(cloud)], warnings

    def ray_outcomes(self) -> RayCounts:
        """What became of the rays of the pieces that were scanned."""
        from ..scanning.piece_scan import ray_counts

        return ray_counts(self._outcome)

    def summary(self, names: list[str], seconds: float) -> str:
        """What was made, in a sentence. names: of the objects that were."""
        added = f", {len(names)} objects" if self._keeps else ""
        count = self._outcome.words(len(self._work.pieces), "pieces written")
        points = self._work.summary(self._outcome)[0]
        return f"{self._folder}: {count}; {points}{added}, {duration(1e3 * seconds)}"

    def _take(self, piece: Piece, cloud: PointCloud) -> None:
        self._file.check_unedited(piece.first)
        if self._keeps:
            self._clouds.append((f"Scan {piece.first}-{piece.last}", cloud))
