"""One moment of a shutter: where everything is, read with what the reading of the frame has left."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import Any

from ..events.changes import watched_evaluations
from ..events.evaluation_log import EvaluationLog
from ..sync.moments import MomentRecord
from ..sync.records import AttributeRequest, InstanceRecords, MeshRecord, ObjectRecord
from .camera import read_frame
from .geometry.groups import GroupTable
from .geometry.instances import read_instances
from .geometry.mesh_table import MeshTable
from .geometry.subdivision import AdaptiveSubdivision
from .looks.materials import MaterialReader
from .read_again import read_again
from .scene import ReadCache, read_any_camera, shared_reader
from .visibility import VisibilityReader, outside_viewports

Things = tuple[tuple[MeshRecord, ...], tuple[ObjectRecord, ...], InstanceRecords]


def read_moment(
    depsgraph: Any,
    attributes: AttributeRequest,
    cache: ReadCache,
    *,
    for_viewport: bool | None,
    camera: Any,
    size: tuple[int, int] | None,
    space: Any,
) -> MomentRecord:
    """Where things are in an evaluated depsgraph: of a mesh that is read again no attribute is.

    cache: of the frame's reading, with these attributes; it stays as it is. The rest is as for `read_scene`.
    """
    if for_viewport is None:
        for_viewport = depsgraph.mode == "VIEWPORT"
    log = watched_evaluations(depsgraph)
    visibility = VisibilityReader(depsgraph, for_viewport, space)
    with outside_viewports() if for_viewport else nullcontext():
        parts = read_again(cache.plain, depsgraph, attributes, visibility, log, cache.images)
        if parts is not None:
            meshes, objects, instances = parts.meshes, parts.objects, parts.instances
        else:
            meshes, objects, instances = _read_things(depsgraph, attributes, visibility, cache, log)
    meshes = replace(cache.hair).shaped(meshes, depsgraph.scene)
    record, complaint = read_any_camera(depsgraph, camera, read_frame(depsgraph.scene_eval, size))
    return MomentRecord(meshes, objects, instances, record, complaint)


def _read_things(
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    cache: ReadCache,
    log: EvaluationLog | None,
) -> Things:
    meshes = MeshTable(depsgraph, attributes, shared_reader, cache.meshes, log, only_places=True)
    materials = MaterialReader(depsgraph.view_layer_eval.material_override)
    groups = GroupTable(meshes, materials, visibility, AdaptiveSubdivision(depsgraph))
    instances = read_instances(depsgraph, groups, shared_reader, replace(cache.instances))
    return tuple(meshes.records), tuple(groups.objects.records), instances
