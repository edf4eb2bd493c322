"""The lights and the world of an evaluated scene, for modes that show a scene under its own light."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from mathutils import Euler
from perfect_bvh.nodes import Operand, Output, ProgramTooLargeError

from ...sync.look_records import ImageRecord, LightRecords, WorldRecord
from ...sync.not_shown import NotShown
from ..visibility import VisibilityReader
from .images import ImageReader
from .node_graph import GROUPS, Omissions, Scope, find_output, trace_back
from .node_values import HALF, ValueReader
from .sky import read_sky
from .values import Value, constant, is_number

_KINDS = {"POINT": "point", "SUN": "sun", "SPOT": "spot"}
_DEEPEST = 64
_WORLD_RAYS = ("camera", "diffuse", "glossy", "transmission")
_LIGHT_RAYS = ("visible_diffuse", "visible_glossy", "visible_transmission")
LIGHT_LINKING, LIGHTS_ALL = "its light linking", "it lights everything"

Color = tuple[float, float, float]
BLACK: Color = (0.0, 0.0, 0.0)


def read_lights(
    depsgraph: Any, visibility: VisibilityReader, images: ImageReader, not_shown: list[NotShown], *, instanced: bool
) -> LightRecords:
    """Every light that shows and has a place as columns.

    instanced: whether Blender's list of instances may hold lights. not_shown: takes what of them is not.
    """
    listed = _list_lights(depsgraph, visibility, instanced)
    placed = [(obj, matrix) for obj, matrix in listed if np.isfinite(matrix).all()]
    noted: dict[NotShown, None] = {}
    rows = []
    for obj, matrix in placed:
        omissions = Omissions("light")
        _note_object(obj, omissions)
        rows.append(_read_light(obj.data, matrix, images, omissions))
        noted |= dict.fromkeys(omissions.rows(obj.data))
    not_shown += noted
    suns = _read_sky_sun(depsgraph.scene_eval.world, images)
    rows += suns
    if not rows:
        return LightRecords()
    kinds, positions, axes, powers, sizes, cones, shadows = zip(*rows, strict=True)
    return LightRecords(
        kinds=kinds,
        positions=np.array(positions, np.float64),
        axes=np.array(axes, np.float32),
        powers=np.array(powers, np.float32),
        sizes=np.array(sizes, np.float32),
        cones=np.array(cones, np.float32),
        casts_shadow=np.array(shadows, np.bool_),
        of_world=len(suns),
    )


def read_world(scene: Any, images: ImageReader, not_shown: list[NotShown]) -> WorldRecord:
    """The evaluated scene's world; a scene without one is dark. not_shown: takes what of it is not shown."""
    world = scene.world
    if world is None:
        return WorldRecord()
    omissions = Omissions("world")
    try:
        record = _read_world(world, images, omissions)
    except ProgramTooLargeError:
        omissions.note_too_large("its viewport color is used")
        red, green, blue = world.color
        record = WorldRecord((red, green, blue))
    not_shown += omissions.rows(world)
    return record


def _read_world(world: Any, images: ImageReader, omissions: Omissions) -> WorldRecord:
    red, green, blue = world.color
    plain = WorldRecord((red, green, blue))
    tree = world.node_tree if world.use_nodes else None
    if tree is None:
        return plain
    found = find_output(tree)
    if found is None:
        omissions.note_no_output("black is used")
        return WorldRecord()
    surface, scope = found[0].inputs["Surface"], found[1]
    _note_world(world, *found, omissions)
    sky = _find_sky(world, images, omissions)
    if sky is not None:
        node, strength = sky
        shown, rotation = read_sky(node)
        images.records.append(ImageRecord(node.name, 0, shown.pixels, "sky"))
        return WorldRecord((strength,) * 3, len(images.records) - 1, rotation)
    lit, seen = (ValueReader(images, constant(*plain.color), omissions, is_camera) for is_camera in (False, True))
    record = _record(_follow_shader(surface, scope, lit, 0), lit, images)
    if not lit.was_asked_for_rays:
        return record
    return replace(record, backdrop=_record(_follow_shader(surface, scope, seen, 0), seen, images))


def _note_world(world: Any, output: Any, scope: Scope | None, omissions: Omissions) -> None:
    """output: the node of the world's tree that Cycles looks at."""
    volume, _ = trace_back(output.inputs["Volume"], scope)
    if volume.is_output:
        omissions.note_node(volume.node, instead="clear air is used")
    visibility = getattr(world, "cycles_visibility", None)
    if visibility is not None and not all(getattr(visibility, name, True) for name in _WORLD_RAYS):
        omissions.note("its ray visibility", "all rays see it")


def _find_sky(world: Any, images: ImageReader, omissions: Omissions | None = None) -> tuple[Any, float] | None:
    """The Sky Texture node that a world's background shows, and how brightly; None if it shows anything else."""
    tree = world.node_tree if world is not None and world.use_nodes else None
    found = None if tree is None else find_output(tree)
    source, scope = (None, None) if found is None else trace_back(found[0].inputs["Surface"], found[1])
    if source is None or not source.is_output or source.node.type != "BACKGROUND":
        return None
    color, _ = trace_back(source.node.inputs["Color"], scope)
    if not color.is_output or color.node.type != "TEX_SKY":
        return None
    strength = ValueReader(images, constant(1.0), omissions).even_number(source.node.inputs["Strength"], 1.0, scope)
    return color.node, max(strength, 0.0)


