"""The way in: one evaluated depsgraph -> one `SceneRecord`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..sync.records import AttributeRequest, CameraRecord, LightRecords, SceneRecord
from .camera import read_camera, read_frame
from .changes import watched_geometry
from .groups import GroupTable
from .images import ImageCache, ImageReader
from .instances import InstanceCache, read_instances
from .lights import read_lights, read_world
from .materials import MaterialReader
from .mesh_cache import MeshCache
from .mesh_table import MeshTable
from .pointer_views import ArrayReader
from .visibility import VisibilityReader

# Layouts that were proven or refuted hold for the whole process.
_shared_reader = ArrayReader()


@dataclass(slots=True)
class ReadCache:
    """What the last reading of a scene leaves for the next one, which is the faster for it and gives the same."""

    meshes: MeshCache = field(default_factory=MeshCache)
    instances: InstanceCache = field(default_factory=InstanceCache)
    images: ImageCache = field(default_factory=ImageCache)


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
) -> SceneRecord:
    """Copies everything that a render of an evaluated depsgraph needs. Main thread only; nothing of Blender is kept.

    attributes: what to read beside the triangles; by default the material slots and viewport colours.
    for_viewport: whether viewport or render visibility counts; by default what the depsgraph was made for. A
        viewport depsgraph that is asked for render visibility leaves out what a render hides, but has
        neither what the viewport hides nor the modifiers' render settings.
    camera: an object or a `CameraRecord` instead of the scene's active camera.
    size: (width, height) in pixels instead of the scene's render size.
    space: the 3D viewport (`SpaceView3D`) whose local view and filters count.
    reader: how arrays are read; by default the process's own, see `ArrayReader`.
    cache: what the last reading left; without it everything is read anew, whatever is known of changes.

    An empty scene is an empty record. What cannot be read is left out and named in the record's warnings.
    """
    scene = depsgraph.scene_eval
    view_layer = depsgraph.view_layer_eval
    if for_viewport is None:
        for_viewport = depsgraph.mode == "VIEWPORT"
    log = None if cache is None else watched_geometry(depsgraph)
    cache = cache or ReadCache()
    reader = reader or _shared_reader
    attributes = attributes or AttributeRequest()
    meshes = MeshTable(depsgraph, attributes, reader, cache.meshes, log)
    images = ImageReader(cache.images)
    materials = MaterialReader(view_layer.material_override, images if attributes.shading else None)
    visibility = VisibilityReader(depsgraph, for_viewport, space)
    groups = GroupTable(meshes, materials, visibility)
    warnings: list[str] = []
    instances = read_instances(depsgraph, groups, reader, cache.instances, warnings)
    lights = read_lights(depsgraph, visibility) if attributes.shading else LightRecords()
    world = read_world(scene, images) if attributes.shading else None
    cache.meshes = meshes.cache
    cache.images = images.cache

    frame = read_frame(scene, size)
    camera_record, complaint = _read_any_camera(depsgraph, scene.camera if camera is None else camera, frame)
    warnings = [*meshes.warnings, *groups.warnings, *images.warnings, *warnings, *([complaint] if complaint else [])]
    return SceneRecord(
        name=scene.name,
        frame=scene.frame_current_final,
        meshes=tuple(meshes.records),
        objects=tuple(groups.objects.records),
        materials=tuple(materials.records),
        instances=instances,
        camera=camera_record,
        size=(frame.width, frame.height),
        film_transparent=scene.render.film_transparent,
        images=tuple(images.records),
        lights=lights,
        world=world,
        warnings=tuple(warnings),
    )


def _read_any_camera(depsgraph: Any, camera: Any, frame: Any) -> tuple[CameraRecord | None, str | None]:
    if isinstance(camera, CameraRecord):
        return camera, None
    if camera is not None and not camera.is_evaluated:
        camera = camera.evaluated_get(depsgraph)
    return read_camera(camera, frame)
