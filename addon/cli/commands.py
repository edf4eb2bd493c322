"""The commands of few options: `scan`, `info`, `bench` and `calibrate`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from ..settings.native_fault import explain, read_manifest
from ..statistics.words import memory, primitives, sum_of
from .arguments import EXIT_INTERRUPTED, CommandError, check_blend_file, check_pieces, parse_folder, parse_path
from .blender import StopRequest, active_view_layer, apply_settings, open_scene, stop_on_interrupt
from .frames import run_pieces
from .report import format_table, quiet_blender

if TYPE_CHECKING:
    import bpy
    from perfect_bvh import MeshReport, SceneStatistics

    from ..image.plan import RenderPlan
    from ..live.scene_sync import SceneSync
    from ..live.scene_view import SceneMoment
    from ..pieces.work import PieceWork
    from ..scanning.sensor_files import Sensor
    from ..sync.report import SyncReport

# `perfect-bvh bench`: what builders and policies cost and gain on a scene, as a table and charts.


def run_bench(arguments: argparse.Namespace) -> int:
    """Measure, write the files and print the advice; returns the exit status, 130 if it was stopped with results."""
    path = check_blend_file(arguments.file)
    folder = parse_folder(arguments.output)
    with quiet_blender() as out, stop_on_interrupt() as stop:
        scene = open_scene(path, arguments)
        return _measure(scene, folder, arguments, stop, out)


def _measure(
    scene: bpy.types.Scene, folder: Path, arguments: argparse.Namespace, stop: StopRequest, out: TextIO
) -> int:
    import perfect_bvh
    from tqdm import tqdm

    from ..bench.measurements import SceneBench, subject_of
    from ..bench.results import HOW_TO_GET_CHARTS, format_table, write
    from ..live.scene_view import SceneView, go_to_frame

    if arguments.threads is not None:
        perfect_bvh.set_thread_count(min(arguments.threads, 1024))
    go_to_frame(scene, scene.frame_current, arguments.viewport)
    view = SceneView("bench", scene, active_view_layer(scene), for_viewport=arguments.viewport)
    bench = SceneBench(subject_of(scene, for_viewport=arguments.viewport), arguments.seconds)
    bar_format = "{l_bar}{bar}| {elapsed}"

    def run() -> None:
        for share, what in bench.steps():
            bar.set_description(what)
            bar.update(share - bar.n)
            if stop.is_set:
                break

    with tqdm(total=1.0, bar_format=bar_format, disable=None, leave=False, file=sys.stderr) as bar:
        try:
            view.hold(run)
        except ValueError as error:
            raise CommandError(str(error)) from error
    try:
        results = write(bench.figures, folder)
    except OSError as error:
        raise CommandError(f"cannot write into {folder}: {error.strerror}") from error
    out.write(f"{format_table(results.table)}\n")
    for name, sentence in results.advice.items():
        out.write(f"{results.pictures[name].name if name in results.pictures else name}: {sentence}\n")
    if not results.can_draw:
        out.write(f"{HOW_TO_GET_CHARTS}\n")
    out.write(f"{results.json}\n")
    if stop.is_set:
        sys.stderr.write("perfect-bvh: stopped; the results so far are written\n")
        return EXIT_INTERRUPTED
    return 0


# Calibrate -----------------------------------------------------------------------------------------------------------
# `perfect-bvh calibrate`: measures this machine for the governor and keeps the numbers. Needs no Blender.


def run_calibrate(arguments: argparse.Namespace) -> int:
    """Measure, print and save; the exit status."""
    try:
        from perfect_bvh.calibrate import calibrate
        from perfect_bvh.calibration import BUILDERS, user_file
    except (ImportError, OSError, RuntimeError) as error:
        raise CommandError(explain(error, read_manifest())) from error
    from tqdm import tqdm

    path = user_file() if arguments.output is None else parse_path("-o", arguments.output)
    with tqdm(
        total=1.0, desc="measuring", disable=None, leave=False, file=sys.stderr, bar_format="{l_bar}{bar}|"
    ) as bar:

        def advance(done: float) -> bool:
            bar.update(done - bar.n)
            return True

        measured = calibrate(advance)
    try:
        measured.save(path)
    except OSError as error:
        raise CommandError(f"cannot write {path} ({error.strerror})") from error
    lines = [
        f"a ray's visit of a node {measured.node_nanoseconds:.1f} ns, of a leaf {measured.leaf_nanoseconds:.1f} ns",
        f"refit {measured.refit_nanoseconds:.1f} ns per triangle; rotations add {measured.rotate_nanoseconds:.1f}, "
        f"rebuilding parts adds {measured.rebuild_parts_nanoseconds:.1f}",
    ]
    for name in BUILDERS:
        cost = measured.builders[name]
        lines.append(
            f"{name}: build {cost.build_nanoseconds:.0f} ns per triangle, trace {cost.trace_nanoseconds:.0f} ns per ray"
        )
    sys.stdout.write("\n".join([*lines, str(path)]) + "\n")
    sys.stdout.flush()  # a missing reader is noticed here
    return 0


# Info ----------------------------------------------------------------------------------------------------------------
# `perfect-bvh info`: the plan: each mesh of a scene with its class, its tree, and what they are expected to cost.


HEADER = (
    "mesh",
    "class",
    "builder",
    "made of",
    "users",
    "nodes",
    "depth",
    "SAH cost",
    "bytes",
    "build ms",
    "rays",
    "trace ms",
    "why this class",
)
LEFT_COLUMNS = frozenset({0, 1, 2, len(HEADER) - 1})


def run_info(arguments: argparse.Namespace) -> int:
    """Print the tables; the exit status."""
    path = check_blend_file(arguments.file)
    with quiet_blender() as out, stop_on_interrupt():
        scene = open_scene(path, arguments)
        from ..live.scene_view import SceneView, go_to_frame

        apply_settings(scene, arguments)
        if arguments.frame is not None:
            go_to_frame(scene, arguments.frame, arguments.viewport)
        view = SceneView("info", scene, active_view_layer(scene), for_viewport=arguments.viewport)
        try:
            _write(out, scene, *view.read(_bring_in_step))
        except ValueError as error:
            raise CommandError(str(error)) from error
    return 0


def _bring_in_step(moment: SceneMoment) -> tuple[SceneSync, RenderPlan, SyncReport]:
    """Builds the trees that a render of a scene needs."""
    from ..image.plan import plan_layer
    from ..image.still import bring_in_step
    from ..live.sync_cache import sync_of

    plan, sync = plan_layer(moment.depsgraph), sync_of(moment.depsgraph)
    return sync, plan, bring_in_step(sync, moment.depsgraph, plan, frame_set=moment.frame_set)


def _write(out: TextIO, scene: bpy.types.Scene, sync: SceneSync, plan: RenderPlan, report: SyncReport) -> None:
    statistics = sync.scene.statistics()
    rows = _mesh_rows(sync, report, statistics)
    out.write(f"{scene.name}, frame {scene.frame_current}\n")
    out.write(format_table(HEADER, rows, LEFT_COLUMNS) + "\n")
    top, made = statistics.top_level, statistics
    distinct = sum_of(made.triangle_count, made.segment_count, made.point_count)
    instanced = sum_of(made.instanced_triangle_count, made.instanced_segment_count, made.instanced_point_count)
    out.write(
        f"{len(statistics.meshes):,} meshes, {distinct}; {statistics.instance_count:,} instances show {instanced}; "
        f"top level {top.node_count:,} nodes, depth {top.depth}, {memory(top.byte_count)}; "
        f"all {memory(statistics.byte_count)}\n"
    )
    width, height = plan.size
    out.write(
        f"rays and trace ms: of one image of {width} x {height} pixels, mode {plan.mode.word}, "
        f"samples {plan.samples}, on one thread, as expected\n"
    )
    for warning in sync.warnings:
        out.write(f"warning: {warning}\n")


def _mesh_rows(sync: SceneSync, report: SyncReport, statistics: SceneStatistics) -> list[tuple[str, ...]]:
    """A line for each mesh, the most bytes first; at the end those of which nothing is built."""
    changes = {change.mesh_id: change for change in report.meshes}
    decisions = {row.mesh_id: row for row in report.commit.meshes}
    return [
        (
            changes[tree.mesh_id].name,
            changes[tree.mesh_id].usage,
            tree.builder,
            primitives(tree.primitive_count, tree.kind),
            f"{tree.user_count:,}",
            f"{tree.node_count:,}",
            str(tree.depth),
            f"{tree.sah:.1f}",
            memory(tree.byte_count),
            *_expected_costs(decisions.get(tree.mesh_id)),
            changes[tree.mesh_id].usage_reason,
        )
        for tree in sorted(statistics.meshes, key=lambda tree: -tree.byte_count)
    ] + [(mesh.name, "unseen", *[""] * (len(HEADER) - 3), mesh.reason) for mesh in report.unseen]


def _expected_costs(decision: MeshReport | None) -> tuple[str, str, str]:
    """Returns the costs of building, the number of rays that hit the mesh's box, and their costs in its commits."""
    if decision is None or decision.expected_rays is None:
        return "", "", ""
    chosen = [row for row in decision.alternatives if row.builder == decision.builder]
    if not chosen or chosen[0].trace_milliseconds is None:
        return "", f"{decision.expected_rays:,.0f}", ""
    return (
        f"{chosen[0].update_milliseconds:.1f}",
        f"{decision.expected_rays:,.0f}",
        f"{chosen[0].trace_milliseconds:.1f}",
    )