def _read_sky_sun(world: Any, images: ImageReader) -> list[tuple[Any, ...]]:
    """A row as of a light for the sun of a sky, if it shows one."""
    try:
        sky = _find_sky(world, images)
    except ProgramTooLargeError:  # which is named with the world
        sky = None
    if sky is None:
        return []
    shown, rotation = read_sky(sky[0])
    if shown.sun is None:
        return []
    turn = Euler((math.pi / 2.0 - shown.sun.elevation, 0.0, math.pi - rotation)).to_matrix()
    axes, nowhere = np.array(turn, np.float32).T, np.zeros(3)
    return [("sun", nowhere, axes, _times(shown.sun.irradiance, sky[1]), (shown.sun.angle, 0.0), (math.pi, 0.0), True)]


def _follow_shader(socket: Any, scope: Scope | None, reader: ValueReader, depth: int) -> Value:
    """Read the radiance of a world's shader socket, or the factor of a light's."""
    output, source_scope = trace_back(socket, scope, reader.omissions.note_foreign)
    if not output.is_output or output.node.type in GROUPS or depth > _DEEPEST:  # an empty group
        return constant(0.0, 0.0, 0.0)
    if output.type != "SHADER":
        return reader.read(socket, scope)
    node, scope = output.node, source_scope
    if node.type in {"BACKGROUND", "EMISSION"}:
        color = reader.read(node.inputs["Color"], scope)
        strength = reader.read_or(constant(1.0), "Strength 1 is used", node.inputs["Strength"], scope)
        return Value(reader.nodes.times(color.operand, strength.operand))
    if node.type in {"MIX_SHADER", "ADD_SHADER"}:
        shaders = [socket for socket in node.inputs if socket.type == "SHADER"]
        if node.type == "ADD_SHADER":
            both = [_follow_shader(socket, scope, reader, depth + 1).operand for socket in shaders]
            return Value(reader.nodes.plus(*both))
        factor = reader.nodes.clamp(reader.read_or(constant(0.5), HALF, node.inputs[0], scope).operand)
        for side in (0, 1):
            if is_number(factor, float(side)):
                return _follow_shader(shaders[side], scope, reader, depth + 1)
        first, second = (_follow_shader(socket, scope, reader, depth + 1).operand for socket in shaders)
        return Value(reader.nodes.mix(factor, first, second))
    if node.type.startswith("BSDF"):
        return constant(0.0, 0.0, 0.0)  # in Cycles, too
    reader.omissions.note_node(node)
    return reader.fallback


