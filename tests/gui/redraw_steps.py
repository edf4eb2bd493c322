"""How often 3D viewports are drawn while a user works, beside Cycles and Solid, and how long Blender stands still.

The figures are printed by the last step. No step fails because of a time: what must be drawn is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from addon_state import events, finished, is_playing, measured, module, settings, space, viewports
from driver import Step, check, redrawn, screenshot, wait_until
from hands import hover, press_key, x_tool
from mathutils import Matrix
from places import area_of, context_of, middle_of

# What is compared: a name, the shading, the engine.
VIEWS = (
    ("Solid", "SOLID", "PERFECT_BVH"),
    ("Cycles", "RENDERED", "CYCLES"),
    ("Perfect BVH", "RENDERED", "PERFECT_BVH"),
)
STALL = 0.5  # seconds
SIDE = 317  # of the square of instances: 100,489


class Watch:
    """Counts redraws of 3D viewports, and finds how long Blender answers to nothing."""

    def __init__(self) -> None:
        self.draws = 0
        self.gaps: list[float] = []
        self._last = self._started = time.monotonic()

    def note_draw(self) -> None:
        """A viewport is drawn."""
        self.draws += 1

    def tick(self) -> float:
        """Blender answers."""
        now = time.monotonic()
        self.gaps.append(now - self._last)
        self._last = now
        return 0.01

    def report(self, what: str) -> None:
        """Note the figures of `what`."""
        seconds = time.monotonic() - self._started
        measured[f"{what}: redraws per second"] = self.draws / seconds
        measured[f"{what}: longest stall, ms"] = 1e3 * max(self.gaps, default=seconds)
        measured[f"{what}: stalls over {STALL} s"] = sum(gap > STALL for gap in self.gaps)


@contextmanager
def watched(what: str) -> Iterator[Watch]:
    """Watch while it is active, and note the figures."""
    watch = Watch()
    tick = watch.tick  # each access makes another object, and Blender compares them
    handle = bpy.types.SpaceView3D.draw_handler_add(watch.note_draw, (), "WINDOW", "POST_PIXEL")
    bpy.app.timers.register(tick, first_interval=0.0)
    try:
        yield watch
        watch.report(what)
    finally:
        bpy.app.timers.unregister(tick)
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")


def in_each_view(work: Callable[[str], Step]) -> Step:
    """Do something in each of VIEWS, once its first image is there."""
    samples, settings().samples = settings().samples, 16
    for name, shading, engine in VIEWS:
        space().shading.type = "SOLID"
        bpy.context.scene.render.engine = engine
        space().shading.type = shading
        yield from redrawn()
        if engine == "PERFECT_BVH" and shading == "RENDERED":
            yield from wait_until(lambda: viewports() and viewports()[0]._refinement.sample_count, "no image")
        else:
            yield 3.0
        yield from work(name)
    settings().samples = samples
    yield from finished("the last view")


def sculpt() -> Step:
    """A stroke over a sphere of 82,000 triangles."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=7, radius=3.0, location=(0.0, 0.0, 3.0))
    made = bpy.context.object
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.view3d.view_selected()
        bpy.ops.object.mode_set(mode="SCULPT")
    x, y = middle_of(area_of("VIEW_3D"))

    def stroke(name: str) -> Step:
        before = positions(made)
        hover(x - 100, y)
        yield 0.2
        with watched(f"sculpting, {name}") as watch:
            x_tool("mousedown", 1)
            for step in range(150):
                yield 0.02
                hover(x - 100 + 200 * abs(step % 60 - 30) / 30, y + step / 3)
            x_tool("mouseup", 1)
            yield 0.1
        check(np.any(positions(made) != before), f"{name}: the stroke moves nothing")
        check(watch.draws > 1, f"{name}: a stroke is not drawn")
        screenshot(f"sculpted_{name}")

    yield from in_each_view(stroke)
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.object.mode_set(mode="OBJECT")
    bpy.data.objects.remove(made)
    yield from finished("the sphere is gone")


def positions(obj: bpy.types.Object) -> np.ndarray:
    """(V, 3) of its mesh."""
    found = np.empty(3 * len(obj.data.vertices), np.float32)
    obj.data.vertices.foreach_get("co", found)
    return found.reshape(-1, 3)


