"""Checks of the renderer's arguments, and their conversion for the native module.

Every message names the function, the argument, the expected value and the given one.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._checks import check_choice, check_column, check_count, check_id, check_kind, check_number
from .appearance import (
    LIGHT_KINDS,
    Appearance,
    HairTable,
    ImageTexture,
    InstanceTable,
    LightTable,
    MeshAppearance,
    World,
)
from .finishes import finish_arguments
from .nodes import NodeProgram

_LARGEST_SIZE = 65536
_MATERIAL_NUMBERS = (
    *("alphas", "metallics", "roughnesses", "lossy_facets", "reflectances", "transmissions", "translucencies", "iors"),
    *("even_metals", "tinted_glasses", "plain_refractions"),
    *("metal_powers", "transmission_powers", "translucent_powers", "holdouts"),
)
_MATERIAL_COLORS = (
    *("base_colors", "emissions", "specular_tints"),
    *("metal_colors", "transmission_colors", "translucent_colors"),
)
_LARGEST_MASK = 2**32 - 1
_FIRST_TILE, _LAST_TILE = 1001, 2000


def check_size(function: str, size: object) -> tuple[int, int]:
    """(width, height) in pixels."""
    if not isinstance(size, Sequence) or isinstance(size, str) or len(size) != 2:
        raise ValueError(f"{function}: size must be (width, height) in pixels, got {size!r}")
    width, height = (check_count(function, "size", number, 1, _LARGEST_SIZE) for number in size)
    return width, height


def check_tiles(
    function: str, tiles: npt.ArrayLike | None, size: tuple[int, int], tile_size: int
) -> npt.NDArray[np.bool_] | None:
    """Which tiles of a picture of size (width, height) are rendered; None for all."""
    if tiles is None:
        return None
    array = np.ascontiguousarray(tiles)
    expected = tuple(-(-pixels // tile_size) for pixels in reversed(size))
    if array.shape != expected or array.dtype != np.bool_:
        raise ValueError(f"{function}: tiles must be bool of shape {expected}, got {array.dtype} of {array.shape}")
    return array


def check_color(function: str, name: str, color: object) -> tuple[float, float, float]:
    """(R, G, B), scene-linear."""
    values = np.asarray(color, dtype=np.float64) if isinstance(color, (Sequence, np.ndarray)) else np.empty(0)
    if values.shape != (3,) or not np.isfinite(values).all() or bool((values < 0.0).any()):
        raise ValueError(f"{function}: {name} must be three numbers (R, G, B) of 0 or more, got {color!r}")
    return float(values[0]), float(values[1]), float(values[2])


def appearance_arguments(function: str, appearance: Appearance) -> dict[str, Any]:
    """An appearance's arrays, C-contiguous and of the dtypes that its records promise."""
    check_kind(function, "appearance", appearance, Appearance)
    table, materials = appearance.instances, appearance.materials
    programs = _programs(function, materials.programs)
    layers = {kind: _numbers([*programs], kind) for kind in ("uvs", "colors", "tangents")}

    def column(name: str, value: npt.ArrayLike, dtype: type[np.generic], *row: int) -> npt.NDArray[Any]:
        return check_column(function, f"appearance.{name}", value, dtype, row)

    def optional(name: str, dtype: type[np.generic], *row: int) -> npt.NDArray[Any]:
        value = getattr(materials, name)
        return np.empty((0, *row), dtype) if value is None else column(f"materials.{name}", value, dtype, *row)

    return {
        **{name: optional(name, np.float32, 3) for name in _MATERIAL_COLORS},
        **{name: optional(name, np.float32) for name in _MATERIAL_NUMBERS},
        "programs": [_program_arguments(program, layers) for program in programs],
        "material_programs": np.array(
            [-1 if program is None else programs[program] for program in materials.programs or ()], np.int32
        ),
        **_instance_values(function, table),
        "hairs": optional("hairs", np.int32),
        "hair": _hair_arguments(function, appearance.hair),
        "finishes": optional("finishes", np.int32),
        "finish": finish_arguments(function, appearance.finish),
        "images": [_image_arguments(function, row, image) for row, image in enumerate(appearance.images)],
        "lights": _light_arguments(function, appearance.lights),
        "world": _world_arguments(function, "world", appearance.world),
        "backdrop": _world_arguments(function, "backdrop", appearance.backdrop),
        "bright_sky": None,
        "material_colors": column("materials.colors", materials.colors, np.float32, 4),
        "material_indices": column("materials.indices", materials.indices, np.int32),
        "instance_ids": column("instances.ids", table.ids, np.int32),
        "slot_offsets": column("instances.slot_offsets", table.slot_offsets, np.int32),
        "slot_materials": column("instances.slot_materials", table.slot_materials, np.int32),
        "object_indices": column("instances.object_indices", table.object_indices, np.int32),
        "holdout": column("instances.holdout", table.holdout, np.bool_),
        **{
            name: check_count(function, f"appearance.{name}", getattr(appearance, name), 0, _LARGEST_MASK)
            for name in (
                "camera_mask",
                "shadow_mask",
                "diffuse_mask",
                "glossy_mask",
                "transmission_mask",
                "catcher_mask",
            )
        },
        "film_transparent": bool(appearance.film_transparent),
        **{
            name: check_number(function, f"appearance.{name}", getattr(appearance, name), 0.0, 1.0)
            for name in ("plain_reflectance", "pass_alpha_threshold")
        },
        "meshes": {
            check_id(function, "appearance.meshes' keys", mesh): _mesh_arrays(function, mesh, value, layers)
            for mesh, value in appearance.meshes.items()
        },
    }


