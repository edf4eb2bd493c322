"""A digest of all that an image of a scene depends on, as Blender holds it: equal digests, equal images.

Blender describes its data to Python ("RNA"): each struct lists its properties. The walk starts at the scene, follows
every pointer and takes in every value, except those named here: they change no image of Cycles, or Blender derives them
from others. Unknown properties are taken in, so that additions by Blender or a test are not missed. Files are taken in
by their bytes, not by their paths.
"""

from __future__ import annotations

import hashlib
import os
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

# Of any struct: numbers of the process, properties for editors only, and values that Blender derives on the way.
PASSED_OVER = (
    "rna_type original session_uid users is_evaluated tag preview asset_data library library_weak_reference "
    "override_library is_library_indirect is_missing is_editable show_expanded is_embedded_data is_runtime_data "
    "name_full id_type use_fake_user select bl_icon bl_label"
)
# Of one struct. Images come in the scene's linear light, without compositing and sequencer, into files named elsewhere.
PASSED_OVER_OF = {
    "Scene": "tool_settings eevee display sequence_editor sequence_editors keying_sets keying_sets_all safe_areas "
    "cursor transform_orientation_slots compositing_node_group node_tree is_nla_tweakmode grease_pencil "
    "annotation frame_current_final view_settings display_settings",
    "ViewLayer": "depsgraph active_layer_collection active_aov_index",
    "RenderSettings": "filepath image_settings ffmpeg bake stamp_note_text frame_path",
    "Object": "matrix_world matrix_local bound_box dimensions mode display is_from_instancer",
    "FieldSettings": "seed",  # counts fields of the process; taken in where there is noise
    "Modifier": "execution_time",
    "Constraint": "error_location error_rotation",
    "ParticleSystem": "dt_frac",
    "PoseBone": "matrix matrix_channel head tail length",
    # The mesh's attributes hold these, except the first corner of each face and the weights, which are read separately.
    "Mesh": "vertices edges loops polygons loop_triangles loop_triangle_polygons vertex_normals polygon_normals "
    "corner_normals is_editmode",
    "Curves": "normals",  # worked out of the points, and not of equal bits in every process
    "Image": "pixels bindcode has_data is_dirty frame_duration render_slots",
}
OURS = "perfect_bvh"  # the add-on's own settings say nothing to Cycles
HANDLERS = ("render_init", "render_pre", "frame_change_pre", "frame_change_post", "depsgraph_update_post")
ARRAY_TYPES = {"BOOLEAN": np.bool_, "INT": np.int32, "FLOAT": np.float32}
# Blender 5.0 reports a wrong type for some of them, and returns memory beyond their end.
SELECTIONS = (".select", ".uv_select")
LONG = 64  # a collection of at least this many plain elements is read as arrays


def scene_digest(scene: bpy.types.Scene) -> str:
    """The digest, as hexadecimal digits; of Blender's version too."""
    walk = _Walk()
    walk.take(bpy.app.version_string, bpy.app.build_hash, *_handlers())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # every property is read, that which will go as well
        walk.visit_ids(scene)
    return walk.hash.hexdigest()


def _handlers() -> Iterator[str]:
    """Handlers that may change a scene while it is rendered, by name."""
    for name in HANDLERS:
        for function in getattr(bpy.app.handlers, name):
            if not function.__module__.startswith(OURS):
                yield f"{name} {function.__module__}.{function.__qualname__}"


