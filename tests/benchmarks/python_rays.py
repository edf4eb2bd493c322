"""The speed of batches of rays from Python, compared with embreex: on one thread, and by the number of threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks import peers
from benchmarks.meshes import BenchMesh
from benchmarks.rays import Rays, make_rays
from benchmarks.rounds import run_rounds, thread_seconds, wall_seconds

Casts = dict[str, Callable[[Rays], object]]
FIELDS = ("t_hit", "primitive_ids")
# Pairs of our query and embreex's: the least that identifies the hit, which for embreex is the triangle without t; and
# the default query, compared with everything that embreex returns.
PAIRS = {"t, triangle": "embreex, triangle", "default fields": "embreex, all fields"}


def measure_from_python(
    mesh: BenchMesh, size: tuple[int, int], rounds: int, left_out: list[str]
) -> list[dict[str, Any]]:
    """A row for each kind of ray, cast in one batch: million rays a second by who cast them, interleaved.

    `one_thread`: in the thread's own CPU time; without embreex if that is not installed, which is then noted in
    left_out. `wall`: ours of `t, triangle` by the wall's clock, by the number of threads.
    """
    snapshot = peers.scene_of(mesh).snapshot()

    def cast(rays: Rays, threads: int, **fields: Any) -> object:
        columns = rays.origins, rays.directions
        if rays.is_any_hit:
            return snapshot.test_occlusions(*columns, t_max=rays.t_max, threads=threads)
        return snapshot.cast_rays(*columns, t_max=rays.t_max, threads=threads, **fields)

    casts: Casts = {
        "t, triangle": lambda rays: cast(rays, 1, fields=FIELDS),
        "default fields": lambda rays: cast(rays, 1),
    }
    try:
        casts |= {
            "embreex, triangle": peers.embreex(mesh).cast,
            "embreex, all fields": peers.embreex(mesh, all_fields=True).cast,
        }
    except ImportError as error:
        left_out.append(f"embreex: {error}")
    threads: Casts = {"1": casts["t, triangle"], "2": lambda rays: cast(rays, 2, fields=FIELDS)}
    return [
        {
            "mesh": mesh.name,
            "rays": rays.name,
            "ray_count": len(rays),
            "one_thread": _speeds(casts, rays, rounds, thread_seconds),
            "wall": _speeds(threads, rays, rounds, wall_seconds),
        }
        for rays in make_rays(mesh, *size)
    ]


def _speeds(casts: Casts, rays: Rays, rounds: int, clock: Callable[[], float]) -> dict[str, float]:
    """Million rays a second, of the lower third of the times: disturbances only add time."""
    calls = {name: partial(each, rays) for name, each in casts.items()}
    times = run_rounds(calls, rounds, clock)
    return {name: 1e-6 * len(rays) / sorted(seconds)[len(seconds) // 3] for name, seconds in times.items()}
