"""The plain records that extraction writes and sync reads: numpy arrays and strings, no Blender type.

Everything is copied: a record stays valid after Blender re-evaluates or frees the data that it was read from.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .look_records import ImageRecord, LightRecords, MaterialRecord, WorldRecord
from .not_shown import NotShown

BoolArray = npt.NDArray[np.bool_]
Int32Array = npt.NDArray[np.int32]
Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Usage = Literal["static", "rigid", "deforming", "changing"]
MeshKind = Literal["triangles", "curves", "points"]
CurveKind = Literal["poly", "catmull_rom"]
CurveShape = Literal["round", "ribbon"]
# Of a camera and an image, see `perfect_bvh.Camera` and `perfect_bvh.ImageTexture`; spelled out here because this is
# imported where the engine cannot be.
Projection = Literal["perspective", "orthographic", "equirectangular"]

# Bits of an instance's mask: which kinds of ray see it. They follow Blender's ray visibility.
VISIBLE_TO_CAMERA = 1 << 0
VISIBLE_TO_DIFFUSE = 1 << 1
VISIBLE_TO_GLOSSY = 1 << 2
VISIBLE_TO_TRANSMISSION = 1 << 3
VISIBLE_TO_VOLUME = 1 << 4
VISIBLE_TO_SHADOW = 1 << 5
VISIBLE_TO_ALL = 0x3F
# The bit of shadow catchers, separate from the visibility bits.
CATCHES_SHADOWS = 1 << 6

# The largest magnitude of coordinates and matrices that the engine accepts.
LARGEST_COORDINATE = 1e18


Layers = Mapping[str, Float32Array]


@dataclass(frozen=True, slots=True)
class LayerRequest:
    """Names of a mesh's uv maps and colours, and of uv maps along which tangents are needed; "" is the active one.

    Attributes:
        generated: Whether materials ask for places in the mesh's texture space.
    """

    uvs: frozenset[str] = frozenset()
    colors: frozenset[str] = frozenset()
    tangents: frozenset[str] = frozenset()
    generated: bool = False

    def __or__(self, other: LayerRequest) -> LayerRequest:
        if self.covers(other):
            return self
        if self is NO_LAYERS:
            return other
        names = (self.uvs | other.uvs, self.colors | other.colors, self.tangents | other.tangents)
        return LayerRequest(*names, self.generated or other.generated)

    def covers(self, other: LayerRequest) -> bool:
        """Whether it asks for all that the other asks for."""
        if self is other or other is NO_LAYERS:
            return True
        has_names = other.uvs <= self.uvs and other.colors <= self.colors and other.tangents <= self.tangents
        return has_names and other.generated <= self.generated


NO_LAYERS = LayerRequest()


@dataclass(frozen=True, slots=True)
class MeshRecord:
    """One distinct evaluated mesh, hair or point cloud.

    Attributes:
        key: Identifies the same mesh across evaluations (never a name or a pointer); two records of one scene never
            share it.
        positions: (V, 3) float32, object space.
        triangles: (T, 3) int32, rows of positions; Blender's own triangulation and order.
        polygon_ids: (T,) int32, the polygon each triangle came from.
        material_slots, corner_normals: Only if they were requested, see `AttributeRequest`.
        corner_uvs, corner_colors: (T, 3, 2) and (T, 3, 3) float32, the uv map and the colours that are active for
            renders.
        named_uvs, named_colors: Others by their names.
        layers: Those of them that were requested; the mesh may lack them.
        tangents, texture_space, corner_generated: See `perfect_bvh.MeshAppearance`; only if they were requested.
        dropped_triangles: The number of triangles left out because a vertex was not finite; `triangle_ids` then holds
            the original index of each kept triangle, and is None when all were kept.
        was_read: False if Blender is known not to have evaluated the mesh since the previous record. The arrays are
            that record's.
        usage: The expected changes, guessed from the object: none ("static"), other transforms ("rigid"),
            other positions ("deforming"), other triangles ("changing"). Sync corrects it by observed changes, see
            `plan`.
        usage_reason: The sentence that says why.
        remade_by: The name of the modifier that changes its triangles; "" if there is none.
        kind: The kind of primitive. For curves and points, `positions` are the curves' points or the points, without
            triangles. triangle_ids and dropped_triangles then count curves or points. material_slots is None or has one
            for each. uvs and colours are (R, 2) and (R, 3), R being the number of curves, or of their points.
        radii: (V,) float32, not negative.
        curve_offsets: (C + 1,) int64, of curves: the index of each one's first position.
        curve_kind: Straight from point to point, or bent through them, in `curve_pieces` from one to the next.
            curve_shape: round, or flat and facing the ray.
        rounding: The possible difference of its positions if they are read by another method.
    """

    key: Hashable
    name: str
    positions: Float32Array
    triangles: Int32Array
    polygon_ids: Int32Array
    material_slots: Int32Array | None = None
    corner_normals: Float32Array | None = None
    corner_uvs: Float32Array | None = None
    corner_colors: Float32Array | None = None
    named_uvs: Layers = field(default_factory=dict)
    named_colors: Layers = field(default_factory=dict)
    tangents: Layers = field(default_factory=dict)
    texture_space: Float32Array | None = None
    corner_generated: Float32Array | None = None
    layers: LayerRequest = NO_LAYERS
    dropped_triangles: int = 0
    triangle_ids: Int32Array | None = None
    usage: Usage = "static"
    usage_reason: str = "nothing animates it"
    remade_by: str = ""
    was_read: bool = True
    kind: MeshKind = "triangles"
    radii: Float32Array | None = None
    curve_offsets: npt.NDArray[np.int64] | None = None
    curve_kind: CurveKind = "poly"
    curve_shape: CurveShape = "round"
    curve_pieces: int = 8
    rounding: float = 0.0

    @property
    def form(self) -> tuple[Any, ...]:
        """The type of geometry, without its numbers."""
        pieces = 1 if self.curve_kind == "poly" else self.curve_pieces
        return (self.kind, self.curve_kind, self.curve_shape, pieces)

    @property
    def part_count(self) -> int:
        """How many triangles, curves or points it has: what hits distinguish by their `primitive_ids`."""
        if self.kind == "triangles":
            return len(self.triangles)
        return len(self.positions) if self.curve_offsets is None else len(self.curve_offsets) - 1

    def narrowed(self, layers: LayerRequest) -> MeshRecord:
        """The mesh without the layers that are not asked for."""
        if layers.covers(self.layers):
            return self
        return replace(
            self,
            layers=layers,
            corner_uvs=self.corner_uvs if "" in layers.uvs else None,
            corner_colors=self.corner_colors if "" in layers.colors else None,
            named_uvs={name: array for name, array in self.named_uvs.items() if name in layers.uvs},
            named_colors={name: array for name, array in self.named_colors.items() if name in layers.colors},
            tangents={name: array for name, array in self.tangents.items() if name in layers.tangents},
            texture_space=self.texture_space if layers.generated else None,
            corner_generated=self.corner_generated if layers.generated else None,
        )


# The arrays of a mesh, and those of the instances, in the order in which records are compared.
MESH_COLUMNS = (
    "positions",
    "triangles",
    "polygon_ids",
    "material_slots",
    "corner_normals",
    "corner_uvs",
    "corner_colors",
    "texture_space",
    "corner_generated",
    "triangle_ids",
    "radii",
    "curve_offsets",
)
MESH_LAYERS = ("named_uvs", "named_colors", "tangents")
INSTANCE_COLUMNS = ("mesh_indices", "object_indices", "parent_indices", "transforms", "masks", "persistent_ids")


@dataclass(frozen=True, slots=True)
class UnseenMesh:
    """A mesh in the scene that no ray can hit: it is neither read nor built.

    Attributes:
        source, session_uid: Its origin, as the first two parts of a `MeshRecord`'s key.
        reason: A sentence.
        owner, owner_uid: An object that has it.
    """

    name: str
    source: str
    session_uid: int
    reason: str
    owner: str
    owner_uid: int


@dataclass(frozen=True, slots=True)
class ObjectRecord:
    """One object that instances come from. material_slots: rows of the scene's materials, -1 if empty."""

    name: str
    session_uid: int
    pass_index: int
    material_slots: tuple[int, ...] = ()
    holdout: bool = False