# Scan ----------------------------------------------------------------------------------------------------------------
# `perfect-bvh scan`: the measurements of a sensor over the frames of a file, in chunks that a second run recognises.


def run_scan(arguments: argparse.Namespace) -> int:
    """Scan as the arguments say; returns the exit status."""
    if arguments.list_sensors:
        _list_sensors()
        return 0
    for name in ("file", "output"):
        if getattr(arguments, name) is None:
            raise CommandError(f"expected {'FILE.blend' if name == 'file' else '-o DIR'}; see perfect-bvh scan --help")
    check_pieces(arguments)
    if arguments.steps is not None and arguments.frames is None:
        raise CommandError("--steps needs --frames: a whole sweep in the current frame has no further time samples")
    path = check_blend_file(arguments.file)
    asked = {"boxes": arguments.boxes, "category": arguments.category, "steps": arguments.steps or 1}
    check_format(f".{arguments.format}", arguments.labels, **asked)
    arguments.sensor = _sensor_name(arguments.sensor)
    arguments.file, arguments.output = (
        str(path),
        str(parse_folder(arguments.output)),
    )  # as workers, which are elsewhere, find them
    with quiet_blender() as out, stop_on_interrupt() as stop:
        return run_pieces(scan_work, open_scene(path, arguments), stop, arguments, out)


