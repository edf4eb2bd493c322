"""The plain records of a scene's looks: materials, images, lights and the world. See `records`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:  # records are there without the engine, too
    from perfect_bvh.nodes import NodeProgram

Extension = Literal["repeat", "extend", "clip", "mirror", "sky"]
Interpolation = Literal["linear", "closest"]
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class HairRecord:
    """The hair of a material's curves: a row of `perfect_bvh.HairTable`, whose columns these are."""

    surface: float = 0.0
    fiber: float = 0.0
    absorption: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colored: bool = False
    roughness: tuple[float, float] = (0.3, 0.3)
    coat: float = 0.0
    tilt: float = 0.0
    ior: float = 1.55


@dataclass(frozen=True, slots=True)
class FinishRecord:
    """Properties that few surfaces have: a row of `perfect_bvh.FinishTable`, whose columns these are."""

    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.5
    sheen_cover: float = 1.0
    coat: float = 0.0
    coat_roughness: float = 0.03
    coat_ior: float = 1.5
    coat_tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    stretch: float = 1.0
    rotation: float = 0.0
    diffuse_roughness: float = 0.0
    distribution: float = 0.0
    absorption: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class MaterialRecord:
    """color: viewport colour, scene-linear RGBA. pass_index: for the material index pass.

    The rest is only read if `AttributeRequest.shading` is set, see `perfect_bvh.MaterialTable`. program: the properties
    that vary over the surface, whose fields hold about the mean; None for none.
    """

    name: str
    session_uid: int
    pass_index: int
    color: tuple[float, float, float, float]
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha: float = 1.0
    metallic: float = 0.0
    roughness: float = 1.0
    lossy_facets: float = 0.0
    reflectance: float = 0.0
    transmission: float = 0.0
    translucency: float = 0.0
    ior: float = 1.5
    even_metal: float = 0.0
    tinted_glass: float = 0.0
    plain_refraction: float = 0.0
    specular_tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metal_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metal_power: float = 1.0
    transmission_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    transmission_power: float = 0.5
    translucent_color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    translucent_power: float = 0.0
    holdout: float = 0.0
    hair: HairRecord | None = None
    finish: FinishRecord | None = None
    program: NodeProgram | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ImageRecord:
    """pixels: (H, W, 4), row 0 at the bottom: uint8 sRGB or float32 scene-linear.

    extension: the colour beyond its border; interpolation: between pixels; tiles: of a UDIM image, by their
    numbers, the first one being `pixels`, too; is_linear: uint8 is scene-linear; see `perfect_bvh.ImageTexture`.
    An image that is known to be unchanged since the previous record has the very same array. From here on it is
    read-only: the renderer caches results for it.
    """

    name: str
    session_uid: int
    pixels: Pixels
    extension: Extension
    interpolation: Interpolation = "linear"
    tiles: Mapping[int, Pixels] = field(default_factory=dict)
    is_linear: bool = False

    def __post_init__(self) -> None:
        for pixels in (self.pixels, *self.tiles.values()):
            pixels.flags.writeable = False

    @property
    def byte_count(self) -> int:
        """The bytes of the pixels; if there are tiles, `pixels` is one of them."""
        return sum(tile.nbytes for tile in self.tiles.values()) if self.tiles else self.pixels.nbytes


@dataclass(frozen=True, slots=True, eq=False)
class LightRecords:
    """L lights as the columns of `perfect_bvh.LightTable`, their kinds by name.

    of_world: how many of the last belong to the world.
    """

    kinds: tuple[str, ...] = ()
    positions: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3), np.float64))
    axes: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 3, 3), np.float32))
    powers: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 3), np.float32))
    sizes: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), np.float32))
    cones: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), np.float32))
    casts_shadow: npt.NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    of_world: int = 0


@dataclass(frozen=True, slots=True)
class WorldRecord:
    """The fields of `perfect_bvh.World`. backdrop: the camera's view of it, None for the same."""

    color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    image: int = -1
    rotation: float = 0.0
    backdrop: WorldRecord | None = None
