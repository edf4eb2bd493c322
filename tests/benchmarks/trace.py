"""The speed of rays, compared with Embree and Blender, and the number of wrong answers.

For each mesh and kind of ray (primary, diffuse, the same shuffled, ambient occlusion, and through instances): M rays/s
on one thread, of native code with every instruction set and strategy against Embree's single rays, 16-wide packets and
robust mode, and from Python against embreex, BVHTree.ray_cast and scene.ray_cast. All figures that are compared are
measured in turn in one run. The double-precision oracle judges a sample of answers of every peer that Python can call.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from benchmarks import options, peers
from benchmarks.build_python import measure_rays
from benchmarks.instances import Instanced
from benchmarks.judging import Judge, pick_sample
from benchmarks.meshes import BenchMesh
from benchmarks.native import NativePrograms
from benchmarks.native_answers import ask
from benchmarks.peers import Answers, Peer
from benchmarks.rays import Rays, make_rays
from benchmarks.trace_tables import describe_mesh
from tqdm import tqdm

EMBREE = ("embree", "embree_avx2", "embree_robust", "embree_avx2_robust", "embree_packets")
STRATEGIES = ("auto", "packets", "stream", "single")


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    options.add_meshes(parser)
    options.add_ray_limit(parser)
    add = parser.add_argument
    add("--sample", type=int, default=500, metavar="N", help="rays of each kind whose answers are judged")
    counts = [1000, 10_000, 100_000, 1_000_000]
    add("--instances", type=int, nargs="*", default=counts, metavar="N", help="of the first mesh; no number: none")
    chosen = options.parse(parser)
    meshes = options.meshes_of(chosen)
    native, left_out = NativePrograms(chosen.native), list[str]()
    results = []
    with tqdm(unit="table", smoothing=0.0) as bar:
        bar.total = 5 * len(meshes) + 2 * len(chosen.instances)
        for mesh in meshes:
            bar.set_description(mesh.name)
            counts = chosen.instances if mesh is meshes[0] else []
            results.append(measure(mesh, counts, chosen, native, left_out, bar))
            tqdm.write(describe_mesh(results[-1]) + "\n", file=sys.stdout)
        bar.update(bar.total - bar.n)
    left_out = list(dict.fromkeys(left_out))
    for line in left_out:
        print(f"left out: {line}")
    options.save(chosen, {"left_out": left_out, "meshes": results})


def measure(
    mesh: BenchMesh,
    counts: list[int],
    chosen: argparse.Namespace,
    native: NativePrograms,
    left_out: list[str],
    bar: tqdm[Any],
) -> dict[str, Any]:
    """Everything about one mesh. counts: of instances, to cast rays through as well."""
    result: dict[str, Any] = {"name": mesh.name, "triangle_count": len(mesh.triangles), "native": [], "instances": []}
    rounds = ["--rounds", str(chosen.rounds)]
    if native.has("trace_bench"):
        peer_names = ["--peers", ",".join(EMBREE), "--strategies", ",".join(STRATEGIES)]
        inside = ["--inside"] if mesh.is_inside else []
        result["native"] = native.run("trace_bench", mesh, [*rounds, *peer_names, "--size", chosen.size, *inside])
    else:
        left_out.append(native.why_not("trace_bench"))
    bar.update()
    if counts and native.has("instance_bench"):
        wanted = ["--counts", ",".join(map(str, counts)), "--kinds", "primary,diffuse", "--layouts", "grid"]
        result["instances"] = native.run("instance_bench", mesh, [*rounds, *wanted])
    bar.update(len(counts))
    result["from_python"] = []
    single = _one_mesh(mesh, chosen, native, left_out)
    for row in chain(single, _instanced(mesh, counts, chosen, left_out)):
        result["from_python"].append(row)
        bar.update()
    return result


def _one_mesh(
    mesh: BenchMesh, chosen: argparse.Namespace, native: NativePrograms, left_out: list[str]
) -> Iterator[dict[str, Any]]:
    tracers = peers.ours_in_every_way(peers.scene_of(mesh))
    others = {
        "embreex": lambda: [peers.embreex(mesh), peers.embreex(mesh, is_robust=True)],
        "BVHTree": lambda: [peers.bvh_tree(mesh, chosen.ray_limit)],
        "scene.ray_cast": lambda: [peers.blender_scene(mesh, np.eye(4)[None], chosen.ray_limit)],
    }
    for name, make in others.items():
        try:
            tracers += make()
        except ImportError as error:
            left_out.append(f"{name}: {error}")
    judge = Judge(mesh)
    for rays in make_rays(mesh, *options.size_of(chosen)):
        sample = pick_sample(rays, chosen.sample)
        natively = ask(native, mesh, sample, EMBREE, STRATEGIES) if native.has("answers_bench") else {}
        yield _race(tracers, rays, judge, natively, chosen)


def _instanced(
    mesh: BenchMesh, counts: list[int], chosen: argparse.Namespace, left_out: list[str]
) -> Iterator[dict[str, Any]]:
    for count in counts:
        placed = Instanced(mesh, count)
        tracers = peers.ours_in_every_way(placed.scene())
        if count <= 1000:  # Blender's own objects, one by one
            try:
                tracers.append(peers.blender_scene(mesh, placed.transforms, chosen.ray_limit))
            except ImportError as error:
                left_out.append(f"scene.ray_cast: {error}")
        rays = placed.rays(*options.size_of(chosen))
        yield _race(tracers, rays, Judge(mesh, placed.transforms), {}, chosen)


def _race(
    tracers: list[Peer], rays: Rays, judge: Judge, natively: dict[str, Answers], chosen: argparse.Namespace
) -> dict[str, Any]:
    """One kind of ray: speeds and numbers of wrong answers. natively: the native competitors' answers to the sample."""
    speeds = measure_rays(tracers, rays, chosen.rounds, lambda: None)
    sample = pick_sample(rays, chosen.sample)
    answers = {f"native {name}": each for name, each in natively.items()}
    answers |= {tracer.name: tracer.ask(sample) for tracer in tracers}
    wrong = {name: each.as_json() for name, each in judge.count_wrong(sample, answers).items()}
    return {
        "name": rays.name,
        "peers": [{"name": each.name, **speeds[each.name], "wrong": wrong[each.name]} for each in tracers],
        "native_wrong": {name: wrong[f"native {name}"] for name in natively},
    }


if __name__ == "__main__":
    main()