def scan_work(scene: bpy.types.Scene, _stop: StopRequest, arguments: argparse.Namespace) -> PieceWork:
    """The chunks of a scan."""
    from ..datasets.drive_work import scan_work as work_of
    from ..scanning.piece_scan import ScanPlan
    from ..settings.scan_choices import FORMATS

    plan = ScanPlan(
        sensor=_sensor(arguments.sensor),
        frames=arguments.frames or (scene.frame_current,),
        is_one_pass=arguments.frames is None,
        suffix=f".{arguments.format}",
        size=arguments.piece,
        steps=arguments.steps or 1,
        threads=arguments.threads or 0,
        seed=arguments.seed,
        labels=tuple(arguments.labels),
        boxes=arguments.boxes,
        category=arguments.category,
        exclude_mount=arguments.exclude_mount,
        for_viewport=arguments.viewport,
    )
    carrier = _carrier(scene, arguments.on)
    if FORMATS[plan.suffix].is_drive:
        apply_settings(scene, arguments)
    try:
        return work_of(plan, carrier, plan.folder(Path(arguments.output), plan.inputs(arguments, carrier)))
    except ValueError as error:
        raise CommandError(f"--frames: {error}") from error


def _list_sensors() -> None:
    from ..scanning.sensor_files import load_sensor, sensor_names

    width = max(map(len, sensor_names()))
    for name in sensor_names():
        sys.stdout.write(f"{name:<{width}}  {load_sensor(name).title}\n")


def _sensor_name(name: str) -> str:
    """Returns a name that is valid for all workers: for a sensor's own file its absolute path. Errors: CommandError."""
    _sensor(name)
    return str(Path(name).absolute()) if name.lower().endswith(".toml") else name


def _sensor(name: str) -> Sensor:
    from ..scanning.sensor_files import load_sensor

    try:
        return load_sensor(name)
    except OSError as error:
        raise CommandError(f"--sensor {name}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandError(f"--sensor {name}: {str(error).removeprefix('sensor: ')}") from error


def check_format(suffix: str, labels: list[str], **asked: Any) -> None:
    """Raises CommandError for a format that cannot be written, or not with this. asked: see `formats.check_format`."""
    from ..scanning import formats

    try:
        formats.check_format(suffix, labels, **asked)
    except (ValueError, ImportError) as error:
        raise CommandError(f"--format: {error}") from error


def _carrier(scene: bpy.types.Scene, name: str | None) -> bpy.types.Object | None:
    """The object that carries the sensor; None for the camera of each frame."""
    from ..scanning.outcomes import nearest

    if name is None:
        return None
    found = scene.objects.get(name)
    if found is None:
        near = nearest(name, scene.objects.keys())
        raise CommandError(f"--on {name}: scene {scene.name!r} has no such object{near}")
    return found
