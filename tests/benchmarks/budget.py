"""What a ray costs, stage by stage: instructions, branches mispredicted and reads that miss the first cache.

    python tests/benchmarks/budget.py --json budget.json

Uses the meshes that --mesh and --default-meshes name, or the generated ones with a tenth of their triangles.
trace_bench casts each kind of ray under `valgrind --tool=callgrind`, with this engine and with Embree, whose stages are
counted as one. The cost of every instruction is added to the stage whose function it was inlined into, according to the
debugging information. Instruction counts repeat exactly, even on a busy machine; branches and caches follow callgrind's
model. Valgrind does not support AVX-512, so the kernels are those of AVX2. A ray's cost excludes all work before and
after the clock.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import generated_meshes, options
from benchmarks.meshes import BenchMesh
from benchmarks.tables import Cell, format_table

PROGRAM = "trace_bench"
CASTS = 2  # of each ray in a race of one round: the timed one, and one whose answers others' are compared with
EVENTS = {"Ir": "instructions", "Bcm": "branches mispredicted", "D1mr": "reads that miss L1"}

# By the function that a stage's instructions were inlined into, the innermost that is named here.
STAGES = {
    "set-up": (
        "start_ray",
        "start_directly",
        "load_near",
        "clear_hit",
        "enter_instance",
        "leave_instance",
        "load_ray",
        "set_states",
        "start_eight",
        "take_next_rays",
        "map_to_local",
    ),
    "node": ("test_node", "visit_nodes"),
    "sort": ("push_sorted", "push_unsorted"),
    "leaf": ("visit_leaves", "visit_leaf", "test_leaf", "take_hits", "take_hit"),
    "write-back": ("write_result", "write_results", "divide_weights"),
    "stream": ("trace_stream", "follow_marks", "sort_others", "take_next_ray", "fetch_instances"),
    "ordering": ("reorder_rays", "trace_by_coherence", "gather_left"),
    "packets": ("trace_packets", "trace_instance", "load_packet"),
}
STAGE_OF = {name: stage for stage, names in STAGES.items() for name in names}
OTHER = "other"
NODE_BYTES = 256
PEER = "embree"  # rtcIntersect1 and rtcOccluded1, counted as a whole for comparison
Costs = Counter[tuple[int, str]]  # by address and event
Counts = dict[str, dict[str, float]]  # by stage and event


def main() -> None:
    """Count, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "", is_timed=False)
    options.add_meshes(parser, detail=0.1)
    parser.add_argument("--kinds", nargs="+", default=["diffuse", "occlusion"], help="of rays, as trace_bench has them")
    parser.add_argument("--strategies", nargs="+", default=["stream", "single"], help="as trace_bench has them")
    parser.set_defaults(size="128x80")
    chosen = options.parse(parser)
    rows = []
    is_named = chosen.mesh or chosen.default_meshes
    for mesh in options.meshes_of(chosen) if is_named else generated_meshes.make_all(chosen.detail):
        for kind in chosen.kinds:
            for strategy in (*chosen.strategies, PEER):
                counts = budget_of(chosen.native / PROGRAM, mesh, kind, strategy, chosen.size)
                rows.append({"mesh": mesh.name, "rays": kind, "strategy": strategy, **counts})
    print(describe(rows))
    options.save(chosen, {"rows": rows})


def budget_of(program: Path, mesh: BenchMesh, kind: str, strategy: str, size: str) -> dict[str, Any]:
    """Returns mean counts of a ray: `stages` (all OTHER for the peer), and for ours also the visits that cause them."""
    if not program.is_file():
        raise SystemExit(f"{program} is not built; `nox -s benchmarks` builds it")
    is_peer = strategy == PEER
    words = ["--size", size, "--peers", PEER if is_peer else "", "--strategies", "single" if is_peer else strategy]
    words += ["--visits", *(["--inside"] if mesh.is_inside else [])]
    with tempfile.TemporaryDirectory() as folder:
        mesh_file = Path(folder) / "mesh.bin"
        mesh.write(mesh_file)
        caster = "EmbreeRays" if is_peer else "OurRays"
        rows, profile = _profile(program, [*words, "--kinds", kind, str(mesh_file)], Path(folder), caster)
        if not rows:
            raise SystemExit(f"{mesh.name}: no ray of the kind {kind} to be cast")
        ray_count = CASTS * rows[0]["ray_count"]
        if is_peer:
            return {"stages": {OTHER: {event: cost / ray_count for event, cost in read_totals(profile).items()}}}
        # The rays that find where others begin are ours, and in both runs.
        _, without = _profile(program, [*words, "--kinds", "none", str(mesh_file)], Path(folder), caster)
    costs = read_costs(profile, program.name)
    costs.subtract(read_costs(without, program.name))
    visits = {name: rows[0][name] for name in ("nodes_visited", "primitives_tested")}
    return {"stages": add_up(program, costs, ray_count), **visits}


