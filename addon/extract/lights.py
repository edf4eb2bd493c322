"""The lights and the world of an evaluated scene, for modes that show a scene under its own light."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ..sync.records import LightRecords, WorldRecord
from .images import ImageReader
from .node_colors import Color, ColorSource, read_color
from .visibility import VisibilityReader

_KINDS = {"POINT": "point", "SUN": "sun", "SPOT": "spot"}
_SKY: Color = (0.3, 0.45, 0.7)  # stands for what a sky texture works out


def read_lights(depsgraph: Any, visibility: VisibilityReader) -> LightRecords:
    """Every light that shows and has a place, instanced ones included, as columns."""
    rows = [
        _read_light(light, matrix) for light, matrix in _list_lights(depsgraph, visibility) if np.isfinite(matrix).all()
    ]
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
    )


def read_world(scene: Any, images: ImageReader) -> WorldRecord:
    """The evaluated scene's world; a scene without one is dark."""
    world = scene.world
    if world is None:
        return WorldRecord()
    red, green, blue = world.color
    plain = WorldRecord((red, green, blue))
    tree = world.node_tree if world.use_nodes else None
    output = None if tree is None else tree.get_output_node("CYCLES")
    if output is None:
        return plain if tree is None else WorldRecord()
    links = output.inputs["Surface"].links
    node = links[0].from_node if links else None
    if node is None:
        return WorldRecord()
    if node.type not in {"BACKGROUND", "EMISSION"}:
        return plain
    strength = 1.0 if node.inputs["Strength"].is_linked else node.inputs["Strength"].default_value
    source = read_color(node.inputs["Color"], ColorSource(_SKY if _has_sky(node) else plain.color))
    if source.image_node is None:
        return WorldRecord(_times(source.color, strength))
    return WorldRecord((strength,) * 3, images.row(source.image_node), _rotation_of(source.image_node))


def _list_lights(depsgraph: Any, visibility: VisibilityReader) -> Iterator[tuple[Any, npt.NDArray[np.float64]]]:
    """Light datablocks with their matrices. Blender's list of instances is walked only where it may hold lights."""
    holds_instances = False
    for obj in depsgraph.objects:
        if obj.type == "LIGHT":
            if not visibility.is_hidden(obj, None):
                yield obj.data, np.array(obj.matrix_world, np.float64)
        elif obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            holds_instances |= any(member.type == "LIGHT" for member in obj.instance_collection.all_objects)
    if not holds_instances:
        return
    for instance in depsgraph.object_instances:
        if not instance.is_instance or instance.object.type != "LIGHT":
            continue
        if not visibility.is_hidden(instance.object, instance.parent):
            yield instance.object.data, np.array(instance.matrix_world, np.float64)


def _read_light(light: Any, matrix: npt.NDArray[np.float64]) -> tuple[Any, ...]:
    """A row of the columns of `LightRecords`."""
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = (matrix[:3, :3] / np.where(lengths > 0.0, lengths, 1.0)).T
    kind, cone = _KINDS.get(light.type, ""), (math.pi, 0.0)
    if kind == "sun":
        size = (light.angle, 0.0)
    elif kind:
        size = (light.shadow_soft_size, 0.0)
        cone = (light.spot_size, light.spot_blend) if kind == "spot" else cone
    else:
        kind = "ellipse" if light.shape in {"DISK", "ELLIPSE"} else "rectangle"
        height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
        size = (light.size * lengths[0], height * lengths[1])
    return kind, matrix[:3, 3], axes, _power_of(light), size, cone, light.use_shadow


def _power_of(light: Any) -> Color:
    """Watts of each channel: energy, exposure, colour, temperature, and what the light's own emission node says."""
    power = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    color = _times(tuple(light.color), power)
    if getattr(light, "use_temperature", False):
        color = _by(color, tuple(light.temperature_color))
    tree = light.node_tree if light.use_nodes else None
    node = None if tree is None else next((node for node in tree.nodes if node.type == "EMISSION"), None)
    if node is None:
        return color
    strength = 1.0 if node.inputs["Strength"].is_linked else node.inputs["Strength"].default_value
    return _times(_by(color, read_color(node.inputs["Color"], ColorSource((1.0, 1.0, 1.0))).color), strength)


def _has_sky(node: Any) -> bool:
    links = node.inputs["Color"].links
    return bool(links) and links[0].from_node.type == "TEX_SKY"


def _rotation_of(image_node: Any) -> float:
    """About z, of a mapping node before the image; 0 without one."""
    links = image_node.inputs["Vector"].links
    node = links[0].from_node if links else None
    if node is None or node.type != "MAPPING" or node.inputs["Rotation"].is_linked:
        return 0.0
    return float(node.inputs["Rotation"].default_value[2])


def _times(color: Any, factor: float) -> Color:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _by(color: Color, other: Any) -> Color:
    return (color[0] * other[0], color[1] * other[1], color[2] * other[2])