@dataclass(frozen=True, slots=True)
class InstanceRecords:
    """I instances as columns.

    Columns that are the same as in the scene's record before may be the very same arrays.

    Attributes:
        mesh_indices, object_indices: (I,) int32, rows of the scene's meshes and objects.
        parent_indices: (I,) int32, the row in objects of the instancer, -1 for a plain object.
        transforms: (I, 3, 4) float32 object to world, as exact as Blender's own.
        masks: (I,) uint32, VISIBLE_TO_* bits.
        persistent_ids: (I, 8) int32, Blender's persistent id; zero for a plain object.
    """

    mesh_indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    object_indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    parent_indices: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    transforms: Float32Array = field(default_factory=lambda: np.empty((0, 3, 4), np.float32))
    masks: npt.NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, np.uint32))
    persistent_ids: Int32Array = field(default_factory=lambda: np.empty((0, 8), np.int32))

    def __len__(self) -> int:
        return len(self.mesh_indices)


@dataclass(frozen=True, slots=True)
class LensRecord:
    """The fields of `perfect_bvh.Lens`."""

    radius: float
    focus_distance: float
    blades: int
    rotation: float
    ratio: float


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """A camera with every setting folded into a view window; the fields of `perfect_bvh.Camera`."""

    matrix: Float64Array
    window: tuple[float, float, float, float]
    projection: Projection
    clip_start: float
    clip_end: float
    border: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 1.0)
    lens: LensRecord | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InstanceMotions:
    """Instances with as many steps. rows: (K,) int32, ascending, of the scene's. transforms: (S, K, 3, 4) float32."""

    rows: Int32Array
    transforms: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class MeshMotion:
    """A mesh that deforms. row: of the scene's. positions: (S, V, 3) float32. radii: (S, V), None for triangles."""

    row: int
    positions: Float32Array
    radii: Float32Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SceneMotion:
    """All motion within the shutter. instances: one for each number of steps. camera: at each step, or empty.

    Times are the engine's: 0 where the shutter opens, 1 where it closes. A motion with S steps has S samples at
    equal intervals from 0 to 1.
    """

    instances: tuple[InstanceMotions, ...] = ()
    meshes: tuple[MeshMotion, ...] = ()
    camera: tuple[CameraRecord, ...] = ()

    @property
    def count(self) -> int:
        """The number of instances and meshes that have a motion."""
        return sum(len(motions.rows) for motions in self.instances) + len(self.meshes)


