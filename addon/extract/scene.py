"""The way in: one evaluated depsgraph -> one `SceneRecord`."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import place_instances

from ..events.asking import EvaluationLog
from ..events.changes import watched_evaluations
from ..sync.not_shown import NotShown
from ..sync.records import (
    LARGEST_COORDINATE,
    AttributeRequest,
    CameraRecord,
    ImageRecord,
    InstanceRecords,
    Int32Array,
    LightRecords,
    MaterialRecord,
    MaterialVariants,
    MeshRecord,
    ObjectRecord,
    SceneRecord,
    UnseenMesh,
    WorldRecord,
)
from .camera import Frame, read_camera, read_frame
from .geometry.curves_and_points import ShapedHair
from .geometry.geometry_instances import InstanceCache, read_instances
from .geometry.groups import AdaptiveSubdivision, GroupTable
from .geometry.instance_columns import InstanceColumns
from .geometry.instancer_survey import SILENT_TYPES
from .geometry.mesh_table import MeshCache, MeshTable
from .ignored_settings import find_ignored_settings
from .label_values import find_missing_libraries
from .looks.images import ImageCache, ImageReader
from .looks.lights import lights_few, read_lights, read_world
from .looks.materials import PLAIN_REFLECTANCE, MaterialReader, read_variants
from .pointer_views import ArrayReader
from .visibility import VisibilityReader, outside_viewports

# Reads again a scene of plain objects of which Blender has evaluated nothing but places and settings.
#
# Asking every object everything takes longer than all else of a frame in which one of ten thousand moved. Here all are
# asked who they are and where, and only those that Blender names are asked more. Whatever else may have changed, the
# scene is read as the first time.


_NOT_SHOWN = -1


@dataclass(frozen=True, slots=True)
class SceneParts:
    """A reading but for the camera and the lights, which are read every time."""

    meshes: tuple[MeshRecord, ...]
    objects: tuple[ObjectRecord, ...]
    materials: tuple[MaterialRecord, ...]
    images: tuple[ImageRecord, ...]
    instances: InstanceRecords
    world: WorldRecord | None
    variants: MaterialVariants | None
    unseen: tuple[UnseenMesh, ...]
    instances_lights: bool
    warnings: tuple[str, ...]
    not_shown: tuple[NotShown, ...]


@dataclass(frozen=True, slots=True)
class PlainReading:
    """A reading of nothing but plain objects, with what tells whether it still holds.

    attributes, graph, look: what was read, of which depsgraph (its address), as who would see it. since: the log's
    time. uids: of all evaluated objects. rows: (N,) int32, of each of them, its row among the instances, or -1.
    """

    parts: SceneParts
    attributes: AttributeRequest
    graph: int
    look: tuple[Any, ...]
    since: int
    uids: list[int]
    rows: Int32Array


def remember(
    parts: SceneParts,
    shown: npt.NDArray[np.bool_] | None,
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    log: EvaluationLog | None,
) -> PlainReading | None:
    """None if it cannot be read again.

    shown: which of the evaluated objects are instances; None if there are others.
    """
    look = visibility.look
    if shown is None or log is None or look is None:
        return None
    if parts.variants is not None:  # which objects' properties they depend on is not kept
        return None
    originals = [obj.original for obj in depsgraph.objects]
    # What is edited or sculpted may change without a notice from Blender: it is read every time.
    if len(originals) != len(shown) or any(original.mode != "OBJECT" for original in originals):
        return None
    uids = [original.session_uid for original in originals]
    rows = np.where(shown, np.cumsum(shown) - 1, _NOT_SHOWN).astype(np.int32)
    return PlainReading(parts, attributes, depsgraph.as_pointer(), look, log.now, uids, rows)


def read_again(
    last: PlainReading | None,
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    log: EvaluationLog | None,
    images: ImageCache,
) -> SceneParts | None:
    """The last reading with today's transforms, or None if that may not be all that changed."""
    if last is None or log is None or last.attributes != attributes or last.look != visibility.look:
        return None
    graph = depsgraph.as_pointer()
    touched = log.find_touched(graph, last.since) if graph == last.graph else None
    if touched is None or not images.is_current():
        return None
    objects = list(depsgraph.objects)
    uids = [obj.original.session_uid for obj in objects]
    if uids != last.uids:
        return None
    for obj, uid, row in zip(objects, uids, last.rows.tolist(), strict=True):
        if uid in touched and not _is_as_before(obj, row, last.parts, visibility):
            return None
    matrices = np.empty((len(objects), 4, 4), np.float32)
    depsgraph.objects.foreach_get("matrix_world", matrices.reshape(-1))
    shown = matrices[last.rows != _NOT_SHOWN]
    transforms = np.empty((len(shown), 3, 4), np.float32)
    if len(place_instances(None, shown, transforms, LARGEST_COORDINATE)):
        return None
    return replace(last.parts, instances=replace(last.parts.instances, transforms=transforms))


