"""The answers of the native competitors, Embree among them, in the form that the judge takes."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from benchmarks.meshes import BenchMesh
from benchmarks.native import NativePrograms
from benchmarks.peers import Answers
from benchmarks.rays import Rays

PROGRAM = "answers_bench"


def ask(
    native: NativePrograms, mesh: BenchMesh, rays: Rays, peers: Sequence[str], strategies: Sequence[str]
) -> dict[str, Answers]:
    """By competitor, named as by trace_bench. For queries of any hit, primitive_ids is 0 where there is a hit.

    strategies: in which ours trace.
    """
    with tempfile.TemporaryDirectory() as folder:
        rays_file, answers_file = Path(folder) / "rays.bin", Path(folder) / "answers.bin"
        header = np.array([len(rays), rays.is_any_hit], "<u4").tobytes() + np.array([rays.t_max], "<f4").tobytes()
        columns = (rays.origins.astype("<f4"), rays.directions.astype("<f4"))
        rays_file.write_bytes(b"".join([header, *(column.tobytes() for column in columns)]))
        words = ["--rays", str(rays_file), "--answers", str(answers_file)]
        words += ["--peers", ",".join(peers), "--strategies", ",".join(strategies)]
        names = native.run(PROGRAM, mesh, words, is_timed=False)
        data: npt.NDArray[np.float32] = np.fromfile(answers_file, "<f4").reshape(len(names), 2, len(rays))
    ids = np.ascontiguousarray(data[:, 1]).view("<i4").astype(np.int64)
    return {name: Answers.of_one(data[i, 0].astype(np.float64), ids[i]) for i, name in enumerate(names)}
