"""Builds trees and traces rays with the `perfect_bvh` that Python finds; runs on any machine that has numpy.

python trace_scene.py INPUTS.npz ANSWERS.npz. The inputs come as a file, so that no other machine's sines are in them.
"""

from __future__ import annotations

import platform
import sys

import numpy as np
import perfect_bvh
from perfect_bvh import BuildConfig, Camera, Scene, render_passes
from perfect_bvh._tuning import with_policy

CONFIGS = {
    "auto": "auto",
    "fast": BuildConfig(builder="fast"),
    "spatial": BuildConfig(builder="spatial"),
    "optimized": BuildConfig(builder="binned", optimize=2),
}
POLICIES = ("refit", "rotate", "rebuild_parts")
FIELDS = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs", "geometric_normals", "positions")
COLORS = ("depth", "normal", "clay", "preview")
Arrays = dict[str, np.ndarray]


def make_scene(inputs: Arrays, config: object, policy: str = "governed") -> Scene:
    scene = with_policy(Scene(), policy)
    soup = scene.add_mesh(inputs["positions"], inputs["triangles"], config, usage="deforming")
    floor = scene.add_mesh(inputs["floor_positions"], inputs["floor_triangles"], config)
    scene.add_instances([soup] * len(inputs["transforms"]), inputs["transforms"])
    scene.add_instance(floor)
    scene.commit(expected_rays=1_000_000)
    return scene


def trace(scene: Scene, inputs: Arrays) -> Arrays:
    """The scene's answers to rays and points, and the boxes of its trees."""
    answers = {}
    for name in ("scattered", "coherent"):
        origins, directions = inputs[f"{name}_origins"], inputs[f"{name}_directions"]
        hits = scene.cast_rays(origins, directions, fields=FIELDS)
        answers |= {f"{name} {field}": getattr(hits, field) for field in FIELDS}
        answers[f"{name} occlusions"] = scene.test_occlusions(origins, directions)
        answers[f"{name} counts"] = scene.count_intersections(origins, directions)
    answers["closest"] = scene.compute_closest_points(inputs["scattered_origins"][:100]).distances
    for mesh in (None, 0, 1):
        answers[f"boxes of {mesh}"] = scene.snapshot().tree_boxes(mesh).boxes
    return answers


def trace_all(inputs: Arrays) -> Arrays:
    answers = {}
    for name, config in CONFIGS.items():
        found = trace(make_scene(inputs, config), inputs)
        answers |= {f"{name}: {what}": value for what, value in found.items()}
    for policy in POLICIES:
        scene = make_scene(inputs, "auto", policy)
        scene.update_mesh(0, inputs["moved_positions"])
        scene.commit()
        found = trace(scene, inputs)
        answers |= {f"after {policy}: {what}": value for what, value in found.items()}
    return answers


def draw(inputs: Arrays) -> Arrays:
    """Small images in some modes."""
    scene = make_scene(inputs, "auto")
    camera = Camera.look_at((0, -6, 3), (0, 0, 0), aspect=1.5)
    made = {mode: render_passes(scene, camera, mode=mode, size=(30, 20), samples=2)["combined"] for mode in COLORS}
    return {f"image: {mode}": image for mode, image in made.items()}


def main() -> None:
    with np.load(sys.argv[1]) as file:
        inputs = dict(file)
    try:
        perfect_bvh.set_active_isa("sse9")
    except ValueError as error:
        refusal = str(error)
    np.savez(
        sys.argv[2],
        machine=platform.machine(),
        python="{}.{}".format(*sys.version_info),
        module=perfect_bvh.__file__,
        isas=perfect_bvh.available_isas(),
        isa=perfect_bvh.active_isa(),
        refusal=refusal,
        **trace_all(inputs),
        **draw(inputs),
    )


if __name__ == "__main__":
    main()