def _is_as_before(obj: Any, row: int, parts: SceneParts, visibility: VisibilityReader) -> bool:
    """Whether an evaluated object differs in its transform alone, if at all."""
    if obj.original.mode != "OBJECT" or obj.is_instancer:
        return False
    uid = obj.original.session_uid
    if lights_few(obj) or any(row.session_uid == uid for row in parts.not_shown if row.kind == "light"):
        return False  # what is said of its light may be so no more
    if row == _NOT_SHOWN:
        return obj.type in SILENT_TYPES
    record = parts.objects[parts.instances.object_indices[row]]
    slots = tuple(
        [None if slot.material is None else slot.material.original.session_uid for slot in obj.material_slots]
    )
    return bool(
        not visibility.is_hidden(obj, None)
        and visibility.mask(obj, None) == parts.instances.masks[row]
        and visibility.is_holdout(obj, None) == record.holdout
        and (obj.original.name, obj.pass_index) == (record.name, record.pass_index)
        and slots == tuple([None if slot < 0 else parts.materials[slot].session_uid for slot in record.material_slots])
    )


# Scene ---------------------------------------------------------------------------------------------------------------


DARK = NotShown("dark", "No light", 0, "neither a light, the world nor a material shines; the image is black")
# Layouts that were proven or refuted hold for the whole process.
shared_reader = ArrayReader()


@dataclass(slots=True)
class ReadCache:
    """What the last reading of a scene leaves for the next one, which is the faster for it and gives the same."""

    meshes: MeshCache = field(default_factory=MeshCache)
    instances: InstanceCache = field(default_factory=InstanceCache)
    images: ImageCache = field(default_factory=ImageCache)
    hair: ShapedHair = field(default_factory=ShapedHair)
    plain: PlainReading | None = None


def read_scene(
    depsgraph: Any,
    attributes: AttributeRequest | None = None,
    *,
    for_viewport: bool | None = None,
    camera: Any = None,
    size: tuple[int, int] | None = None,
    space: Any = None,
    reader: ArrayReader | None = None,
    cache: ReadCache | None = None,
    for_preview: bool = False,
    in_time: bool = False,
) -> SceneRecord:
    """Copies everything that a render of an evaluated depsgraph needs. Nothing of Blender is kept.

    attributes: what to read beside the triangles; by default the material slots and viewport colours.
    for_viewport: whether viewport or render visibility counts; by default what the depsgraph was made for. A
        viewport depsgraph that is asked for render visibility leaves out what a render hides, but has
        neither what the viewport hides nor the modifiers' render settings.
    camera: an object, a `CameraRecord`, or a function of the depsgraph that gives one or None, instead of the scene's
        active camera.
    size: (width, height) in pixels instead of the scene's render size.
    space: the 3D viewport (`SpaceView3D`) whose local view and filters count.
    reader: how arrays are read; by default the process's own, see `ArrayReader`.
    cache: what the last reading left; without it everything is read, whatever is known of changes.
    in_time: this is for motion blur, which then is not named as a setting that is not asked.
    for_preview: the depsgraph is of one of Blender's previews, and this a thread beside the user's edits: nothing but
        the depsgraph is asked, neither the open file nor the log of changes, and of a cache only images are used.

    Main thread only, or a render's own.

    An empty scene is an empty record. What cannot be read is left out and named in the record's warnings.
    """
    if for_viewport is None:
        for_viewport = depsgraph.mode == "VIEWPORT"
    log = None if cache is None or for_preview else watched_evaluations(depsgraph)
    cache = cache or ReadCache()
    attributes = attributes or AttributeRequest()
    if for_preview:
        reader = ArrayReader(use_views=False)  # a few small meshes; what is found out of layouts is shared otherwise
    visibility = VisibilityReader(depsgraph, for_viewport, space)
    with outside_viewports() if for_viewport else nullcontext():
        parts = read_again(cache.plain, depsgraph, attributes, visibility, log, cache.images)
        if parts is None:
            reader = reader or shared_reader
            parts = _read_parts(depsgraph, attributes, visibility, reader, cache, log, for_preview)
            cache.plain = remember(parts, cache.instances.shown, depsgraph, attributes, visibility, log)
        not_shown = [*([] if for_preview else find_missing_libraries()), *parts.not_shown]
        lights = LightRecords()
        if attributes.shading:
            images = ImageReader(cache.images, for_preview=for_preview)
            lights = read_lights(depsgraph, visibility, images, not_shown, instanced=parts.instances_lights)
    not_shown += find_ignored_settings(depsgraph, attributes, for_viewport, in_time)
    record = _record_of(depsgraph, parts, cache.hair, lights, camera, read_frame(depsgraph.scene_eval, size))
    return replace(record, not_shown=(*([DARK] if record.is_dark else []), *not_shown))