def _record(value: Value, reader: ValueReader, images: ImageReader) -> WorldRecord:
    """Return the world as a colour, as its one image, or as an image of its nodes' values in each direction."""
    if value.is_even:
        red, green, blue = (max(channel, 0.0) for channel in reader.overall(value))
        return WorldRecord((red, green, blue))
    found = _match_image(value.operand, reader)
    if found is not None:
        row, color, rotation = found
        return WorldRecord(color, row, rotation)
    operand = value.operand

    def show() -> npt.NDArray[np.float32]:
        assert isinstance(operand, Output)
        values = reader.nodes.evaluate(operand, images.arguments(), [_directions()], _WIDTH * _HEIGHT)
        pixels = np.ones((_HEIGHT, _WIDTH, 4), np.float32)
        pixels[..., :3] = values.reshape(_HEIGHT, _WIDTH, -1)[..., :3]
        np.nan_to_num(pixels, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
        return np.maximum(pixels, 0.0)

    pixels = images.around(reader.nodes.program(EMISSION=operand), show)
    images.records.append(ImageRecord("World", 0, pixels, "repeat"))
    return WorldRecord((1.0, 1.0, 1.0), len(images.records) - 1)


# The size of the image of the colours that nodes show around a scene.
_WIDTH, _HEIGHT = 2048, 1024


def _directions() -> npt.NDArray[np.float32]:
    """(H * W, 4): where the middles of an equirectangular image's pixels lie."""
    around = np.pi * (1.0 - 2.0 * (np.arange(_WIDTH) + 0.5) / _WIDTH)
    above = np.pi * ((np.arange(_HEIGHT) + 0.5) / _HEIGHT - 0.5)
    ways = np.zeros((_HEIGHT, _WIDTH, 4), np.float32)
    ways[..., 0] = np.cos(above)[:, None] * np.cos(around)
    ways[..., 1] = np.cos(above)[:, None] * np.sin(around)
    ways[..., 2] = np.sin(above)[:, None]
    return ways.reshape(-1, 4)


def _match_image(operand: Operand, reader: ValueReader) -> tuple[int, Color, float] | None:
    """The row, the colour that multiplies it, and the turn about the vertical of an equirectangular image alone."""
    color: Color = (1.0, 1.0, 1.0)
    instruction = reader.nodes.instruction(operand)
    if instruction is not None and instruction.kind == "vector_math" and instruction.mode == "MULTIPLY":
        image, factor = instruction.operands[:2]
        if isinstance(factor, Output) or isinstance(image, float):
            return None
        color = tuple(factor) if isinstance(factor, tuple) else (factor,) * 3  # type: ignore[assignment]
        operand, instruction = image, reader.nodes.instruction(image)
    if instruction is None or instruction.kind != "image" or instruction.mode != "EQUIRECTANGULAR":
        return None
    if operand[1:] != (0, 3) or min(color) < 0.0:  # type: ignore[index]
        return None
    way = instruction.operands[0]
    turn = reader.nodes.instruction(way)
    if way == reader.way().operand:
        return int(instruction.numbers[0]), color, 0.0
    if turn is None or turn.kind != "mapping" or turn.mode not in {"POINT", "VECTOR", "TEXTURE"}:
        return None
    vector, place, angles, scale = turn.operands
    if vector != reader.way().operand or not is_number(place, 0.0) or not is_number(scale, 1.0):
        return None
    if not isinstance(angles, tuple) or angles[0] or angles[1]:
        return None
    return int(instruction.numbers[0]), color, -angles[2] if turn.mode == "TEXTURE" else angles[2]


def _list_lights(
    depsgraph: Any, visibility: VisibilityReader, instanced: bool
) -> Iterator[tuple[Any, npt.NDArray[np.float64]]]:
    """Lights' objects with their matrices."""
    for obj in depsgraph.objects:
        if obj.type == "LIGHT" and not visibility.is_hidden(obj, None):
            yield obj, np.array(obj.matrix_world, np.float64)
    if not instanced:
        return
    for instance in depsgraph.object_instances:
        if not instance.is_instance or instance.object.type != "LIGHT":
            continue
        if not visibility.is_hidden(instance.object, instance.parent):
            yield instance.object, np.array(instance.matrix_world, np.float64)


def lights_few(obj: Any) -> bool:
    """Whether light linking says of an object that shines that it lights some objects alone, or some block it."""
    linking = obj.light_linking
    return linking is not None and bool(linking.receiver_collection or linking.blocker_collection)


def _note_object(obj: Any, omissions: Omissions) -> None:
    """Note an object's settings about which objects a light lights."""
    if lights_few(obj):
        omissions.note(LIGHT_LINKING, LIGHTS_ALL)
    if not all(getattr(obj, name) for name in _LIGHT_RAYS):
        omissions.note("its ray visibility", LIGHTS_ALL)
    settings = getattr(obj.data, "cycles", None)
    if settings is not None and getattr(settings, "is_portal", False) and obj.data.type == "AREA":
        omissions.note("Portal", "a lamp is used")


def _read_light(
    light: Any, matrix: npt.NDArray[np.float64], images: ImageReader, omissions: Omissions
) -> tuple[Any, ...]:
    """A row of the columns of `LightRecords`."""
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = (matrix[:3, :3] / np.where(lengths > 0.0, lengths, 1.0)).T
    kind, cone = _KINDS.get(light.type, ""), (math.pi, 0.0)
    if kind == "sun":
        size = (light.angle, 0.0)
        area = math.pi * math.sin(0.5 * min(light.angle, 3.0)) ** 2
    elif kind:
        size = (light.shadow_soft_size, 0.0)
        area = 4.0 * math.pi * light.shadow_soft_size**2
        cone = (light.spot_size, light.spot_blend) if kind == "spot" else cone
    else:
        kind = "ellipse" if light.shape in {"DISK", "ELLIPSE"} else "rectangle"
        height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
        size = (light.size * lengths[0], height * lengths[1])
        area = size[0] * size[1] * (math.pi / 4.0 if kind == "ellipse" else 1.0)
        cone = (light.spread, 0.0)
    power = _power_of(light, images, omissions)
    if not getattr(light, "normalize", True) and area > 0.0:  # its strength is that of each square metre
        power = _times(power, area)
    return kind, matrix[:3, 3], axes, power, size, cone, light.use_shadow


def _power_of(light: Any, images: ImageReader, omissions: Omissions) -> Color:
    """Read watts of each channel: energy, exposure, colour, temperature, and the light's own emission node."""
    power = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    color = _times(tuple(light.color), power)
    if getattr(light, "use_temperature", False):
        color = _by(color, tuple(light.temperature_color))
    if not light.use_nodes or light.node_tree is None:
        return color
    found = find_output(light.node_tree)
    if found is None:
        omissions.note_no_output("no light is emitted")
        return BLACK
    reader = ValueReader(images, constant(1.0, 1.0, 1.0), omissions)
    try:
        shade = reader.overall(_follow_shader(found[0].inputs["Surface"], found[1], reader, 0))
    except ProgramTooLargeError:
        omissions.note_too_large("its color is used")
        return color
    return _by(color, shade)


def _times(color: Any, factor: float) -> Color:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _by(color: Color, other: Any) -> Color:
    return (color[0] * other[0], color[1] * other[1], color[2] * other[2])