class _Walk:
    def __init__(self) -> None:
        self.hash = hashlib.blake2b(digest_size=16)
        self._seen: dict[tuple[int, str], int] = {}
        self._waiting: list[bpy.types.ID] = []
        self._properties: dict[str, list[Any]] = {}

    def take(self, *values: object) -> None:
        """Take values in; each type writes itself down in one way."""
        self.hash.update(repr(values).encode("utf-8", "surrogateescape"))

    def take_array(self, array: np.ndarray) -> None:
        self.take(array.dtype.str, array.shape)
        self.hash.update(np.ascontiguousarray(array).data)

    def _take_unseen(self) -> None:
        """Make the digest differ from all others: Python cannot read this part of the scene."""
        self.hash.update(os.urandom(16))

    def visit_ids(self, first: bpy.types.ID) -> None:
        """Take in a datablock and all that it leads to. Each in its turn: nested, they would be too deep."""
        self._point_to(first)
        while self._waiting:
            item = self._waiting.pop()
            self.take("datablock", item.bl_rna.identifier, item.name)
            self._visit(item)
            if isinstance(item, bpy.types.Mesh):
                self._visit_mesh(item)
            elif isinstance(item, bpy.types.Object):
                self._visit_weights(item)
            elif isinstance(item, bpy.types.Image):
                self._visit_image(item)

    def _point_to(self, item: Any) -> None:
        """Take in a reference to the struct; take in its content once."""
        key = (item.as_pointer(), item.bl_rna.identifier)
        is_new = key not in self._seen
        self.take(self._seen.setdefault(key, len(self._seen)))
        if not is_new:
            return
        if isinstance(item, bpy.types.ID) and not item.is_embedded_data:
            self._waiting.append(item)
        else:
            self._visit(item)

    def _visit(self, item: Any) -> None:
        self.take(item.bl_rna.identifier)
        if isinstance(item, bpy.types.FluidDomainSettings) or (
            isinstance(item, bpy.types.PointCache) and item.is_baked
        ):
            self._take_unseen()
        elif isinstance(item, bpy.types.FieldSettings) and item.noise:
            self.take(item.seed)
        for prop in self._properties_of(item):
            self.take(prop.identifier)
            if prop.type == "POINTER":
                value = getattr(item, prop.identifier)
                self.take(None) if value is None else self._point_to(value)
            elif prop.type == "COLLECTION":
                self._visit_collection(getattr(item, prop.identifier), prop)
            else:
                self._visit_value(item, prop)
        self._visit_custom(item)

    def _properties_of(self, item: Any) -> list[Any]:
        kind = item.bl_rna.identifier
        if kind not in self._properties:
            passed_over = set(PASSED_OVER.split()).union(
                *(names.split() for name, names in PASSED_OVER_OF.items() if isinstance(item, getattr(bpy.types, name)))
            )
            self._properties[kind] = [
                prop
                for prop in item.bl_rna.properties
                if prop.identifier not in passed_over and not prop.identifier.startswith(OURS)
            ]
        return self._properties[kind]

    def _visit_value(self, item: Any, prop: Any) -> None:
        value = getattr(item, prop.identifier)
        if isinstance(value, str) and prop.subtype == "FILE_PATH":
            self._take_files(item, value)
        elif isinstance(value, set):
            self.take(sorted(value))
        elif getattr(prop, "is_array", False):
            self.take_array(np.array(value, ARRAY_TYPES[prop.type]))
        else:
            self.take(value)

    def _visit_collection(self, items: Any, collection: Any) -> None:
        self.take(len(items))
        for prop in collection.srna.properties if collection.srna is not None else ():  # which layer is rendered
            if prop.type in ("BOOLEAN", "INT", "STRING") and prop.identifier not in PASSED_OVER.split():
                self.take(prop.identifier, getattr(items, prop.identifier))
        if len(items) >= LONG and self._is_plain(items[0]):
            for prop in self._properties_of(items[0]):
                self.take(prop.identifier)
                shape = (len(items), prop.array_length) if prop.is_array else (len(items),)
                array = np.empty(shape, ARRAY_TYPES[prop.type])
                items.foreach_get(prop.identifier, array.reshape(-1))
                self.take_array(array)
            return
        for item in items:
            if isinstance(item, bpy.types.Attribute) and item.name.startswith(SELECTIONS):
                continue
            self.take(None) if item is None else self._point_to(item)

    def _is_plain(self, item: Any) -> bool:
        """Whether numbers are all there is to it."""
        return item is not None and all(prop.type in ARRAY_TYPES for prop in self._properties_of(item))

    def _visit_custom(self, item: Any) -> None:
        """Take in properties that are no part of Blender's own: inputs of geometry nodes, of users and add-ons."""
        try:
            names = [name for name in item.keys() if not name.startswith(OURS)]  # noqa: SIM118 (no mapping)
        except TypeError:
            return  # this struct can have none
        for name in names:
            self.take(name)
            self._visit_custom_value(item[name])

    def _visit_custom_value(self, value: Any) -> None:
        if isinstance(value, bpy.types.ID):
            self._point_to(value)
        elif hasattr(value, "to_dict"):
            for name in value.keys():  # noqa: SIM118 (no mapping)
                self.take(name)
                self._visit_custom_value(value[name])
        elif isinstance(value, list):
            for item in value:
                self._visit_custom_value(item)
        else:
            self.take(value.to_list() if hasattr(value, "to_list") else value)

    def _visit_mesh(self, mesh: bpy.types.Mesh) -> None:
        starts = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("loop_start", starts)
        self.take_array(starts)

    def _visit_weights(self, obj: bpy.types.Object) -> None:
        """Take in how much of each vertex group each vertex has. Without groups Blender's answer is not to be asked."""
        if isinstance(obj.data, bpy.types.Mesh) and obj.vertex_groups:
            self.take([[(each.group, each.weight) for each in vertex.groups] for vertex in obj.data.vertices])

    def _visit_image(self, image: bpy.types.Image) -> None:
        """Take in its pixels, where no file holds them. Of tiles Python sees the first alone."""
        if image.source == "TILED" and image.is_dirty:
            self._take_unseen()
        elif image.source == "GENERATED" or image.is_dirty:
            pixels = np.empty(len(image.pixels), np.float32)
            image.pixels.foreach_get(pixels)
            self.take_array(pixels)

    def _take_files(self, item: Any, path: str) -> None:
        """Take in the bytes of a file; of a sequence or of tiles, of all files whose names differ in numbers alone."""
        if not path:
            return
        library = item.id_data.library if item.id_data is not None else None
        whole = Path(bpy.path.abspath(path, library=library))
        pattern = re.sub(r"<[A-Z]+>|\d+", "*", re.sub(r"\[|\]", "?", whole.name))
        is_many = getattr(item, "source", "") in ("TILED", "SEQUENCE") or getattr(item, "is_sequence", False)
        for file in sorted(whole.parent.glob(pattern)) if is_many else [whole]:
            self.take(file.name if is_many else "file", file.read_bytes() if file.is_file() else None)