def _profile(program: Path, words: list[str], folder: Path, caster: str) -> tuple[list[dict[str, Any]], list[str]]:
    """The program's JSON, and the profile of the class in native/benchmarks that casts the rays."""
    profile, out = folder / "profile", folder / "out.json"
    tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={profile}", "--dump-instr=yes", "--dump-line=no"]
    tool += ["--compress-pos=no", "--compress-strings=no", "--branch-sim=yes", "--cache-sim=yes"]
    tool += ["--collect-atstart=no", f"--toggle-collect=perfect_bvh::bench::{caster}::cast()"]
    command = [*tool, str(program), "--noisy", "--rounds", "1", "--isas", "avx2", "--json", str(out)]
    done = subprocess.run([*command, *words], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return json.loads(out.read_text()), profile.read_text().splitlines()


def read_totals(lines: Iterable[str]) -> dict[str, int]:
    """Reads the totals of a callgrind profile by event."""
    found = {
        name: values for name, _, values in (line.partition(":") for line in lines) if name in ("events", "totals")
    }
    totals = dict(zip(found["events"].split(), map(int, found["totals"].split()), strict=False))
    return {event: totals.get(event, 0) for event in EVENTS}


def read_costs(lines: Iterable[str], program: str) -> Costs:
    """Reads costs by address in the program and event. The profile's positions and strings must be uncompressed."""
    events: list[str] = []
    costs, in_program, is_call = Costs(), False, False
    for line in lines:
        if line.startswith("events:"):
            events = line.split()[1:]
        elif line.startswith("ob="):
            in_program = Path(line[3:]).name == program
        elif line.startswith("calls="):
            is_call = True  # the next line is the callee's cost, which the callee's own lines give
        elif line.startswith("0x"):
            if in_program and not is_call:
                address, *values = line.split()
                for event, value in zip(events, values, strict=False):
                    if event in EVENTS:
                        costs[int(address, 16), event] += int(value)
            is_call = False
    return costs


def add_up(program: Path, costs: Costs, ray_count: int) -> Counts:
    """Adds up the counts of one ray by stage."""
    stages = stages_of(program, sorted({address for address, _ in costs}))
    counts: Counts = {stage: dict.fromkeys(EVENTS, 0.0) for stage in (*STAGES, OTHER)}
    for (address, event), cost in costs.items():
        counts[stages[address]][event] += cost / ray_count
    return counts


def stages_of(program: Path, addresses: list[int]) -> dict[int, str]:
    """For each address the functions that it was inlined into, as addr2line gives them, the innermost first."""
    command = ["addr2line", "--exe", str(program), "--functions", "--inlines", "--demangle", "--addresses"]
    asked = "\n".join(hex(address) for address in addresses)
    told = subprocess.run(command, input=asked, capture_output=True, text=True, check=True).stdout
    stages: dict[int, str] = {}
    for block in re.split(r"^0x", told, flags=re.MULTILINE)[1:]:
        address, *lines = block.splitlines()
        names = (word for line in lines[::2] for word in re.findall(r"(\w+)(?=[<(]|$)", line))
        stages[int(address, 16)] = next((STAGE_OF[name] for name in names if name in STAGE_OF), OTHER)
    return stages


def describe(rows: list[dict[str, Any]]) -> str:
    """A table for each event: a row for each kind of ray, a column for each stage."""
    parts = []
    for event, name in EVENTS.items():
        lines: list[list[Cell]] = []
        for row in rows:
            counts = [row["stages"].get(stage, {}).get(event, 0.0) for stage in (*STAGES, OTHER)]
            lines.append([f"{row['mesh']}, {row['rays']}, {row['strategy']}", *counts, sum(counts)])
        parts.append(f"{name} a ray\n{format_table(('rays', *STAGES, OTHER, 'all'), lines)}")
    return "\n\n".join([*parts, describe_visits(rows)])


def describe_visits(rows: list[dict[str, Any]]) -> str:
    """How many nodes our rays visit, what a visit costs, and how much of the tree is read."""
    heads = ("rays", "nodes", "triangles", "instructions a node", "a triangle", "besides", "bytes of nodes")
    lines: list[list[Cell]] = []
    for row in rows:
        if "nodes_visited" not in row:
            continue
        instructions = {stage: counts["Ir"] for stage, counts in row["stages"].items()}
        of_nodes, of_leaves = instructions["node"] + instructions["sort"], instructions["leaf"]
        nodes, triangles = row["nodes_visited"], row["primitives_tested"]
        rest = sum(instructions.values()) - of_nodes - of_leaves
        each = [nodes, triangles, of_nodes / nodes, of_leaves / triangles, rest, nodes * NODE_BYTES]
        lines.append([f"{row['mesh']}, {row['rays']}, {row['strategy']}", *each])
    return f"visits a ray\n{format_table(heads, lines)}"


if __name__ == "__main__":
    main()
