"""Measures bakes: hours of sun in a city, the same rays by embreex, and ambient occlusion compared with Cycles' bake.

    python tests/benchmarks/bake.py --json bake.json

city: `bake_rays` of all faces and suns, from the evaluated scene to the values, on all threads, by the wall's clock.
rays: some of the suns, cast as bakes do, on all threads and on one, and by embreex, which has one: interleaved, points
and directions ready before the clock, from origins that embreex needs farther from the faces. M rays a second.
occlusion: an assembly of tori, ours at the vertices and Cycles' at their four corners each, with a quarter of the rays
at a corner. Its corners' means and our values are compared with 2,048 rays of ours at the vertices of one torus; CPU
time. Errors fall with the root of the number of rays, so the last figure is our time to Cycles' error in parts of its
own.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import numpy as np
import numpy.typing as npt
from benchmarks import options
from benchmarks.rounds import Spread, run_rounds
from blender.baked_scenes import end_of
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from perfect_bvh._tuning import Traced
from perfect_bvh_addon import SceneSync, bake_rays
from perfect_bvh_addon.baking.kinds import SunTally
from perfect_bvh_addon.baking.receivers import find_receivers, place_points
from perfect_bvh_addon.baking.settings import BakeSettings

F64 = npt.NDArray[np.float64]
Row = dict[str, Any]
RACED_SUNS = 20
OFF = 1e-3  # how far from a face embreex's rays begin, in metres
DISTANCE = 10.0


def main() -> None:
    """Measure, print, write the JSON."""
    parser = options.parser(__doc__ or "")
    parser.add_argument("--faces", type=int, default=100_000, help="of the city, about")
    parser.add_argument("--suns", type=int, default=4_000)
    parser.add_argument("--objects", type=int, default=300, help="of the assembly, 10,000 triangles each")
    parser.add_argument("--rays", type=int, default=256, help="a vertex, of both")
    chosen = options.parse(parser)
    rows: list[Row] = []
    for measure in (measure_city, race_rays, measure_occlusion):
        rows += [row := measure(chosen)]
        words = (
            f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}" for name, value in row.items()
        )
        print(", ".join(words), flush=True)
    options.save(chosen, {"bakes": rows})


def suns(count: int) -> F64:
    """(N, 3) directions above the horizon, from a seed."""
    random = np.random.default_rng(2)
    height, turn = random.uniform(0.02, 1.0, count), random.uniform(0.0, 2.0 * math.pi, count)
    flat = np.sqrt(1.0 - height * height)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)


def city(face_count: int) -> bpy.types.Object:
    """Blocks of different heights in streets, their faces as fine as their ground's; one mesh."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    random, side = np.random.default_rng(1), int(math.sqrt(face_count / 61.0))
    x, y, z = np.eye(3)
    vertices: list[F64] = []
    faces: list[F64] = []

    def add(corner: F64, u: F64, v: F64, columns: int, rows: int) -> None:
        i, j = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
        first = sum(map(len, vertices)) + (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
        vertices.append(corner + (i / columns).reshape(-1, 1) * u + (j / rows).reshape(-1, 1) * v)
        faces.append(np.stack([first, first + 1, first + columns + 2, first + columns + 1], axis=1))

    for block in range(side * side):
        height, width, depth = random.uniform((5.0, 9.0, 9.0), (30.0, 13.0, 13.0))
        corner = 18.0 * (block % side) * x + 18.0 * (block // side) * y
        add(corner, width * x, height * z, 3, 4)
        add(corner + width * x, depth * y, height * z, 3, 4)
        add(corner + width * x + depth * y, -width * x, height * z, 3, 4)
        add(corner + depth * y, -depth * y, height * z, 3, 4)
        add(corner + height * z, width * x, depth * y, 2, 2)
        add(corner - 3.0 * x - 3.0 * y, 18.0 * x, 18.0 * y, 3, 3)
    mesh = bpy.data.meshes.new("City")
    mesh.from_pydata(np.concatenate(vertices).tolist(), [], np.concatenate(faces).tolist())
    made = bpy.data.objects.new("City", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def measure_city(chosen: argparse.Namespace) -> Row:
    """Hours of sun of the whole city."""
    made = city(chosen.faces)
    started, cpu = time.perf_counter(), time.process_time()
    bake = bake_rays([made], kind="SUN_HOURS", directions=suns(chosen.suns))
    seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
    facts: Row = {"kind": "city", "faces": len(made.data.polygons), "suns": chosen.suns, "rays": bake.ray_count}
    return facts | {"seconds": seconds, "cpu_seconds": cpu, "threads": os.cpu_count()}


def race_rays(chosen: argparse.Namespace) -> Row:
    """Ours and embreex's."""
    made, settings = city(chosen.faces), BakeSettings("SUN_HOURS", directions=suns(RACED_SUNS))
    depsgraph, sync = bpy.context.evaluated_depsgraph_get(), SceneSync(watch=False)
    sync.update(depsgraph, chosen.faces * chosen.suns)
    (receiver,) = find_receivers(sync.record, depsgraph, [made], settings, False)
    points = end_of(place_points(receiver, settings))
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, receiver.mesh.positions[receiver.mesh.triangles].astype(np.float32))
    above = [np.flatnonzero(points.normals @ sun > 0.0) for sun in suns(RACED_SUNS)]
    lifted = (points.positions + OFF * points.normals).astype(np.float32)
    embreex_rays = [
        (lifted[rows], np.tile(sun.astype(np.float32), (len(rows), 1)))
        for rows, sun in zip(above, suns(RACED_SUNS), strict=True)
    ]

    def ours(threads: int) -> Callable[[], object]:
        def cast() -> None:
            for block in points.blocks(1 << 16):
                tally = SunTally(block, settings)
                tally.scene, tally.threads = Traced(sync.scene.snapshot(), "stream"), threads
                for step in range(tally.step_count):
                    tally.cast(step)

        return cast

    calls = {
        "ours": ours(0),
        "ours_one_thread": ours(1),
        "embreex": lambda: [scene.run(*rays, query="OCCLUDED") for rays in embreex_rays],
    }
    count = sum(map(len, above))
    seconds = run_rounds(calls, chosen.rounds, clock=time.perf_counter)
    rates = {name: Spread.of([1e-6 * count / value for value in values]).median for name, values in seconds.items()}
    return {"kind": "rays", "rays": count, **rates, "to_embreex": rates["ours"] / rates["embreex"]}


def measure_occlusion(chosen: argparse.Namespace) -> Row:
    """Ambient occlusion of an assembly, ours and Cycles'."""
    import addon_utils  # bpy brings it

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("cycles")
    random, scene, objects = np.random.default_rng(0), bpy.context.scene, []
    for _ in range(chosen.objects):
        place = random.uniform(-2.0, 2.0, 3) * (1.0, 1.0, 0.4) * math.sqrt(chosen.objects / 10.0)
        how = {"major_segments": 100, "minor_segments": 50, "major_radius": 1.0, "minor_radius": 0.3}
        bpy.ops.mesh.primitive_torus_add(**how, location=place, rotation=random.uniform(0.0, 6.0, 3))
        objects.append(bpy.context.object)
        bpy.context.object.data.color_attributes.new("occlusion", "FLOAT_COLOR", "CORNER")
    scene.world = bpy.data.worlds.new("World")
    scene.world.light_settings.distance = DISTANCE
    scene.render.engine = "CYCLES"
    scene.cycles.samples = max(1, chosen.rays // 4)
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.render.bake.target = "VERTEX_COLORS"
    for made in objects:
        made.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]
    how = {"kind": "AMBIENT_OCCLUSION", "distance": DISTANCE}
    truth = bake_rays(objects[:1], domain="POINT", rays=2048, **how).objects[0].values
    start = time.process_time()
    bake = bake_rays(objects, domain="POINT", rays=chosen.rays, **how)
    middle = time.process_time()
    bpy.ops.object.bake(type="AO", target="VERTEX_COLORS")
    ours, cycles = middle - start, time.process_time() - middle
    corners, mesh = np.empty((len(objects[0].data.loops), 4), np.float32), objects[0].data
    mesh.color_attributes["occlusion"].data.foreach_get("color", corners.reshape(-1))
    owners = np.array([loop.vertex_index for loop in mesh.loops])
    theirs = np.bincount(owners, corners[:, 0]) / np.bincount(owners)
    errors = [float(np.sqrt(np.mean((values - truth) ** 2))) for values in (bake.objects[0].values, theirs)]
    return {
        "kind": "occlusion",
        "triangles": sum(2 * len(made.data.polygons) for made in objects),
        "rays": bake.ray_count,
        "cpu_seconds": ours,
        "cycles_cpu_seconds": cycles,
        "error": errors[0],
        "cycles_error": errors[1],
        "time_to_cycles_error": ours / cycles * (errors[0] / errors[1]) ** 2,
    }


if __name__ == "__main__":
    main()
