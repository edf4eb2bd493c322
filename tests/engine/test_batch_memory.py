"""A batch needs no more memory than its arguments and its answers: measured in a separate process."""

from __future__ import annotations

import subprocess
import sys

import pytest
from child_process import environment_with_paths
from process_memory import MEGABYTE

RAYS = 10_000_000

# {rays} and {call} are filled in; prints by how many megabytes the peak grew during the call.
SCRIPT = """
import numpy as np
import perfect_bvh
from process_memory import peak_megabytes

scene = perfect_bvh.Scene()
scene.add_instance(scene.add_mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
scene.commit()
scene.cast_rays(np.zeros((5000, 3)), np.ones(3))
origins = np.broadcast_to(np.array([0.2, 0.2, 1.0]), ({rays}, 3))
down = np.array([0.0, 0.0, -1.0])
before = peak_megabytes()
answer = {call}
print(peak_megabytes() - before)
"""

CALLS = {
    "cast_rays": ("scene.cast_rays(origins, down, fields=('t_hit',)).t_hit", 4),
    "test_occlusions": ("scene.test_occlusions(origins, down)", 1),
    "count_intersections": ("scene.count_intersections(origins, down)", 4),
    # counts and ray_splits in addition to one t for each of the rays
    "list_intersections": ("scene.list_intersections(origins, down, fields=('t_hit',))", 4 + 4 + 8),
}


@pytest.mark.parametrize("name", CALLS)
def test_memory_of_many_rays(name):
    call, bytes_per_ray = CALLS[name]
    script = SCRIPT.format(rays=RAYS, call=call)
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=environment_with_paths(),
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    grown = float(done.stdout)
    # In addition to the answer: copies of a million rays' origins and directions, and Python's own allocations.
    allowed = RAYS * bytes_per_ray / MEGABYTE + 96
    assert grown < allowed, f"{name} of {RAYS} rays took {grown:.0f} MB, allowed {allowed:.0f}"
    assert RAYS * 24 / MEGABYTE > 200, "so many that a copy of the origins alone would not be allowed"