def _record_of(
    depsgraph: Any, parts: SceneParts, hair: ShapedHair, lights: LightRecords, camera: Any, frame: Frame
) -> SceneRecord:
    """The whole record but for its list of what is not shown. camera: as `read_scene` takes it."""
    scene = depsgraph.scene_eval
    camera_record, complaint = read_any_camera(depsgraph, scene.camera if camera is None else camera, frame)
    return SceneRecord(
        name=scene.name,
        frame=scene.frame_current_final,
        meshes=hair.shaped(parts.meshes, depsgraph.scene),
        objects=parts.objects,
        materials=parts.materials,
        instances=parts.instances,
        camera=camera_record,
        size=(frame.width, frame.height),
        film_transparent=scene.render.film_transparent,
        plain_reflectance=PLAIN_REFLECTANCE,
        pass_alpha_threshold=depsgraph.view_layer.pass_alpha_threshold,
        images=parts.images,
        lights=lights,
        world=parts.world,
        variants=parts.variants,
        unseen=parts.unseen,
        warnings=(*parts.warnings, *([complaint] if complaint else [])),
    )


def _read_parts(
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    reader: ArrayReader,
    cache: ReadCache,
    log: EvaluationLog | None,
    for_preview: bool,
) -> SceneParts:
    meshes = MeshTable(depsgraph, attributes, reader, cache.meshes, log)
    images = ImageReader(cache.images, for_preview=for_preview)
    materials = MaterialReader(depsgraph.view_layer_eval.material_override, images if attributes.shading else None)
    groups = GroupTable(meshes, materials, visibility, AdaptiveSubdivision(depsgraph))
    instances = read_instances(depsgraph, groups, reader, cache.instances)
    of_world: list[NotShown] = []
    world = read_world(depsgraph.scene_eval, images, of_world) if attributes.shading else None
    columns = InstanceColumns(depsgraph, groups.objects, instances, cache.instances.random_ids)
    variants = read_variants(materials.records, materials.asking, groups.objects.records, instances, columns.of, images)
    cache.meshes, cache.images = meshes.cache, images.cache
    return SceneParts(
        meshes=tuple(meshes.records),
        objects=tuple(groups.objects.records),
        materials=tuple(materials.records),
        images=tuple(images.records),
        instances=instances,
        world=world,
        variants=variants,
        unseen=groups.unseen,
        instances_lights=groups.instances_lights,
        warnings=(*meshes.warnings, *groups.warnings, *map(str, images.not_shown)),
        not_shown=(*meshes.not_shown, *groups.not_shown, *materials.not_shown, *images.not_shown, *of_world),
    )


def read_any_camera(depsgraph: Any, camera: Any, frame: Frame) -> tuple[CameraRecord | None, str | None]:
    """What looks, and why it cannot if there is none. camera: as `read_scene` takes it."""
    if callable(camera):
        return camera(depsgraph), None
    if isinstance(camera, CameraRecord):
        return camera, None
    if camera is not None and not camera.is_evaluated:
        camera = camera.evaluated_get(depsgraph)
    return read_camera(camera, frame)
