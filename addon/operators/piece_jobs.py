"""The common parts of the buttons Scan and Label Images: a job in steps of a timer, and chunks of frames in files."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import bpy
from bpy.app.handlers import persistent

from ..statistics.words import count_of
from ..support.files import prepare_folder
from .ticking import Ticking

if TYPE_CHECKING:
    from ..live.scene_view import SceneView
    from ..pieces.work import PieceWork

STEP_SECONDS = 0.1
ROUNDING = 1e-6  # of a frame: a share of a chunk may be just below a whole number of frames


class JobOperator(Ticking):
    """Steps through a job, which has `steps`, `release`, `stopped`, `built_share` and `where` as `PiecesJob` has.

    doing: the verb in the status bar.
    """

    doing: ClassVar[str]
    _started: float
    _job: Any
    _steps: Any  # a generator; Blender evaluates annotations

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        done: float | None = None
        try:
            done = self._hold(context)
        except ValueError as problem:
            self._complain(problem)
        finally:
            self._end(context)
        return self._give_up(context) if done is None else self._finish(context)

    def _begin(self, context: bpy.types.Context) -> bool:
        self._forget_complaints()
        self._started = time.perf_counter()
        try:
            self._job = self._make_job(context)
        except (ValueError, ImportError, OSError) as problem:
            self._complain(problem)
            return False
        self._steps = self._job.steps()
        return True

    def _make_job(self, context: bpy.types.Context) -> Any:
        """Returns the job that the panel describes. Raises ValueError, ImportError and OSError."""
        raise NotImplementedError

    def _hold(self, context: bpy.types.Context) -> float | None:
        """Does `_run` with one evaluated scene, if that is faster."""
        return self._run()

    def _run(self) -> float | None:
        """Does all steps, in one go."""
        done: float | None = 0.0
        while done is not None and done < 1.0:
            done = self._step(STEP_SECONDS)
        return done

    def _step(self, seconds: float) -> float | None:
        """Work for about `seconds`; the share done, None if the scan has failed, with the reason reported."""
        import perfect_bvh

        deadline = time.perf_counter() + seconds
        try:
            for done in self._steps:
                # While trees are built there is nothing to do but let Blender go on.
                if time.perf_counter() >= deadline or self._job.built_share is not None:
                    # The last step is over when the iterator is: it sets the frame back.
                    return min(done, 0.999)
        except OSError as problem:
            self._keep()
            self._complain(problem)
            return None
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return None
        return 1.0

    def _tick(self, context: bpy.types.Context) -> set[str] | None:
        done = self._step(STEP_SECONDS)
        if done is None:
            self._end(context)
            return self._give_up(context)
        context.window_manager.progress_update(100 * done)
        self._show_state(context)
        if done < 1.0:
            return None
        self._end(context)
        return self._finish(context)

    def _stopped(self) -> str:
        return str(self._job.stopped())

    def _show_state(self, context: bpy.types.Context) -> None:
        built = self._job.built_share
        building = "" if built is None else f" | Building BVHs {built:.0%}"
        self._tell(context, f"{self.doing}{self._job.where}{building} | Esc: Cancel")

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        self._job.release()
        self._end_ticking(context)

    def _keep(self) -> None:
        """Keeps the rest of the results after a file could not be written."""

    def _give_up(self, context: bpy.types.Context) -> set[str]:
        """Returns the operator's result after a failure."""
        return {"CANCELLED"}

    def _finish(self, context: bpy.types.Context) -> set[str]:
        """The same when it is done."""
        raise NotImplementedError


@contextmanager
def saved_at_the_users_frame(view: SceneView) -> Iterator[None]:
    """While this is active, saved files store the frame of the user's scene, not that of the job.

    Blender evaluates the stored frame when it opens a file; so nothing is evaluated here, and the job continues.
    """
    scene = view.find()
    users = scene.frame_current, scene.frame_subframe
    jobs = users

    def swap(frame: tuple[int, float]) -> tuple[int, float]:
        scene = view.find()
        before = scene.frame_current, scene.frame_subframe
        scene.frame_current, scene.frame_subframe = frame
        return before

    @persistent
    def before_saving(*_: object) -> None:
        nonlocal jobs
        jobs = swap(users)

    @persistent
    def after_saving(*_: object) -> None:
        swap(jobs)

    handlers = bpy.app.handlers
    pairs = ((handlers.save_pre, before_saving), (handlers.save_post, after_saving))
    failed = getattr(handlers, "save_post_fail", None)
    for listed, handler in (*pairs, *([(failed, after_saving)] if failed is not None else [])):
        listed.append(handler)
    try:
        yield
    finally:
        for listed, handler in (*pairs, *([(failed, after_saving)] if failed is not None else [])):
            if handler in listed:  # opening a file may have removed it
                listed.remove(handler)


_folders_in_use: set[Path] = set()


def prepare_free_folder(folder: Path) -> None:
    """Makes a folder. Raises ValueError if another job writes there, OSError if it cannot be made."""
    if folder in _folders_in_use:
        raise ValueError(f"Files are still being written into {folder}: wait, or cancel with Esc")
    prepare_folder(folder)


class PiecesJob:
    """Chunks of the frames, as files.

    noun: the name of the job. resumes: whether it keeps existing files.
    """

    noun: ClassVar[str] = "Scan"

    def __init__(self, work: PieceWork, folder: Path, resumes: bool) -> None:
        from ..pieces.work import Outcome

        work.place.prepare(work.pieces, *work.joined, resume=resumes)
        self._work, self._folder, self._resumes = work, folder, resumes
        self._outcome, self._done = Outcome(), 0.0  # chunks, with the part of the current one
        _folders_in_use.add(folder)

    @property
    def built_share(self) -> float | None:
        return getattr(self._work, "built_share", None)

    @property
    def where(self) -> str:
        """The target of the work, for the status bar."""
        counts = [len(piece.frames) for piece in self._work.pieces]
        number = min(int(self._done), len(counts) - 1)
        done = sum(counts[:number]) + int((self._done - number) * counts[number] + ROUNDING)
        return f" frame {min(done + 1, sum(counts))} of {sum(counts)}"

    def steps(self) -> Generator[float, None, None]:
        """Yields the share done, 0 to 1; joins the chunks in the end."""
        from ..pieces.work import do_pieces

        scene = self._work.view.find()
        frame = scene.frame_current, scene.frame_subframe, scene.camera.session_uid if scene.camera else 0
        try:
            with saved_at_the_users_frame(self._work.view), closing(do_pieces(self._work, self._outcome)) as steps:
                for self._done in steps:
                    yield self._done / len(self._work.pieces)
        finally:
            self._work.view.set_frame_back(*frame)
        self._work.join()

    def release(self) -> None:
        """Releases the folder at the end, after success or failure: other scans may write there."""
        _folders_in_use.discard(self._folder)

    def stopped(self) -> str:
        """Returns the message to a user who has stopped it."""
        start = f"Start {self.noun}"
        how = f"{start} continues" if self._resumes else f"To continue, enable Resume and press {start}"
        count = f"{self._outcome.there} of {count_of(len(self._work.pieces), 'file')}"
        return f"{self.noun} canceled: {count} written to {self._folder}. {how}"