def play_beside_cycles() -> Step:
    """The tree in the wind: each frame is drawn."""

    def play(name: str) -> Step:
        hover(*middle_of(area_of("VIEW_3D")))
        events.clear()
        count = lambda: events.count("frame_change_post")  # noqa: E731
        with watched(f"playing, {name}") as watch:
            yield from press_key("space")
            yield 5.0
            yield from wait_until(lambda: count() >= 4, f"{name}: the animation stands still")
            measured[f"playing, {name}: frames"] = count()
            yield from press_key("space")
        yield from wait_until(lambda: not is_playing(), "the animation still plays")
        check(watch.draws >= count() - 2, f"{name}: {count()} frames, but {watch.draws} redraws")
        bpy.context.scene.frame_set(1)
        yield from redrawn()

    yield from in_each_view(play)


def switch_with_100000_instances() -> Step:
    """From Wireframe to each view, until there is something to see; then the view is turned."""
    obj = add_instances()
    samples, settings().samples = settings().samples, 1
    space().shading.type = "WIREFRAME"
    yield from redrawn()
    for name, shading, engine in VIEWS:
        space().shading.type = "WIREFRAME"
        bpy.context.scene.render.engine = engine
        yield from redrawn()
        yield 1.0
        started = time.monotonic()
        with watched(f"100,489 instances, {name}") as watch:
            space().shading.type = shading
            yield from wait_until(lambda watch=watch: watch.draws > 0, f"{name} is not drawn")
            measured[f"100,489 instances, {name}: first redraw, ms"] = 1e3 * (time.monotonic() - started)
            if name == "Perfect BVH":
                has_image = lambda: viewports() and viewports()[0]._screen.patches  # noqa: E731
                yield from wait_until(has_image, "no image of the instances")
                measured[f"100,489 instances, {name}: first image, ms"] = 1e3 * (time.monotonic() - started)
            screenshot(f"instances_{name}")
            yield 2.0
    yield from finished("instances")
    check(viewports()[0]._refinement.view.snapshot is not None, "there is no scene")
    settings().samples = samples
    bpy.data.objects.remove(obj)
    yield from finished("no instances")


def add_instances() -> bpy.types.Object:
    """A square of cubes on the points of a grid."""
    tree = bpy.data.node_groups.new("Cubes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    make = tree.nodes.new
    grid, cube, instances = (make(f"GeometryNode{kind}") for kind in ("MeshGrid", "MeshCube", "InstanceOnPoints"))
    for name, value in (("Vertices X", SIDE), ("Vertices Y", SIDE), ("Size X", 20.0), ("Size Y", 20.0)):
        grid.inputs[name].default_value = value
    cube.inputs["Size"].default_value = (0.03, 0.03, 0.2)
    link = tree.links.new
    link(grid.outputs["Mesh"], instances.inputs["Points"])
    link(cube.outputs["Mesh"], instances.inputs["Instance"])
    link(instances.outputs["Instances"], make("NodeGroupOutput").inputs["Geometry"])
    made = bpy.data.objects.new("Cubes", bpy.data.meshes.new("Cubes"))
    bpy.context.collection.objects.link(made)
    made.modifiers.new("Cubes", "NODES").node_group = tree
    return made


class _Engine:
    """The part of a render engine that drawing asks for."""

    def bind_display_space_shader(self, _: object) -> None:
        """Nothing: colors stay."""

    def unbind_display_space_shader(self) -> None:
        """Nothing either."""


def draw_crisp_pixels() -> Step:
    """A coarse image is drawn as squares of one color each, and a full one as it is."""
    import gpu

    screen, progressive = module("view3d.rendered.screen"), module("image.progressive")
    random = np.random.default_rng(3)
    coarse = np.ones((8, 16, 4), np.float32)
    coarse[..., :3] = random.random((8, 16, 3)).astype(np.float16)
    canvas = progressive.Canvas((128, 64))
    canvas.put_coarse(coarse, 8, (0, 64), True)
    shown = screen.ScreenImage()
    offscreen = gpu.types.GPUOffScreen(128, 64, format="RGBA16F")
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))), offscreen.bind():
        gpu.matrix.load_matrix(Matrix())
        gpu.matrix.load_projection_matrix(Matrix(((2 / 128, 0, 0, -1), (0, 2 / 64, 0, -1), (0, 0, 1, 0), (0, 0, 0, 1))))
        shown.fetch(canvas, "clay")
        screen.draw_patches(_Engine(), bpy.context.scene, shown, (128, 64))
        made = gpu.state.active_framebuffer_get().read_color(0, 0, 128, 64, 4, 0, "FLOAT")
    offscreen.free()
    pixels = np.array(made.to_list(), np.float32).reshape(64, 128, 4)[::-1]
    difference = abs(pixels - np.kron(coarse, np.ones((8, 8, 1), np.float32))).max()
    check(difference < 1e-3, f"the pixels of a coarse image are blurred: {difference}")
    yield 0.01
