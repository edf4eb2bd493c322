"""The way in: one evaluated depsgraph -> one `SceneRecord`."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

from ..events.asking import EvaluationLog
from ..events.changes import watched_evaluations
from ..sync.look_records import LightRecords
from ..sync.not_shown import NotShown
from ..sync.records import AttributeRequest, CameraRecord, SceneRecord
from .camera import Frame, read_camera, read_frame
from .geometry.geometry_instances import InstanceCache, read_instances
from .geometry.groups import AdaptiveSubdivision, GroupTable
from .geometry.hair_shape import ShapedHair
from .geometry.instance_columns import InstanceColumns
from .geometry.mesh_table import MeshCache, MeshTable
from .ignored_settings import find_ignored_settings
from .label_values import find_missing_libraries
from .looks.images import ImageCache, ImageReader
from .looks.lights import read_lights, read_world
from .looks.materials import PLAIN_REFLECTANCE, MaterialReader, instance_values
from .pointer_views import ArrayReader
from .read_again import PlainReading, SceneParts, read_again, remember
from .visibility import VisibilityReader, outside_viewports

DARK = NotShown("dark", "No light", 0, "no light, world or material emits light; the image is black")
# Layouts that were proven or refuted hold for the whole process.
shared_reader = ArrayReader()


@dataclass(slots=True)
class ReadCache:
    """The data of the last reading that makes the next one faster, with the same result."""

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
    """Copies everything that a render of an evaluated depsgraph needs. No references to Blender are kept.

    attributes: the data to read in addition to triangles; by default the material slots and viewport colours.
    for_viewport: whether viewport or render visibility counts; by default the depsgraph's purpose. With render
        visibility, a viewport depsgraph leaves out objects that a render hides, but has
        neither objects that the viewport hides nor the modifiers' render settings.
    camera: an object, a `CameraRecord`, or a function of the depsgraph that returns one or None, instead of the scene's
        active camera.
    size: (width, height) in pixels instead of the scene's render size.
    space: the 3D viewport (`SpaceView3D`) whose local view and filters count.
    reader: reads arrays; by default the process's own, see `ArrayReader`.
    cache: the last reading's; without it everything is read, for any known changes.
    in_time: the reading is for motion blur, which then is not listed as an ignored setting.
    for_preview: the depsgraph is of one of Blender's previews, on a thread that runs while the user edits. Only
        the depsgraph is used, neither the open file nor the log of changes, and only the images of a cache.

    Main thread only, or a render's own.

    An empty scene is an empty record. Data that cannot be read is left out and listed in the record's warnings.
    """
    if for_viewport is None:
        for_viewport = depsgraph.mode == "VIEWPORT"
    log = None if cache is None or for_preview else watched_evaluations(depsgraph)
    cache = cache or ReadCache()
    attributes = attributes or AttributeRequest()
    if for_preview:
        reader = ArrayReader(use_views=False)  # a few small meshes; the check of layouts is shared otherwise
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
            images = ImageReader(cache.images, depsgraph.scene_eval.frame_current, for_preview=for_preview)
            lights = read_lights(depsgraph, visibility, images, not_shown, instanced=parts.instances_lights)
    not_shown += find_ignored_settings(depsgraph, attributes, for_viewport, in_time)
    record = _record_of(depsgraph, parts, cache.hair, lights, camera, read_frame(depsgraph.scene_eval, size))
    return replace(record, not_shown=(*([DARK] if record.is_dark else []), *not_shown))


def _record_of(
    depsgraph: Any, parts: SceneParts, hair: ShapedHair, lights: LightRecords, camera: Any, frame: Frame
) -> SceneRecord:
    """Returns the whole record without its `not_shown`. camera: as `read_scene` takes it."""
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
        instance_values=parts.instance_values,
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
    images = ImageReader(cache.images, depsgraph.scene_eval.frame_current, for_preview=for_preview)
    materials = MaterialReader(depsgraph.view_layer_eval.material_override, images if attributes.shading else None)
    groups = GroupTable(meshes, materials, visibility, AdaptiveSubdivision(depsgraph))
    instances = read_instances(depsgraph, groups, reader, cache.instances)
    of_world: list[NotShown] = []
    world = read_world(depsgraph.scene_eval, images, of_world) if attributes.shading else None
    columns = InstanceColumns(depsgraph, groups.objects, instances, cache.instances.random_ids)
    cache.meshes, cache.images = meshes.cache, images.cache
    return SceneParts(
        meshes=tuple(meshes.records),
        objects=tuple(groups.objects.records),
        materials=tuple(materials.records),
        images=tuple(images.records),
        instances=instances,
        world=world,
        instance_values=instance_values(materials.sources, columns.of),
        materials_follow=materials.follow_objects,
        unseen=groups.unseen,
        instances_lights=groups.instances_lights,
        warnings=(*meshes.warnings, *groups.warnings, *map(str, images.not_shown)),
        not_shown=(*meshes.not_shown, *groups.not_shown, *materials.not_shown, *images.not_shown, *of_world),
    )


def read_any_camera(depsgraph: Any, camera: Any, frame: Frame) -> tuple[CameraRecord | None, str | None]:
    """Read the camera, and the reason if there is none. camera: as `read_scene` takes it."""
    if callable(camera):
        return camera(depsgraph), None
    if isinstance(camera, CameraRecord):
        return camera, None
    if camera is not None and not camera.is_evaluated:
        camera = camera.evaluated_get(depsgraph)
    return read_camera(camera, frame)
