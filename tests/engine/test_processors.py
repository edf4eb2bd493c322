"""How many threads there are by themselves, and that a processor without any of the faster instructions is enough."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from child_process import environment_with_paths

EMULATOR = "qemu-x86_64-static"
# Without AVX. The Opteron has nothing newer than SSE3, without which numpy from 2.4 on does not start.
OLD_PROCESSOR = "Opteron_G1" if np.lib.NumpyVersion(np.__version__) < "2.4.0" else "Nehalem"

ON_ONE = """
import os
if os.name == "nt":
    import ctypes
    system = ctypes.CDLL("kernel32")
    system.GetCurrentProcess.restype = ctypes.c_void_p
    system.SetProcessAffinityMask.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
    assert system.SetProcessAffinityMask(system.GetCurrentProcess(), 1)
else:
    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
import perfect_bvh
print(perfect_bvh.thread_count())
perfect_bvh.set_thread_count(3)
perfect_bvh.set_thread_count(0)
print(perfect_bvh.thread_count())
"""

TRACING = """
import sys
import numpy as np
import perfect_bvh
random = np.random.default_rng(1)
scene = perfect_bvh.Scene()
corners = random.normal(size=(3000, 3)).astype(np.float32)
scene.add_instance(scene.add_mesh(corners, np.arange(3000).reshape(-1, 3)))
scene.commit()
hits = scene.cast_rays(random.normal(size=(1000, 3)), random.normal(size=(1000, 3)))
points = scene.compute_closest_points(random.normal(size=(100, 3)))
camera = perfect_bvh.Camera.look_at((0, -5, 0), (0, 0, 0))
image = perfect_bvh.render(scene, camera, "depth", (16, 9))
np.savez(sys.argv[1], t=hits.t_hit, row=hits.primitive_ids, distance=points.distances, image=image)
print(*perfect_bvh.available_isas())
"""


def run(*command: str | Path) -> list[str]:
    done = subprocess.run(command, env=environment_with_paths(), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.split()


@pytest.mark.skipif(sys.platform == "darwin", reason="macOS lets no program choose its processors")
def test_threads_are_as_many_as_processors_that_the_process_may_use() -> None:
    assert run(sys.executable, "-c", ON_ONE) == ["1", "1"]


@pytest.mark.skipif(shutil.which(EMULATOR) is None, reason=f"{EMULATOR} is not installed")
@pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="emulates the Python that runs the tests"
)
def test_a_processor_without_avx_gives_the_same_answers(tmp_path: Path) -> None:
    emulated, here = tmp_path / "emulated.npz", tmp_path / "here.npz"
    assert run(EMULATOR, "-cpu", OLD_PROCESSOR, sys.executable, "-c", TRACING, emulated) == ["scalar"]
    run(sys.executable, "-c", TRACING, here)
    with np.load(emulated) as found, np.load(here) as expected:
        assert np.isfinite(expected["t"]).sum() > 500
        for name in expected.files:
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
