"""What the surfaces are that rays meet, from the looks that a sync has read. Knows no Blender.

In: hits; out: `Surfaces`, their shares at the sensor's wavelength, with images and colours of the mesh as the renderer
has them. Lights, emission, normal maps and hair's own scattering are nothing to it: strands are as their base colour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.appearance import Appearance, ImageTexture, MeshAppearance

from ..patterns import Float64Array
from .reflectance import Surfaces

if TYPE_CHECKING:
    from perfect_bvh import Hits

    from ...live.scene_sync import SceneSync

# The colour and alpha that images have at places of uv maps: bilinear, as the renderer looks them up.
#
# Values between those of bytes are sRGB, too, and are made linear afterwards.
#
# Knows no Blender. In: an image's pixels and places; out: scene-linear colour and alpha.


MISSING_TILE = (1.0, 0.0, 1.0, 1.0)  # magenta, as in Cycles
TILES_A_ROW = 10
FIRST_TILE = 1001


def look_up(image: ImageTexture, uvs: npt.NDArray[np.floating]) -> Float64Array:
    """(N, 4) float64 at (N, 2) places of a uv map; what is not finite counts as 0."""
    across, up = np.asarray(image.uv_transform, np.float64).reshape(2, 3)
    u, v = uvs.astype(np.float64).T
    places = np.stack([across[0] * u + across[1] * v + across[2], up[0] * u + up[1] * v + up[2]], axis=1)
    return _look_up_tiles(image, places) if image.tiles else _bilinear(image.pixels, image.extension, places)


def _look_up_tiles(image: ImageTexture, places: Float64Array) -> Float64Array:
    """As in Cycles what lies less than a unit to the left of all tiles, or below them, belongs to the first ones."""
    known = np.where(np.isfinite(places), places, -1.0)
    columns, rows = np.trunc(np.clip(known, -2.0, 1e6)).astype(np.int64).T
    is_inside = (known > -1.0).all(axis=1) & (columns < TILES_A_ROW)
    numbers = np.where(is_inside, FIRST_TILE + columns + TILES_A_ROW * rows, -1)
    found = np.tile(np.array(MISSING_TILE), (len(places), 1))
    for number, pixels in image.tiles.items():
        at = np.flatnonzero(numbers == number)
        if len(at):
            found[at] = _bilinear(pixels, image.extension, known[at] - np.stack([columns[at], rows[at]], axis=1))
    return found


def _bilinear(pixels: npt.NDArray[np.generic], extension: str, places: Float64Array) -> Float64Array:
    height, width = pixels.shape[:2]
    if not height or not width:
        return np.zeros((len(places), 4))
    x, y = (_in_pixels(places[:, axis], count, extension) for axis, count in ((0, width), (1, height)))
    left, below = np.floor(x), np.floor(y)
    columns, rows = left.astype(np.int64), below.astype(np.int64)

    def at(right: int, above: int) -> Float64Array:
        return _pixels_at(pixels, extension, columns + right, rows + above)

    aside, over = (x - left)[:, None], (y - below)[:, None]
    lower, upper = (at(0, above) + (at(1, above) - at(0, above)) * aside for above in (0, 1))
    found = lower + (upper - lower) * over
    return _linear(found / 255.0) if pixels.dtype == np.uint8 else found


def _linear(found: Float64Array) -> Float64Array:
    """Of sRGB (IEC 61966-2-1); alpha is as it was."""
    colors = found[:, :3]
    found[:, :3] = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
    return found


def _in_pixels(coordinates: Float64Array, count: int, extension: str) -> Float64Array:
    known = np.where(np.isfinite(coordinates), coordinates, 0.0)
    if extension == "repeat":
        known = known - np.floor(known)
    return np.clip(known, -2.0, 3.0) * count - 0.5


def _pixels_at(
    pixels: npt.NDArray[np.generic], extension: str, columns: npt.NDArray[np.int64], rows: npt.NDArray[np.int64]
) -> Float64Array:
    height, width = pixels.shape[:2]
    if extension == "repeat":
        inner = columns % width, rows % height
    else:
        inner = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    colors = pixels[inner[1], inner[0]].astype(np.float64)
    if extension == "clip":
        colors[(inner[0] != columns) | (inner[1] != rows)] = 0.0
    return colors


# Surface reader ------------------------------------------------------------------------------------------------------


IntArray = npt.NDArray[Any]

PLAIN_COLOR, PLAIN_ROUGHNESS = 0.8, 0.5  # of what has no material, as Blender shows it
COLUMNS = (
    *("base_colors", "color_scales", "alphas", "metallics", "roughnesses", "reflectances", "specular_tints"),
    *("transmissions", "translucencies", "iors", "even_metals", "plain_refractions", "metal_colors", "metal_powers"),
    *("transmission_colors", "transmission_powers"),
)
# Of materials that were not asked for more than their viewport colours, and of what has none.
DEFAULTS = {"alphas": 1.0, "roughnesses": PLAIN_ROUGHNESS, "iors": 1.5, "metal_powers": 1.0, "transmission_powers": 0.5}
WHITE = {"color_scales", "specular_tints", "metal_colors", "transmission_colors"}


class SurfaceReader:
    """Of one update of a sync. spectrum: how much red, green and blue count."""

    def __init__(self, sync: SceneSync, spectrum: tuple[float, float, float]) -> None:
        self._sync = sync
        self._appearance: Appearance = sync.appearance
        self._spectrum = np.array(spectrum, np.float64) / sum(spectrum)
        self._table = _table_of(self._appearance)
        self._plain = self._surfaces(self._table)
        self._has_images = _has_images(self._appearance, len(self._plain.alpha))
        self._order = np.argsort(self._appearance.instances.ids, kind="stable")

    def read(self, hits: Hits) -> Surfaces:
        """Of hits, none of them a miss: what they are."""
        rows = self._with_variants(self._sync.material_ids(hits), hits.instance_ids)
        surfaces = self._plain.part(rows)
        with_images = rows[self._has_images[rows]]
        for row in np.unique(with_images).tolist():
            at = np.flatnonzero(rows == row)
            surfaces.put(at, self._surfaces(self._with_its_images(hits, row, at)))
        return surfaces

    def _with_variants(self, materials: IntArray, instance_ids: IntArray) -> IntArray:
        """Rows of the material table, in which variants follow the materials; none is the last row, -1."""
        variants = self._sync.record.variants
        rows = materials.astype(np.int64)
        if variants is None or not len(variants.materials):
            return rows
        ids = self._appearance.instances.ids
        places = self._order[np.searchsorted(ids, instance_ids, sorter=self._order)]
        count = len(ids)
        known = variants.materials.astype(np.int64) * count + variants.instances
        wanted = rows * count + places
        found = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        is_variant = (known[found] == wanted) & (rows >= 0)
        return np.where(is_variant, len(self._sync.record.materials) + found, rows)

    def _with_its_images(self, hits: Hits, row: int, at: IntArray) -> dict[str, Float64Array]:
        """The columns of a material, with the colours and alphas of its images and of the meshes at the hits `at`."""
        columns = {name: np.repeat(column[[row]], len(at), axis=0) for name, column in self._table.items()}
        table = self._appearance.materials
        if table.color_images is not None and table.color_images[row] >= 0:
            colors = self._image(hits, at, int(table.color_images[row]))
            columns["base_colors"] = colors[:, :3] * columns["color_scales"]
        if table.alpha_images is not None and table.alpha_images[row] >= 0:
            columns["alphas"] *= np.clip(self._image(hits, at, int(table.alpha_images[row]))[:, 3], 0.0, 1.0)
        tint = None if table.tints is None else table.tints[row]
        if tint is not None:
            columns["base_colors"] *= self._layer(hits, at, "corner_colors", "named_colors", tint, 3)
        return columns

    def _image(self, hits: Hits, at: IntArray, row: int) -> Float64Array:
        image = self._appearance.images[row]
        return look_up(image, self._layer(hits, at, "corner_uvs", "named_uvs", image.uv_map, 2))

    def _layer(self, hits: Hits, at: IntArray, plain: str, named: str, name: str, width: int) -> Float64Array:
        """(N, width) of a uv map or colours at the hits `at`; zero where the mesh has none, as in Blender."""
        found = np.zeros((len(at), width))
        mesh_ids = hits.mesh_ids[at]
        for mesh_id in np.unique(mesh_ids).tolist():
            mesh = self._appearance.meshes[mesh_id]
            layer = getattr(mesh, named).get(name) if name else getattr(mesh, plain)
            if layer is not None:
                of_mesh = np.flatnonzero(mesh_ids == mesh_id)
                places = at[of_mesh]
                found[of_mesh] = _between(layer, mesh, hits.primitive_ids[places], hits.primitive_uvs[places])
        return found

    def _surfaces(self, columns: dict[str, Float64Array]) -> Surfaces:
        base = np.maximum(columns["base_colors"], 0.0)
        metal = columns["metallics"]
        clear = (1.0 - metal) * columns["transmissions"]
        coat = columns["reflectances"] * self._gray(columns["specular_tints"])
        return Surfaces(
            alpha=columns["alphas"],
            diffuse=(1.0 - metal - clear) * (1.0 - columns["translucencies"]),
            metal=metal,
            clear=clear,
            color=self._gray(base),
            metal_color=self._tinted(base, columns["metal_colors"], columns["metal_powers"]),
            clear_color=self._tinted(base, columns["transmission_colors"], columns["transmission_powers"]),
            coat=np.clip(coat, 0.0, 1.0),
            ior=columns["iors"],
            mirrors=1.0 - columns["plain_refractions"],
            slant=1.0 - columns["even_metals"],
            roughness=columns["roughnesses"],
        )

    def _tinted(self, base: Float64Array, color: Float64Array, powers: Float64Array) -> Float64Array:
        """(N,) `color` times the base colour to a power, at most 1. The usual powers are the same bits everywhere."""
        power = powers[:, None]
        raised = np.where(power == 1.0, base, np.where(power == 0.5, np.sqrt(base), 1.0))
        unusual = np.flatnonzero(~np.isin(powers, (0.0, 0.5, 1.0)))
        if len(unusual):
            raised[unusual] = base[unusual] ** power[unusual]
        return np.clip(self._gray(color * raised), 0.0, 1.0)

    def _gray(self, colors: Float64Array) -> Float64Array:
        red, green, blue = self._spectrum.tolist()
        return colors[:, 0] * red + colors[:, 1] * green + colors[:, 2] * blue


def _has_images(appearance: Appearance, count: int) -> npt.NDArray[np.bool_]:
    """(count,) which materials have images, or colours of the mesh; the last row is of what has no material."""
    table = appearance.materials
    found = np.zeros(count, np.bool_)
    for images in (table.color_images, table.alpha_images):
        if images is not None:
            found[: len(images)] |= np.asarray(images) >= 0
    if table.tints is not None:
        found[: len(table.tints)] |= np.array([tint is not None for tint in table.tints], np.bool_)
    return found


def _table_of(appearance: Appearance) -> dict[str, Float64Array]:
    """The material table's columns that count, as float64, with a row more for what has no material: the last."""
    materials = appearance.materials
    count = len(materials.colors)
    table = {}
    for name in COLUMNS:
        own = getattr(materials, name)
        if own is None and name == "base_colors":
            own = materials.colors[:, :3]
        is_color = name in WHITE or name == "base_colors"
        plain = 1.0 if name in WHITE else DEFAULTS.get(name, 0.0)
        column = np.full((count + 1, 3) if is_color else count + 1, plain)
        if own is not None:
            column[:count] = own
        table[name] = column
    table["base_colors"][-1] = PLAIN_COLOR
    table["reflectances"][-1] = appearance.plain_reflectance
    return table


def _between(
    layer: npt.NDArray[np.floating], mesh: MeshAppearance, primitives: IntArray, uvs: npt.NDArray[np.floating]
) -> Float64Array:
    """(N, W) of a layer at hits: between the corners of triangles, or the points of curves."""
    u, v = uvs.astype(np.float64).T[:, :, None]
    if layer.ndim == 3:
        corners = layer[primitives].astype(np.float64)
        return (1.0 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    offsets = mesh.curve_offsets
    if offsets is None or len(layer) != offsets[-1]:  # a row a curve or point
        return layer[primitives].astype(np.float64)
    firsts, lasts = offsets[primitives], np.maximum(offsets[primitives + 1] - 1, offsets[primitives])
    along = firsts + u[:, 0] * (lasts - firsts)
    before = np.clip(np.floor(along).astype(np.int64), firsts, lasts)
    share = (along - before)[:, None]
    return (1.0 - share) * layer[before] + share * layer[np.minimum(before + 1, lasts)]