def _programs(function: str, programs: Sequence[NodeProgram | None] | None) -> dict[NodeProgram, int]:
    """Each program that there is, with its row."""
    found: dict[NodeProgram, int] = {}
    for row, program in enumerate(programs or ()):
        if program is not None:
            check_kind(function, f"appearance.materials.programs[{row}]", program, NodeProgram)
            found.setdefault(program, len(found))
    return found


def _numbers(programs: Sequence[NodeProgram], kind: str) -> dict[str, int]:
    """Numbers a mesh's layers: 0 for the one without a name, the others in alphabetical order."""
    names = {name for program in programs for name in program.layer_names(kind)}
    return {name: number for number, name in enumerate(["", *sorted(names - {""})])}


def _program_arguments(program: NodeProgram, layers: Mapping[str, Mapping[str, int]]) -> dict[str, Any]:
    numbers = program.numbers.copy()
    for place, kind, name in program.layers:
        numbers[place] = layers[kind][name]
    return {"codes": program.codes, "numbers": numbers}


def _instance_values(function: str, table: InstanceTable) -> dict[str, Any]:
    values = np.empty((len(table.ids), 0, 4), np.float32) if table.values is None else np.asarray(table.values)
    if values.ndim != 3 or values.shape[::2] != (len(table.ids), 4):
        raise ValueError(
            f"{function}: appearance.instances.values must have shape ({len(table.ids)}, K, 4), got {values.shape}"
        )
    return {
        "instance_value_count": values.shape[1],
        "instance_values": np.ascontiguousarray(values, np.float32).reshape(-1),
    }


def _image_arguments(function: str, row: int, image: ImageTexture) -> dict[str, Any]:
    name = f"appearance.images[{row}]"
    extension = check_choice(
        function, f"{name}.extension", image.extension, ("repeat", "extend", "clip", "mirror", "sky")
    )
    return {
        "pixels": _pixels(function, f"{name}.pixels", image.pixels),
        "extension": extension,
        "interpolation": check_choice(function, f"{name}.interpolation", image.interpolation, ("linear", "closest")),
        "tiles": [_tile_arguments(function, f"{name}.tiles", number, image.tiles[number]) for number in image.tiles],
        "is_linear": bool(image.is_linear),
    }


def _tile_arguments(function: str, name: str, number: int, pixels: npt.ArrayLike) -> dict[str, Any]:
    square = check_count(function, f"a key of {name}", number, _FIRST_TILE, _LAST_TILE) - _FIRST_TILE
    return {"square": square, "pixels": _pixels(function, f"{name}[{number}]", pixels)}


