"""A long scan as files of some frames each, which are recognised when it is run again. Knows no Blender."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..pieces.folder import PieceFolder
from ..pieces.piece import Piece, runs_of
from .format_columns import label_columns
from .formats import save_cloud
from .light.model import Light
from .patterns import Pattern
from .point_cloud import PointCloud

BEFORE = "points_"  # of the names of all files


def pieces_of(frames: Sequence[int], size: int, suffix: str = ".npz") -> list[Piece]:
    """Runs of frames that follow each other, of at most so many each, in the order of the frames."""
    stems = [(run, f"{BEFORE}{run[0]:04d}-{run[-1]:04d}") for run in runs_of(frames, size)]
    return [Piece(run, stem, (f"{stem}{suffix}",)) for run, stem in stems]


def sensor_input(pattern: Pattern) -> dict[str, Any]:
    """A sensor as an input of pieces."""
    values = {
        name: None if value == math.inf else value
        for name, value in asdict(pattern).items()  # type: ignore[call-overload]
    }
    return {"kind": type(pattern).__name__, **values}


def light_input(light: Light | None) -> dict[str, Any] | None:
    """The same of what a sensor's file says of light."""
    return None if light is None else asdict(light)


def write_piece(place: PieceFolder, piece: Piece, cloud: PointCloud) -> None:
    """The file of points, then its manifest. Raises OSError."""
    path = place.path_of(piece.files[0])
    save_cloud(cloud, path)
    stretches = len(piece.frames) * place.inputs["steps"]
    # Of a single stretch, of whose way nothing is known but its ends, there are no errors.
    is_known = stretches > 1 and not place.inputs["is_one_pass"]
    place.finish(
        piece,
        rays=cloud.ray_count,
        points=len(cloud),
        ray_outcomes=cloud.ray_outcomes.named,
        object_names=list(cloud.object_names),
        material_names=list(cloud.material_names),
        labels=cloud.described_labels(label_columns(cloud.labels, path.suffix.lower())),
        **{name: getattr(cloud, name) if is_known else None for name in ("pose_error", "scene_error")},
        warnings=list(cloud.warnings),
    )
