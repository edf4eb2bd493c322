"""Run trimesh's own tests of rays with our intersector in its others' place.

    python tests/stress/trimesh_tests.py FOLDER [pytest's arguments]

FOLDER is a clone of trimesh's repository, of the version that is installed; its `tests` and `models` are used. All
tests that need an intersector, with or without Embree, get ours.
"""

from __future__ import annotations

import os
import sys

import pytest
import trimesh
from perfect_bvh.trimesh import RayMeshIntersector
from trimesh import ray

FILES = ("ray", "ray_upstream", "proximity", "mesh")


def main() -> int:
    """Return pytest's exit status."""
    folder, *arguments = sys.argv[1:]
    for module in (ray.ray_triangle, ray.ray_pyembree):
        module.RayMeshIntersector = RayMeshIntersector
    assert type(trimesh.creation.box().ray) is RayMeshIntersector
    os.chdir(folder)
    files = (f"tests/test_{name}.py" for name in FILES)
    return int(pytest.main(["-n", "0", "-p", "no:cacheprovider", *files, *arguments]))


if __name__ == "__main__":
    sys.exit(main())