def _pixels(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    pixels = np.asarray(value)
    if pixels.ndim != 3 or pixels.shape[2] != 4 or max(pixels.shape[:2]) > _LARGEST_SIZE:
        raise ValueError(
            f"{function}: {name} must have shape (H, W, 4), at most {_LARGEST_SIZE} each way, got {pixels.shape}"
        )
    if pixels.dtype not in (np.uint8, np.float32):
        raise ValueError(f"{function}: {name} must be uint8 (sRGB) or float32 (linear), got {pixels.dtype}")
    return np.ascontiguousarray(pixels)


def _table_columns(
    function: str, name: str, table: object, columns: Mapping[str, tuple[type[np.generic], tuple[int, ...]]]
) -> dict[str, npt.NDArray[Any]]:
    """Finite columns with a row each for each row of the first."""
    arrays: dict[str, npt.NDArray[Any]] = {}
    first = next(iter(columns))
    for column, (dtype, row) in columns.items():
        place = f"appearance.{name}.{column}"
        array = arrays[column] = check_column(function, place, getattr(table, column), dtype, row)
        if len(array) != len(arrays[first]):
            raise ValueError(
                f"{function}: {place} must have a row for each of the {len(arrays[first])} {first}, got {len(array)}"
            )
        if not np.isfinite(array).all():
            raise ValueError(f"{function}: {place} must be finite, got {array[~np.isfinite(array)][0]}")
    return arrays


def _light_arguments(function: str, lights: LightTable) -> dict[str, npt.NDArray[Any]]:
    columns: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
        "kinds": (np.int32, ()),
        "positions": (np.float64, (3,)),
        "axes": (np.float32, (3, 3)),
        "powers": (np.float32, (3,)),
        "sizes": (np.float32, (2,)),
        "cones": (np.float32, (2,)),
        "casts_shadow": (np.bool_, ()),
    }
    arrays = _table_columns(function, "lights", lights, columns)
    kinds = arrays["kinds"]
    unknown = (kinds < 0) | (kinds >= len(LIGHT_KINDS))
    if unknown.any():
        raise ValueError(
            f"{function}: appearance.lights.kinds must be 0 to {len(LIGHT_KINDS) - 1} ({', '.join(LIGHT_KINDS)}), "
            f"got {kinds[unknown][0]}"
        )
    suns = kinds == LIGHT_KINDS.index("sun")
    if suns.any():  # the engine takes the disk that the sun shows, one unit away
        sizes = arrays["sizes"] = arrays["sizes"].copy()
        sizes[suns, 0] = np.tan(0.5 * np.clip(sizes[suns, 0], 0.0, 3.0))
    return arrays


_HAIR_COLUMNS: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
    **dict.fromkeys(("surfaces", "fibers", "coats", "tilts", "iors"), (np.float32, ())),
    "colored": (np.bool_, ()),
    "roughnesses": (np.float32, (2,)),
    "absorptions": (np.float32, (3,)),
}


def _hair_arguments(function: str, hair: HairTable) -> dict[str, npt.NDArray[Any]]:
    arrays = _table_columns(function, "hair", hair, _HAIR_COLUMNS)
    for name in ("surfaces", "fibers", "absorptions"):
        if (arrays[name] < 0.0).any():
            raise ValueError(f"{function}: appearance.hair.{name} must be 0 or more, got {arrays[name].min():g}")
    if not (arrays["iors"] > 0.0).all():
        raise ValueError(f"{function}: appearance.hair.iors must be more than 0, got {arrays['iors'].min():g}")
    return arrays


def _world_arguments(function: str, name: str, world: World | None) -> dict[str, Any] | None:
    if world is None:
        return None
    return {
        "color": check_color(function, f"appearance.{name}.color", world.color),
        "image": check_count(function, f"appearance.{name}.image", world.image, -1),
        "rotation": check_number(function, f"appearance.{name}.rotation", world.rotation, -1e6, 1e6),
    }


def _mesh_arrays(
    function: str, mesh: int, value: MeshAppearance, layers: Mapping[str, Mapping[str, int]]
) -> dict[str, Any]:
    name = f"appearance.meshes[{mesh}]"
    arrays: dict[str, Any] = {}
    if value.material_slots is not None:
        arrays["material_slots"] = check_column(function, f"{name}.material_slots", value.material_slots, np.int32, ())
    if value.corner_normals is not None:
        arrays["corner_normals"] = check_column(
            function, f"{name}.corner_normals", value.corner_normals, np.float32, (3, 3)
        )
    arrays["uv_maps"] = _layers(function, name, value, "uvs", layers["uvs"], 2)
    arrays["corner_colors"] = _layers(function, name, value, "colors", layers["colors"], 3)
    arrays["corner_tangents"] = _layers(function, name, value, "tangents", layers["tangents"], 4)
    places, row = value.corner_generated, (3, 3)
    given = [] if places is None else [check_column(function, f"{name}.corner_generated", places, np.float32, row)]
    arrays["corner_generated"] = given
    if value.texture_space is not None:
        arrays["texture_space"] = check_column(function, f"{name}.texture_space", value.texture_space, np.float32, (3,))
        if len(arrays["texture_space"]) != 2:
            raise ValueError(f"{function}: {name}.texture_space must have 2 rows, got {len(arrays['texture_space'])}")
    if value.curve_offsets is not None:
        arrays["curve_offsets"] = check_column(function, f"{name}.curve_offsets", value.curve_offsets, np.int64, ())
    return arrays


