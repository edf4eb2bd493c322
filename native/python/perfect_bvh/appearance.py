"""What surfaces look like, as plain arrays: the renderer's only knowledge of colour.

Geometry is in the `Scene`; this is everything that a shading mode may need besides. All of it is optional:
a mode that lacks something falls back to a grey material and the geometric normal.
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
    """Attributes of one mesh: of T triangles a row each, in the order of its triangles.

    Of a mesh of curves or points, C of them: material_slots (C,); uvs and colours (C, 2) and (C, 3), one for each, or
    of curves (P, 2) and (P, 3), one for each control point, between which hits find theirs by their u: of curves that
    are not cyclic and go through their points, "poly" and "catmull_rom". Normals are those of the round surface.
    curve_offsets: (C + 1,) int64, as `Scene.add_curves` takes them; only where something has a row a control point.

    Attributes:
        material_slots: (T,) int32, the slot of the instance's object that each triangle uses. None: all slot 0.
        corner_normals: (T, 3, 3) float32, object space. None: flat shading.
        corner_uvs: (T, 3, 2) float32, the uv map without a name. None: no uv map; images then show their place (0, 0).
        corner_colors: (T, 3, 3) float32, scene-linear, the colours without a name. None: black.
        named_uvs, named_colors: Further ones, by the names that programs of `MaterialTable.programs` ask for.
        tangents: (T, 3, 4) float32 by the names of uv maps, "" for `corner_uvs`: in object space, and the bitangent's
            sign. Normal maps in tangent space show nothing without.
        texture_space: (2, 3) float32: a place in object space, times the first row, plus the second, is what programs
            get as "GENERATED". None: 0 everywhere.
        corner_generated: (T, 3, 3) float32, what they get instead, as of meshes that were deformed.
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

    A surface is split into shares that add up to one: metal, of the rest what is clear as glass, of the rest what is
    translucent, and what remains: diffuse under a dielectric reflection.

    Attributes:
        colors: (M, 4) float32, scene-linear viewport colour.
        indices: (M,) int32, pass index. All that follows is for the mode "preview".
        base_colors: (M, 3) float32, scene-linear, the share of light that comes back. None: the viewport colours.
        emissions: (M, 3) float32, radiance. None: none shines.
        alphas: (M,) float32, 0 to 1. None: all are opaque.
        metallics, roughnesses: (M,) float32, 0 to 1, as in Blender's Principled BSDF. None: no metal, and all is rough.
        lossy_facets: (M,) float32, 0 to 1, the share that is lost of the light that rough facets scatter at each other:
            1 for Blender's distribution GGX, 0 for Multiscatter GGX. None: nothing is lost.
        reflectances: (M,) float32, what a surface that is no metal mirrors when seen from straight above; 0.04 for
            most. None: all are diffuse.
        transmissions: (M,) float32, 0 to 1: how clear it is, of what is no metal. Glass mirrors and is seen through
            straight. None: none is.
        translucencies: (M,) float32, 0 to 1: how much of what is neither metal nor clear gives light back diffuse on
            its other side alone. None: none does.
        iors: (M,) float32, more than 0: the index of refraction of what is clear. None: 1.5.
        even_metals: (M,) float32, 0 to 1: how much of the metal mirrors alike at all angles. None: none, so that all of
            it becomes white at a slant.
        tinted_glasses, plain_refractions: (M,) float32, 0 to 1: how much of what is clear has its tint on what it
            mirrors, too, and how much mirrors nothing. None: none.
        specular_tints: (M, 3) float32: what the reflectance from straight above is multiplied with; of metals the
            colour at 82 degrees. None: white.
        metal_colors, metal_powers: (M, 3) and (M,) float32: the metal's colour is `metal_colors` times the base colour,
            as programs make it, to the power of `metal_powers`. None: white and 1.
        transmission_colors, transmission_powers: The same for what is refracted. None: white and 0.5.
        translucent_colors, translucent_powers: The same for the light that is given back on the other side, as a share
            of all that falls on the whole surface. None: black and 0.
        holdouts: (M,) float32, 0 to 1: how much of it cuts a hole into the image: it hides what is behind without
            colour or alpha of its own. At 1 camera rays find no surface in it, as in an instance that is held out.
            None: none does.
        programs: (M,) a `NodeProgram` of each material, which sets what is not the same all over it; None for none.
            What it sets counts instead of the columns. None: no material has one.
        hairs: (M,) int32, rows of the appearance's hair, what curves are of instead; -1 for none. None: none is.
        finishes: (M,) int32, rows of the appearance's finishes; -1 for none. None: none has one. What programs set of a
            finish counts only for materials that have one.
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
        pixels: (H, W, 4), straight alpha, row 0 at the lower border (v = 0); uint8 is sRGB, also between pixels, as in
            Cycles; float32 is scene-linear. What the mode "preview" finds bright in the world's image is kept while the
            array exists if it is read-only and owns its memory; else it is found again for each image that is rendered.
        extension: What lies outside 0..1: "repeat", "extend" (the border's colour), "clip" (nothing) or "mirror" (the
            image turned round).
        interpolation: What lies between the middles of pixels: "linear", or "closest".
        tiles: Of a UDIM image, further arrays as `pixels` by their numbers: tile 1001 + column + 10 * row lies over
            that unit square of the uv map. Where there are any, surfaces show them instead of `pixels`, and magenta in
            between.
        is_linear: uint8 is scene-linear, too (0 to 255 for 0 to 1), as of images that are data.
    """

    pixels: npt.NDArray[np.uint8] | Float32Array
    extension: Literal["repeat", "extend", "clip", "mirror"] = "repeat"
    interpolation: Literal["linear", "closest"] = "linear"
    tiles: Mapping[int, npt.NDArray[np.uint8] | Float32Array] = field(default_factory=dict)
    is_linear: bool = False


@dataclass(frozen=True, slots=True)
class HairTable:
    """H kinds of hair, which curves are of; other surfaces never are.

    A strand scatters the light from all around it, by shares: as an ordinary surface, and as a fiber that light passes
    into (Marschner et al. 2003, in the form of Chiang et al. 2016).

    Attributes:
        surfaces, fibers: (H,) float32, the shares of the material's ordinary surface and of the fiber, 0 or more.
        absorptions: (H, 3) float32, 0 or more: of the fiber, by its radius.
        colored: (H,) bool, whether the material's base colour absorbs, too, as in "Direct Coloring".
        roughnesses: (H, 2) float32, 0 to 1: of the fiber, along and around it.
        coats: (H,) float32, 0 to 1: how much of the roughness what is reflected at once is without.
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
        powers: (L, 3) float32, of each channel, in watts; of a sun what falls on a surface that faces it, watts a
            square metre. A point light of P watts shines with P / (4 pi) into every direction, an area light with the
            radiance P / (pi area), as in Blender.
        sizes: (L, 2) float32: the radius of points and spots, the angle of suns in radians (both in the first column),
            the two sides or diameters of rectangles and ellipses.
        cones: (L, 2) float32: of spots, the whole angle in radians and how much of it the soft border takes, 0 to 1; of
            rectangles and ellipses, the whole angle that a grid before them leaves to their light, pi without one, and
            0.
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
        color: scene-linear radiance, or what the image's colours are multiplied with.
        image: The row of an equirectangular image among the appearance's, -1 for none.
        rotation: Of directions about z before the image is looked up, in radians.
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
            Triangles that use a slot beyond these are shown in the last one.
        slot_materials: (S,) int32, rows of the material table, -1 for an empty slot.
        object_indices: (I,) int32, the object's pass index.
        holdout: (I,) bool: the instance cuts a transparent hole into the image.
        values: (I, K, 4) float32: what programs get as "INSTANCE", by its row 0 to K - 1.
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
        shadow_mask: Those that ambient-occlusion and shadow rays see.
        diffuse_mask, glossy_mask, transmission_mask: In "preview" those that rays see which a surface spreads, mirrors
            or lets through.
        catcher_mask: In "preview" instances with one of these bits in their mask show nothing but the shadows that
            others throw on them: black, with as much alpha as the light that these take from them; over the world
            without `film_transparent`.
        film_transparent: The background has alpha 0 instead of showing the sky.
        plain_reflectance: In "preview", how much of the light from straight above is mirrored by what has no material,
            like a dielectric of roughness 0.5; 0 to 1.
        pass_alpha_threshold: 0 to 1. What has less alpha is not in the passes of depths, normals, indices and vectors:
            they show what is behind it, through as many surfaces as `LightPaths.transparent_bounces` says.
        images, hair, finish, lights, world: For the mode "preview". Without a world the studio's soft sky stands for
            it.
        backdrop: What the camera sees instead of the world, and nothing is lit by. None: the world.
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
