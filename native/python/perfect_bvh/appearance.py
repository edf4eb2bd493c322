"""The look of surfaces, as plain arrays: the renderer's only source of colours.

The `Scene` holds the geometry; this module holds everything else that a shading mode may need. All of it is
optional: without it, a mode uses a grey material and the geometric normal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from .finishes import FinishTable
from .nodes import NodeProgram

Int32Array = npt.NDArray[np.int32]
Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class MeshAppearance:
    """Attributes of one mesh: for T triangles a row each, in the order of its triangles.

    For a mesh of C curves or points: material_slots are (C,). uvs and colours are (C, 2) and (C, 3), one for each curve
    or point. For curves they may be (P, 2) and (P, 3) instead, one for each control point; hits interpolate between
    these by their u. That works for curves that are not cyclic and go through their points, "poly" and "catmull_rom".
    Normals are those of the round surface. curve_offsets: (C + 1,) int64, as `Scene.add_curves` takes them; only needed
    where an attribute has a row for each control point.

    Attributes:
        material_slots: (T,) int32, the slot of the instance's object that each triangle uses. None: all slot 0.
        corner_normals: (T, 3, 3) float32, object space. None: flat shading.
        corner_uvs: (T, 3, 2) float32, the uv map without a name. None: no uv map; images then show their pixel
            at (0, 0).
        corner_colors: (T, 3, 3) float32, scene-linear, the colours without a name. None: black.
        named_uvs, named_colors: Further layers, by the names that programs of `MaterialTable.programs` use.
        tangents: (T, 3, 4) float32 by the names of uv maps, "" for `corner_uvs`: in object space, and the bitangent's
            sign. Without them normal maps in tangent space have no effect.
        texture_space: (2, 3) float32: programs get as "GENERATED" the position in object space times the first row plus
            the second. None: 0 everywhere.
        corner_generated: (T, 3, 3) float32, the value of "GENERATED" instead, for example of deformed meshes.
    """

    material_slots: Int32Array | None = None
    corner_normals: Float32Array | None = None
    corner_uvs: Float32Array | None = None
    corner_colors: Float32Array | None = None
    named_uvs: Mapping[str, Float32Array] = field(default_factory=dict)
    named_colors: Mapping[str, Float32Array] = field(default_factory=dict)
    tangents: Mapping[str, Float32Array] = field(default_factory=dict)
    texture_space: Float32Array | None = None
    corner_generated: Float32Array | None = None
    curve_offsets: npt.NDArray[np.int64] | None = None


@dataclass(frozen=True, slots=True)
class MaterialTable:
    """M materials.

    A surface is split into shares that add up to one: metal; of the rest, glass; of the rest of that, translucent; and
    the remainder is diffuse under a dielectric reflection.

    Attributes:
        colors: (M, 4) float32, scene-linear viewport colour.
        indices: (M,) int32, pass index. All attributes below are for the mode "preview".
        base_colors: (M, 3) float32, scene-linear, the share of light that is reflected. None: the viewport colours.
        emissions: (M, 3) float32, radiance. None: no material emits light.
        alphas: (M,) float32, 0 to 1. None: all are opaque.
        metallics, roughnesses: (M,) float32, 0 to 1, as in Blender's Principled BSDF. None: no metal, and all is rough.
        lossy_facets: (M,) float32, 0 to 1, the lost share of the light that rough facets scatter at each other:
            1 for Blender's distribution GGX, 0 for Multiscatter GGX. None: nothing is lost.
        reflectances: (M,) float32, the specular reflectance of a surface that is no metal, seen from straight above;
            0.04 for most. None: all are diffuse.
        transmissions: (M,) float32, 0 to 1: the share of glass in the part that is no metal. Glass reflects, and light
            passes straight through. None: no glass.
        translucencies: (M,) float32, 0 to 1: the share, of the part that is neither metal nor glass, that scatters
            light diffusely to its other side only. None: 0.
        iors: (M,) float32, more than 0: the index of refraction of glass. None: 1.5.
        even_metals: (M,) float32, 0 to 1: the share of the metal that reflects equally at all angles. None: 0, so all
            metal becomes white at grazing angles.
        tinted_glasses, plain_refractions: (M,) float32, 0 to 1: the share of the glass whose reflections are tinted,
            too, and the share that has no reflections. None: 0.
        specular_tints: (M, 3) float32: a factor of the reflectance from straight above; for metals the colour at 82
            degrees. None: white.
        metal_colors, metal_powers: (M, 3) and (M,) float32: the metal's colour is `metal_colors` times the base colour,
            as programs make it, to the power of `metal_powers`. None: white and 1.
        transmission_colors, transmission_powers: The same for refracted light. None: white and 0.5.
        translucent_colors, translucent_powers: The same for the light that is scattered to the other side, as a share
            of all light on the whole surface. None: black and 0.
        holdouts: (M,) float32, 0 to 1: the share that cuts a hole into the image: it hides surfaces behind it and has
            no colour or alpha itself. At 1 camera rays find no surface in it, as in an instance that is held out.
            None: 0.
        programs: (M,) a `NodeProgram` for each material, which sets the properties that vary over it; None for none.
            Its outputs replace the columns. None: no material has one.
        hairs: (M,) int32, the row of the appearance's hair that curves have instead; -1 for none. None: no hair.
        finishes: (M,) int32, rows of the appearance's finishes; -1 for none. None: no finishes. A program's finish
            outputs count only for materials that have a finish.
    """

    colors: Float32Array = field(default_factory=lambda: np.empty((0, 4), np.float32))
    indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    base_colors: Float32Array | None = None
    emissions: Float32Array | None = None
    alphas: Float32Array | None = None
    metallics: Float32Array | None = None
    roughnesses: Float32Array | None = None
    lossy_facets: Float32Array | None = None
    reflectances: Float32Array | None = None
    transmissions: Float32Array | None = None
    translucencies: Float32Array | None = None
    iors: Float32Array | None = None
    even_metals: Float32Array | None = None
    tinted_glasses: Float32Array | None = None
    plain_refractions: Float32Array | None = None
    specular_tints: Float32Array | None = None
    metal_colors: Float32Array | None = None
    metal_powers: Float32Array | None = None
    transmission_colors: Float32Array | None = None
    transmission_powers: Float32Array | None = None
    translucent_colors: Float32Array | None = None
    translucent_powers: Float32Array | None = None
    holdouts: Float32Array | None = None
    programs: Sequence[NodeProgram | None] | None = None
    hairs: Int32Array | None = None
    finishes: Int32Array | None = None


@dataclass(frozen=True, slots=True)
class ImageTexture:
    """An image that materials or the world refer to.

    Attributes:
        pixels: (H, W, 4), straight alpha, row 0 at the lower border (v = 0). uint8 is sRGB, also between pixels, as in
            Cycles; float32 is scene-linear. The mode "preview" finds the bright pixels in the world's image. If the
            array is read-only and owns its memory, they are kept while it exists; otherwise they are found again for
            each rendered image.
        extension: The colour outside 0..1: "repeat", "extend" (the border's colour), "clip" (nothing), "mirror" (the
            image mirrored) or, around a scene, "sky": repeated, with rows closer to each other at the horizon. Row `i`
            of `H` is at a latitude of half pi times t * abs(t), where t is (2 * i + 1) / H - 1.
        interpolation: Between the middles of pixels: "linear", or "closest".
        tiles: Of a UDIM image, further arrays like `pixels` by their numbers: tile 1001 + column + 10 * row covers
            that unit square of the uv map. If there are any, surfaces show them instead of `pixels`, and magenta
            between them.
        is_linear: uint8 is scene-linear, too (0 to 255 for 0 to 1), for images that hold data.
    """

    pixels: npt.NDArray[np.uint8] | Float32Array
    extension: Literal["repeat", "extend", "clip", "mirror", "sky"] = "repeat"
    interpolation: Literal["linear", "closest"] = "linear"
    tiles: Mapping[int, npt.NDArray[np.uint8] | Float32Array] = field(default_factory=dict)
    is_linear: bool = False


@dataclass(frozen=True, slots=True)
class HairTable:
    """H kinds of hair, for curves only.

    A strand scatters the light from all around it, by shares: as an ordinary surface, and as a fiber that light enters
    (Marschner et al. 2003, in the form of Chiang et al. 2016).

    Attributes:
        surfaces, fibers: (H,) float32, the shares of the material's ordinary surface and of the fiber, 0 or more.
        absorptions: (H, 3) float32, 0 or more: of the fiber, by its radius.
        colored: (H,) bool, whether the material's base colour absorbs, too, as in "Direct Coloring".
        roughnesses: (H, 2) float32, 0 to 1: of the fiber, along and around it.
        coats: (H,) float32, 0 to 1: by how much the light reflected at the outside is less rough.
        tilts: (H,) float32, radians, of the cuticle's scales.
        iors: (H,) float32, more than 0.
    """

    surfaces: Float32Array = field(default_factory=lambda: np.empty(0, np.float32))
    fibers: Float32Array = field(default_factory=lambda: np.empty(0, np.float32))
    absorptions: Float32Array = field(default_factory=lambda: np.empty((0, 3), np.float32))
    colored: npt.NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    roughnesses: Float32Array = field(default_factory=lambda: np.empty((0, 2), np.float32))
    coats: Float32Array = field(default_factory=lambda: np.empty(0, np.float32))
    tilts: Float32Array = field(default_factory=lambda: np.empty(0, np.float32))
    iors: Float32Array = field(default_factory=lambda: np.empty(0, np.float32))


LIGHT_KINDS = ("point", "sun", "spot", "rectangle", "ellipse")


@dataclass(frozen=True, slots=True)
class LightTable:
    """L lights; an axis a row, so that axes[i, 2] is light i's own z. All of them shine along -z.

    Attributes:
        kinds: (L,) int32, rows of LIGHT_KINDS.
        positions: (L, 3) float64.
        axes: (L, 3, 3) float32, unit vectors.
        powers: (L, 3) float32, of each channel, in watts; of a sun the irradiance of a surface that faces it, watts a
            square metre. A point light of P watts shines with P / (4 pi) into every direction, an area light with the
            radiance P / (pi area), as in Blender.
        sizes: (L, 2) float32: the radius of points and spots, the angle of suns in radians (both in the first column),
            the two sides or diameters of rectangles and ellipses.
        cones: (L, 2) float32: of spots, the whole angle in radians and the share of it that the soft border takes, 0 to
            1; of rectangles and ellipses, the whole angle to which a grid in front of them limits their light, pi
            without one, and 0.
        casts_shadow: (L,) bool.
    """

    kinds: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    positions: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3), np.float64))
    axes: Float32Array = field(default_factory=lambda: np.empty((0, 3, 3), np.float32))
    powers: Float32Array = field(default_factory=lambda: np.empty((0, 3), np.float32))
    sizes: Float32Array = field(default_factory=lambda: np.empty((0, 2), np.float32))
    cones: Float32Array = field(default_factory=lambda: np.empty((0, 2), np.float32))
    casts_shadow: npt.NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))


@dataclass(frozen=True, slots=True)
class World:
    """The light from all around a scene.

    Attributes:
        color: scene-linear radiance, or the factor of the image's colours.
        image: The row of an equirectangular image among the appearance's, -1 for none.
        rotation: Of directions about z before the lookup in the image, in radians.
    """

    color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    image: int = -1
    rotation: float = 0.0


@dataclass(frozen=True, slots=True)
class InstanceTable:
    """I instances, one row each, in any order; instances that are not listed have no materials.

    Attributes:
        ids: (I,) int32, the scene's instance ids.
        slot_offsets: (I + 1,) int32: instance i's materials are slot_materials[slot_offsets[i]:slot_offsets[i + 1]].
            Triangles that use a slot beyond these get the last material.
        slot_materials: (S,) int32, rows of the material table, -1 for an empty slot.
        object_indices: (I,) int32, the object's pass index.
        holdout: (I,) bool: the instance cuts a transparent hole into the image.
        values: (I, K, 4) float32: the values that programs get as "INSTANCE", by its row 0 to K - 1.
    """

    ids: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    slot_offsets: Int32Array = field(default_factory=lambda: np.zeros(1, np.int32))
    slot_materials: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    object_indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    holdout: npt.NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    values: Float32Array | None = None


@dataclass(frozen=True, slots=True)
class Appearance:
    """Materials, attributes and visibility of a scene's meshes (by mesh id) and instances.

    Attributes:
        camera_mask: The bits of an instance's mask that camera rays see.
        shadow_mask: The bits that ambient-occlusion and shadow rays see.
        diffuse_mask, glossy_mask, transmission_mask: In "preview" the bits that diffusely scattered, reflected and
            transmitted rays see.
        catcher_mask: In "preview" instances with one of these bits in their mask show only the shadows that other
            instances cast on them: black, with alpha equal to the share of light that these block; over the world
            without `film_transparent`.
        film_transparent: The background has alpha 0 instead of showing the sky.
        plain_reflectance: In "preview", the reflectance from straight above of surfaces without a material, like a
            dielectric of roughness 0.5; 0 to 1.
        pass_alpha_threshold: 0 to 1. Surfaces with less alpha are not in the passes of depths, normals, indices and
            vectors: these show the surface behind, through up to `LightPaths.transparent_bounces` surfaces.
        images, hair, finish, lights, world: For the mode "preview". Without a world the studio's soft sky lights the
            scene.
        backdrop: A background that the camera sees instead of the world, and that lights nothing. None: the world.
    """

    meshes: Mapping[int, MeshAppearance] = field(default_factory=dict)
    instances: InstanceTable = field(default_factory=InstanceTable)
    materials: MaterialTable = field(default_factory=MaterialTable)
    camera_mask: int = 0xFFFFFFFF
    shadow_mask: int = 0xFFFFFFFF
    diffuse_mask: int = 0xFFFFFFFF
    glossy_mask: int = 0xFFFFFFFF
    transmission_mask: int = 0xFFFFFFFF
    catcher_mask: int = 0
    film_transparent: bool = False
    plain_reflectance: float = 0.0
    pass_alpha_threshold: float = 0.0
    images: tuple[ImageTexture, ...] = ()
    hair: HairTable = field(default_factory=HairTable)
    finish: FinishTable = field(default_factory=FinishTable)
    lights: LightTable = field(default_factory=LightTable)
    world: World | None = None
    backdrop: World | None = None