def _layers(
    function: str, name: str, value: MeshAppearance, what: str, numbers: Mapping[str, int], width: int
) -> list[npt.NDArray[Any] | None]:
    """Returns layers by number, None for those that the mesh lacks; layers without references are left out."""
    if what == "tangents":
        unnamed, named = value.tangents.get(""), value.tangents
    else:
        unnamed, named = getattr(value, f"corner_{what}"), getattr(value, f"named_{what}")
    if unnamed is None and not named:
        return []
    given = [(f"corner_{what}", unnamed), *((f"named_{what}[{key!r}]", named.get(key)) for key in numbers if key)]
    return [
        None if array is None else check_column(function, f"{name}.{place}", array, np.float32, _row_of(array, width))
        for place, array in given
    ]


def _row_of(layer: npt.ArrayLike, width: int) -> tuple[int, ...]:
    """Three corners a triangle; one value a curve or point, whose meshes have no corners."""
    return (width,) if np.ndim(layer) == 2 else (3, width)


# Light paths ---------------------------------------------------------------------------------------------------------
# How far paths of light are followed in the mode "preview": a scene's *Light Paths*, by Blender's names.


_MOST_BOUNCES = 250
_LARGEST_CLAMP = 1e30


@dataclass(frozen=True, slots=True)
class LightPaths:
    """Limits of paths; the defaults are for a preview, Blender's own allow more bounces.

    Attributes:
        max_bounces: The largest number of bounces in all, 0 to 250; 0 is light straight from its source.
        diffuse_bounces, glossy_bounces, transmission_bounces: The largest number of each kind, 0 to 250. Translucent
            surfaces count as transmission.
        transparent_bounces: The largest number of transparent surfaces that a path passes, which do not count as
            bounces; 0 to 250.
        clamp_direct, clamp_indirect: The limit of the contribution of a path without any bounce, or with one or more,
            as the mean of its channels; 0 for no limit.
        filter_glossy: How much rougher surfaces look in light that has bounced off a rough one, 0 for no change.
        reflective_caustics, refractive_caustics: Whether mirrors and glass cast light on diffuse surfaces.
    """

    max_bounces: int = 4
    diffuse_bounces: int = 4
    glossy_bounces: int = 4
    transmission_bounces: int = 4
    transparent_bounces: int = 8
    clamp_direct: float = 0.0
    clamp_indirect: float = 10.0
    filter_glossy: float = 1.0
    reflective_caustics: bool = True
    refractive_caustics: bool = True


def light_path_arguments(function: str, paths: LightPaths) -> dict[str, Any]:
    """The fields as the native module takes them, checked."""
    arguments = asdict(check_kind(function, "light_paths", paths, LightPaths))
    for name, value in arguments.items():
        place = f"light_paths.{name}"
        if name.endswith("_bounces"):
            arguments[name] = check_count(function, place, value, 0, _MOST_BOUNCES)
        elif name.endswith("_caustics"):
            arguments[name] = bool(value)
        else:
            arguments[name] = check_number(function, place, value, 0.0, _LARGEST_CLAMP)
    return arguments


# Bright skies --------------------------------------------------------------------------------------------------------
# Keeps the bright pixels of a world's image while the image exists: each round of a preview needs them.


_found: dict[int, tuple[weakref.ref[npt.NDArray[Any]], _core.BrightSky]] = {}


def find_bright_sky(image: dict[str, Any], threads: int) -> _core.BrightSky | None:
    """Finds the bright pixels of an image; None if its pixels may still change: then nothing is kept."""
    pixels = image["pixels"]
    if not _is_final(pixels):
        return None
    key = id(pixels)
    held = _found.get(key)
    if held is not None and held[0]() is pixels:
        return held[1]
    made = _core.make_bright_sky(image, threads)
    _found[key] = weakref.ref(pixels, lambda _: _found.pop(key, None)), made
    return made


def _is_final(pixels: npt.NDArray[Any]) -> bool:
    """Whether they cannot change: read-only, and they own their memory."""
    return type(pixels) is np.ndarray and pixels.flags.owndata and not pixels.flags.writeable
