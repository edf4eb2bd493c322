"""`perfect-bvh labels`: exact labels of frames of a file, each in files of its own, and one file for all masks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ..pieces.work import Done, PieceWork, Steps
from .arguments import CommandError, check_blend_file, check_pieces, explained, parse_folder
from .blender import StopRequest, active_view_layer, apply_settings, open_scene, stop_on_interrupt
from .frames import run_pieces
from .report import quiet_blender

if TYPE_CHECKING:
    import bpy

    from ..labels import Labels
    from ..live.scene_sync import SceneSync
    from ..live.scene_view import SceneMoment
    from ..pieces.piece import Piece

DEPTH_SCALE = 0.001  # world units, unless --depth-scale says otherwise
# What labels depend on, among the arguments.
CHOICES = ("size", "category", "labels", "layers", "flow", "viewport", "format", "depth_scale", "no_coco")
BEFORE = "labels_"  # of the names of all files but the joined one


def run_labels(arguments: argparse.Namespace) -> int:
    """Label what the arguments say; the exit status."""
    check_pieces(arguments)
    path = check_blend_file(arguments.file)
    _check_formats(arguments)
    folder = parse_folder(arguments.output)
    if not arguments.no_coco:
        _check_coco()
    arguments.file, arguments.output = str(path), str(folder)  # as workers, which are elsewhere, find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        return run_pieces(LabelsWork, open_scene(path, arguments), stop, arguments, out)


def _check_formats(arguments: argparse.Namespace) -> None:
    from ..labels.files import FORMATS, check_formats

    try:
        check_formats(arguments.format, arguments.labels)
        arguments.format = [name for name in FORMATS if name in arguments.format]  # however they were ordered
    except (ValueError, ImportError) as error:
        raise CommandError(f"--format: {error}") from error
    if arguments.depth_scale is not None and "png" not in arguments.format:
        raise CommandError("--depth-scale is of PNG files: add png to --format, or leave it out")
    if arguments.depth_scale is None:
        arguments.depth_scale = DEPTH_SCALE


def _check_coco() -> None:
    from ..labels.coco import check_coco

    try:
        check_coco()
    except ImportError as error:
        raise CommandError(f"{error}; or leave it out: --no-coco") from error


class LabelsWork(PieceWork):
    """Pieces of labelled frames: the files of each frame, and what the file of COCO's format needs of them."""

    def __init__(self, scene: bpy.types.Scene, stop: StopRequest, arguments: argparse.Namespace) -> None:
        from ..live.scene_view import SceneView
        from ..pieces.piece import Piece, PieceFolder, runs_of, scene_inputs

        view = SceneView("labels", scene, active_view_layer(scene), for_viewport=arguments.viewport)
        super().__init__(view, arguments.frames or (scene.frame_current,))
        self._stop, self._arguments = stop, arguments
        inputs = scene_inputs(arguments, *CHOICES, begins=self.begins)
        apply_settings(scene, arguments)
        self.pieces = []
        for frames in runs_of(self.frames, arguments.piece, has_gaps=True):
            stem = f"{BEFORE}{frames[0]:04d}-{frames[-1]:04d}"
            files = [name for frame in frames for name in self._files_of(frame)]
            rows = [] if arguments.no_coco else [f"{stem}.coco.jsonl"]
            self.pieces.append(Piece(frames, stem, (*files, *rows)))
        self.place = PieceFolder(Path(arguments.output), inputs, BEFORE, "set of labels")
        if not arguments.no_coco:
            self.joined = (f"coco_{min(self.frames):04d}-{max(self.frames):04d}.json",)

    def make(self, piece: Piece) -> Steps:
        """By a scene of the engine's own: what a piece holds, ids of instances included, depends on no piece before."""
        from ..labels.coco import image_row, write_rows
        from ..live.scene_sync import SceneSync

        sync, rows, warnings = SceneSync(watch=False), [], dict[str, None]()
        try:
            for number, frame in enumerate(piece.frames):
                labels = None if self._stop.is_set else self._label(frame, sync)
                if labels is None:
                    return
                lacking = self._save(labels, frame)
                if not self._arguments.no_coco:
                    rows.append(image_row(labels, f"frame_{frame:04d}.png"))
                warnings |= dict.fromkeys((*labels.warnings, *lacking))
                yield (number + 1) / len(piece.frames)
        finally:
            sync.close()
        with explained():
            if not self._arguments.no_coco:
                write_rows(rows, self.place.path_of(piece.files[-1]))
            self.place.finish(piece, warnings=list(warnings))
        yield Done({"frames": len(piece.frames)}, tuple(warnings))

    def join(self) -> None:
        """The file of COCO's format, of all pieces, in the order of their frames."""
        from ..labels.coco import join_rows, read_rows

        if self.joined:
            paths = [self.place.path_of(piece.files[-1]) for piece in self.pieces]
            with explained():
                join_rows(lambda: read_rows(paths), self.place.path_of(self.joined[0]))

    def _files_of(self, frame: int) -> list[str]:
        from ..labels.files import file_names

        arguments = self._arguments
        what = {"labels": arguments.labels, "layers": arguments.layers, "flow": arguments.flow}
        return file_names(_stem_of(frame), arguments.format, **what)

    def _save(self, labels: Labels, frame: int) -> tuple[str, ...]:
        """What the files lack of the labels, as sentences."""
        from ..labels import save_labels

        how = {"frame": frame, "depth_scale": self._arguments.depth_scale}
        try:
            with explained():
                return save_labels(labels, self.place.folder, _stem_of(frame), self._arguments.format, **how).warnings
        except ValueError as error:
            raise CommandError(f"frame {frame}: {error}") from error

    def _label(self, frame: int, sync: SceneSync) -> Labels | None:
        """Of one frame, as it would be rendered; None if it was stopped."""
        import perfect_bvh

        from ..labels import label_image

        arguments = self._arguments

        def label(moment: SceneMoment) -> Labels:
            if moment.camera is None:
                raise ValueError(f"scene {self.view.find().name!r} has no camera")
            return label_image(
                moment.depsgraph,
                sync=sync,
                layers=arguments.layers,
                category=arguments.category,
                labels=arguments.labels,
                flow=arguments.flow,
                frame_set=moment.frame_set,
                threads=arguments.threads or 0,
                progress=lambda _: not self._stop.is_set,
            )

        try:
            return self.view.read(label, frame)
        except perfect_bvh.Cancelled:
            return None
        except ValueError as error:
            raise CommandError(f"frame {frame}: {error}") from error


def _stem_of(frame: int) -> str:
    return f"{BEFORE}{frame:04d}"