@dataclass(frozen=True, slots=True)
class AttributeRequest:
    """Which attributes the coming rays will use; nothing else is read.

    Attributes:
        corner_uvs: The uv map of each mesh that is active for renders.
        shading: The data of materials other than their viewport colour, their images, the uv maps and colours of
            their meshes, the lights and the world.
    """

    material_slots: bool = True
    corner_normals: bool = False
    corner_uvs: bool = False
    shading: bool = False


@dataclass(frozen=True, slots=True)
class SceneRecord:
    """Everything read from one evaluated depsgraph at one frame, and its motion around that frame.

    Attributes:
        motion: Within the shutter that the scene was read for; nothing moves without one. All else is as at the frame.
        camera: None if the scene has none.
        size: (width, height) of a render in pixels, percentage applied.
        images, lights, world, instance_values: Only if shading was requested; without it there is no world.
        instance_values: (I, K, 4) float32, the values of each instance that nodes use; None if they use none.
        unseen: Meshes that were left out because nothing could show them.
        warnings: Sentences for the user (dropped triangles, objects that could not be read).
        not_shown: The parts that an image of it lacks or shows differently; of materials, lights and the world only if
            shading was requested.
    """

    name: str
    frame: float
    meshes: tuple[MeshRecord, ...]
    objects: tuple[ObjectRecord, ...]
    materials: tuple[MaterialRecord, ...]
    instances: InstanceRecords
    camera: CameraRecord | None
    size: tuple[int, int]
    film_transparent: bool = False
    plain_reflectance: float = 0.0  # of surfaces without a material
    pass_alpha_threshold: float = 0.0  # surfaces with less alpha are not in passes
    images: tuple[ImageRecord, ...] = ()
    lights: LightRecords = field(default_factory=LightRecords)
    world: WorldRecord | None = None
    instance_values: Float32Array | None = None
    unseen: tuple[UnseenMesh, ...] = ()
    warnings: tuple[str, ...] = ()
    not_shown: tuple[NotShown, ...] = ()
    motion: SceneMotion = field(default_factory=SceneMotion)

    @property
    def is_dark(self) -> bool:
        """Whether nothing shines: no light, no material, no world. Only a reading with shading knows that."""
        if self.world is None:
            return False
        worlds = (self.world, self.world.backdrop or self.world)
        shines = self.lights.powers.any() or any(any(item.emission) for item in self.materials)
        return not shines and not any(any(world.color) for world in worlds)
