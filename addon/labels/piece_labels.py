"""Labels of frames into a folder, chunk by chunk: the plan and the work, for the command line and the button."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..live.scene_sync import SceneSync
from ..live.scene_view import SceneView
from ..pieces.piece import Piece, PieceFolder, runs_of
from ..pieces.work import Done, PieceWork, Steps
from . import bop
from .coco import image_row, join_rows, read_rows, write_rows
from .files import DEPTH_SCALE, file_names, save_labels
from .label_image import label_steps
from .labels import Labels

if TYPE_CHECKING:
    import bpy

    from ..live.scene_view import SceneMoment

BEFORE = "labels_"  # of the names of all files but the joined one
WHAT = "set of labels"


@dataclass(frozen=True, slots=True)
class LabelPlan:
    """The settings that all chunks share.

    Attributes:
        frames: In any order.
        size: (width, height) in pixels; None for the render size.
        piece: The largest number of frames of a chunk.
        formats, depth_scale: See `save_labels`.
        has_coco, has_bop: Whether there is a file of COCO's format, and a folder of BOP's. The others: see
            `label_image`.
    """

    frames: tuple[int, ...]
    formats: tuple[str, ...]
    size: tuple[int, int] | None = None
    layers: int = 1
    category: str | None = None
    labels: tuple[str, ...] = ()
    flow: bool = False
    depth_scale: float = DEPTH_SCALE
    has_coco: bool = True
    has_bop: bool = False
    piece: int = 10
    threads: int = 0

    def pieces(self) -> list[Piece]:
        """Returns the chunks in the order of their frames."""
        found = []
        for frames in runs_of(self.frames, self.piece, has_gaps=True):
            stem = f"{BEFORE}{frames[0]:04d}-{frames[-1]:04d}"
            what = {"labels": self.labels, "layers": self.layers, "flow": self.flow}
            files = [name for frame in frames for name in file_names(stem_of(frame), self.formats, **what)]
            files += [f"{stem}.coco.jsonl"] if self.has_coco else []
            if self.has_bop:
                files += [bop.image_name(folder, frame) for folder in ("rgb", "depth") for frame in frames]
                files += [f"{stem}.bop.jsonl", f"{stem}.bop_models.npz"]
            found.append(Piece(frames, stem, tuple(files)))
        return found

    @property
    def joined(self) -> tuple[str, ...]:
        """Names of files that are made of all chunks in the end."""
        coco = (f"coco_{min(self.frames):04d}-{max(self.frames):04d}.json",) if self.has_coco else ()
        return (*coco, *(bop.JOINED if self.has_bop else ()))


class LabelWork(PieceWork):
    """The chunks of a plan.

    Args:
        view: The scene.
        camera: An object by its name; "" for the camera of each frame.
        place: The folder of the chunks.
        on_labels: Called with each frame and its labels before they are written.
    """

    def __init__(
        self,
        view: SceneView,
        plan: LabelPlan,
        place: PieceFolder,
        camera: str = "",
        on_labels: Callable[[int, Labels], object] = lambda _frame, _labels: None,
    ) -> None:
        super().__init__(view, plan.frames)
        self.pieces, self.place, self.joined = plan.pieces(), place, plan.joined
        self._plan, self._camera, self._on_labels = plan, camera, on_labels

    def make(self, piece: Piece) -> Steps:
        """Labels a chunk with a separate engine scene: its content, even ids of instances, depends on no other chunk.

        Raises ValueError, the engine's errors, and OSError for a file.
        """
        sync, rows, warnings = SceneSync(watch=False), [], dict[str, None]()
        bop_rows, models = [], bop.Models()
        try:
            for number, frame in enumerate(piece.frames):
                with closing(self._label(frame, sync)) as steps:
                    labels = yield from _scaled(steps, number, len(piece.frames))
                self._on_labels(frame, labels)
                how = {"frame": frame, "depth_scale": self._plan.depth_scale}
                lacking = save_labels(labels, self.place.folder, stem_of(frame), self._plan.formats, **how).warnings
                if self._plan.has_bop:
                    of_things = sync.instance_rows(np.array([thing.instance_id for thing in labels.things], np.int32))
                    row, depth, left_out = bop.image_row(labels, sync.record, of_things, **how, models=models)
                    bop.save_depth(self.place.path_of(bop.image_name("depth", frame)), depth)
                    bop_rows.append(row)
                    lacking = (*lacking, *left_out, *self.picture(frame))
                if self._plan.has_coco:
                    rows.append(image_row(labels, f"frame_{frame:04d}.png"))
                warnings |= dict.fromkeys((*labels.warnings, *lacking))
        except ValueError as error:
            raise ValueError(f"frame {frame}: {error}") from error
        finally:
            sync.close()
        if self._plan.has_coco:
            write_rows(rows, self.place.path_of(f"{piece.stem}.coco.jsonl"))
        if self._plan.has_bop:
            write_rows(bop_rows, self.place.path_of(f"{piece.stem}.bop.jsonl"))
            models.save(self.place.path_of(f"{piece.stem}.bop_models.npz"))
        self.place.finish(piece, warnings=list(warnings))
        yield Done({"frames": len(piece.frames)}, tuple(warnings))

    def picture(self, frame: int) -> tuple[str, ...]:
        """Writes BOP's image of a frame; returns what it lacks, as sentences. Only `BopWork` can render."""
        raise NotImplementedError

    def join(self) -> None:
        """Writes the file of COCO's format, of these chunks, and the data of BOP's, of all chunks in the folder.

        BOP's files have the same names for any frames, so those of earlier runs are joined again. Raises OSError.
        """
        if self._plan.has_coco:
            rows = [self.place.path_of(f"{piece.stem}.coco.jsonl") for piece in self.pieces]
            join_rows(lambda: read_rows(rows), self.place.path_of(self.joined[0]))
        if self._plan.has_bop:
            names = [name for found in self.place.manifests() for name in found["files"]]
            files = [self.place.path_of(name) for name in names if name.endswith(".bop.jsonl")]
            models = [self.place.path_of(name) for name in names if name.endswith(".bop_models.npz")]
            bop.join_rows(lambda: read_rows(files), models, self.place.folder)

    def _label(self, frame: int, sync: SceneSync) -> Generator[float, None, Labels]:
        """Labels one frame, as it would be rendered."""
        plan = self._plan

        def begin(moment: SceneMoment) -> Generator[float, None, Labels]:
            camera = self._find_camera(moment.scene)
            if camera is None and moment.camera is None:
                raise ValueError(f"scene {self.view.find().name!r} has no camera")
            steps = label_steps(
                moment.depsgraph,
                sync,
                camera=camera,
                size=plan.size,
                layers=plan.layers,
                category=plan.category,
                labels=plan.labels,
                flow=plan.flow,
                frame_set=moment.frame_set,
                threads=plan.threads,
            )
            next(steps)  # which reads Blender, as long as its moment lasts
            return steps

        return (yield from self.view.read(begin, frame))

    def _find_camera(self, scene: bpy.types.Scene) -> bpy.types.Object | None:
        if not self._camera:
            return None
        camera = scene.objects.get(self._camera)
        if camera is None:
            raise ValueError(f"the camera {self._camera!r} is no longer in the scene")
        return camera


def stem_of(frame: int) -> str:
    """Returns the stem of the files of one frame."""
    return f"{BEFORE}{frame:04d}"


def _scaled(steps: Generator[float, None, Labels], number: int, count: int) -> Generator[float, None, Labels]:
    """The steps of a frame as shares of a chunk of `count` frames, of which `number` are done."""
    while True:
        try:
            share = next(steps)
        except StopIteration as end:
            labels: Labels = end.value
            return labels
        yield (number + share) / count
