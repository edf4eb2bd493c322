"""What instances have in common, looked up once for all of them: mesh, object, instancer, mask."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from ...sync.not_shown import Kind, NotShown
from ...sync.records import NO_LAYERS, LayerRequest, MeshRecord, ObjectRecord, UnseenMesh
from ..label_values import has_points
from ..looks.lights import LIGHT_LINKING, LIGHTS_ALL, lights_few
from ..looks.materials import MaterialReader
from ..visibility import VisibilityReader
from .curves_and_points import kind_of
from .mesh_table import NO_MESH, STRANDS, MeshTable
from .particle_hair import particle_hair_of

_Mesh, _PointCloud = bpy.types.Mesh, bpy.types.PointCloud  # looking them up is slow
NOT_SHOWN = -1
_NO_PARENT = -1
# Data that renderers show and rays do not meet; everything else without a mesh is silently no surface.
_UNREADABLE_TYPES = {
    "VOLUME": "volumes are not supported",
    "GREASEPENCIL": "grease pencil strokes are not triangles",
}
# What users can do about those that are not simply converted.
_ADVICE = {
    "volumes are not supported": "Add a mesh with a Volume to Mesh modifier that names this volume",
}
_OF_SCANS = "its points are not rendered; 3D viewports show them"
_OF_EDITED_HAIR = "its particle hair is not shown in Edit and Particle Edit Mode"
_OF_VOLUMES = "Add a surface shader to its material to show the object"
_OF_SUBDIVISION = "Raise the levels of the modifier until the surface is smooth enough"


class ObjectTable:
    """Gives each different `ObjectRecord` a row, in the order of first use.

    An object has a second row where its instances differ in what the record holds: in the materials of a mesh
    that geometry nodes made, or because one instancer is a holdout and another is not.
    """

    def __init__(self) -> None:
        self._rows: dict[tuple[Any, ...], int] = {}
        self.records: list[ObjectRecord] = []
        self.originals: list[Any] = []  # of the records, for as long as this evaluation is read

    def row(self, obj: Any, material_slots: tuple[int, ...] = (), holdout: bool = False) -> int:
        """The row of an evaluated object."""
        original = obj.original
        uid = original.session_uid
        key = (uid, material_slots, holdout)
        row = self._rows.get(key)
        if row is None:
            row = self._rows[key] = len(self.records)
            self.originals.append(original)
            self.records.append(ObjectRecord(original.name, uid, obj.pass_index, material_slots, holdout))
        return row


class AdaptiveSubdivision:
    """Finds the evaluated objects of a depsgraph that Cycles would subdivide itself, as finely as the image needs.

    Blender evaluates a number of levels instead.
    """

    def __init__(self, depsgraph: Any) -> None:
        self._for_viewport = depsgraph.mode == "VIEWPORT"
        # Before Blender 5.0 an object is asked for it, and only where experimental features are.
        self._is_experimental = getattr(getattr(depsgraph.scene, "cycles", None), "feature_set", "") == "EXPERIMENTAL"

    def is_asked_for(self, obj: Any) -> bool:
        """It is the last modifier that counts."""
        if not len(obj.modifiers):
            return False
        modifier = obj.modifiers[-1]
        if modifier.type != "SUBSURF" or not (modifier.show_viewport if self._for_viewport else modifier.show_render):
            return False
        is_asked = getattr(modifier, "use_adaptive_subdivision", None)
        return bool(self._is_experimental and obj.cycles.use_adaptive_subdivision if is_asked is None else is_asked)


@dataclass(slots=True)
class GroupTable:
    """Gives each different (mesh, object, instancer) a row; fills the tables it is given.

    rows: (mesh row, object row, instancer's object row or -1, mask, numbering) of each group. instances_lights: whether
    an instancer shows a light.
    """

    meshes: MeshTable
    materials: MaterialReader
    visibility: VisibilityReader
    subdivision: AdaptiveSubdivision
    objects: ObjectTable = field(default_factory=ObjectTable)
    warnings: list[str] = field(default_factory=list)
    not_shown: dict[NotShown, None] = field(default_factory=dict)  # in the order in which they are met
    rows: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    instances_lights: bool = False
    _warned: set[int] = field(default_factory=set)
    _left_out: dict[tuple[str, int], UnseenMesh] = field(default_factory=dict)

    def add(self, obj: Any, data: Any, *, parent: Any, is_own: bool, numbering: int = 0) -> int:
        """Returns the row of a new group, or NOT_SHOWN.

        obj: the evaluated object, or the depsgraph's temporary, that shows data. parent: the instancer or None.
        is_own: whether data is the object's own and not an additional result of geometry nodes. numbering: the
        numbering of the instances of this group.
        """
        self.instances_lights |= parent is not None and obj.type == "LIGHT"
        if self.visibility.is_hidden(obj, parent):
            return self._leave_out(obj, data, is_own, "its instancer is hidden")
        mask = self.visibility.mask(obj, parent)
        if mask == 0:
            return self._leave_out(obj, data, is_own, "its instancer is visible to no kind of ray")
        self._warn_of_unreadable(obj, data)
        if kind_of(data) is None or (not isinstance(data, _Mesh) and has_points(obj.original)):
            return NOT_SHOWN
        return self._add(obj, data, self.materials.slots(obj, data), mask, parent, is_own, numbering)

    def add_strands(self, obj: Any, source: Any, *, parent: Any, numbering: int = 0) -> int:
        """Returns the row of a new group of the strands of an object's particle systems, or NOT_SHOWN.

        source: the evaluated object itself, of which obj may be the depsgraph's temporary; the rest as for `add`.
        """
        hair = particle_hair_of(source, self.meshes.for_render)
        if hair is None or self.visibility.is_hidden(obj, parent):
            return NOT_SHOWN
        mask = self.visibility.mask(obj, parent)
        if mask == 0:
            return NOT_SHOWN
        if hair.is_edited:
            self._note(obj, _OF_EDITED_HAIR)
            return NOT_SHOWN
        return self._add(obj, hair, self.materials.slots(obj, obj.data), mask, parent, is_own=True, numbering=numbering)

    def _add(
        self, obj: Any, data: Any, slots: tuple[int, ...], mask: int, parent: Any, is_own: bool, numbering: int
    ) -> int:
        layers = self.materials.layers(slots)
        mesh_row = self.meshes.row(obj, data, is_own=is_own, layers=layers)
        if mesh_row == NO_MESH:
            return NOT_SHOWN
        if self.materials.are_volumes(slots):
            self._note(obj, "its material has a volume but no surface, so the object is invisible", advice=_OF_VOLUMES)
        self._note_simplified(obj, slots, obj if parent is None else parent, is_own)
        self._note_hair_on_surfaces(obj, slots, self.meshes.records[mesh_row])
        if layers is not NO_LAYERS:
            self._note_missing_layers(obj, slots, layers, self.meshes.records[mesh_row])
        object_row = self.objects.row(obj, slots, self.visibility.is_holdout(obj, parent))
        parent_row = _NO_PARENT if parent is None else self.objects.row(parent)
        self.rows.append((mesh_row, object_row, parent_row, mask, numbering))
        return len(self.rows) - 1

    def warn_of(self, group: int, text: str, advice: str) -> None:
        """Warns about a group's object: the part that is left out, and advice."""
        record = self.objects.records[self.rows[group][1]]
        told = NotShown("object", record.name, record.session_uid, text, advice)
        self.not_shown[told] = None
        self.warnings.append(str(told))

    @property
    def unseen(self) -> tuple[UnseenMesh, ...]:
        """Meshes that objects have and none shows."""
        seen = {record.key[:2] for record in self.meshes.records}  # type: ignore[index]
        return tuple([mesh for key, mesh in self._left_out.items() if key not in seen])

    def _leave_out(self, obj: Any, data: Any, is_own: bool, reason: str) -> int:
        if is_own and isinstance(data, _Mesh) and len(data.polygons):
            original = obj.original
            key = self.meshes.own_key(original)
            unseen = UnseenMesh(data.name, *key, reason, original.name, original.session_uid)
            self._left_out.setdefault(key, unseen)
        return NOT_SHOWN

    def _warn_of_unreadable(self, obj: Any, data: Any) -> None:
        reason = None
        if not isinstance(data, _Mesh):
            reason = _UNREADABLE_TYPES.get(obj.type)
            if isinstance(data, _PointCloud) and has_points(obj.original):
                reason = _OF_SCANS
        original = obj.original
        if reason is None or original.session_uid in self._warned:
            return
        self._warned.add(original.session_uid)
        is_scan = has_points(original)
        text = _OF_SCANS if is_scan else f"{reason}; left out"
        self.warnings.append(f"{original.name}: {text}")
        self._note(obj, text, "scan" if is_scan else "object", "" if is_scan else _ADVICE.get(reason, ""))

    def _note(self, obj: Any, text: str, kind: Kind = "object", advice: str = "") -> None:
        original = obj.original
        self.not_shown[NotShown(kind, original.name, original.session_uid, text, advice)] = None

    def _note_simplified(self, obj: Any, slots: tuple[int, ...], linked: Any, is_own: bool) -> None:
        """linked: what says whom it lights, if it shines."""
        if self.materials.shine(slots) and lights_few(linked):
            original, text = linked.original, f"{LIGHT_LINKING} is unsupported; {LIGHTS_ALL}"
            self.not_shown[NotShown("light", original.name, original.session_uid, text)] = None
        if is_own and self.subdivision.is_asked_for(obj):
            text = "its adaptive subdivision is unsupported; the modifier's levels are used"
            self._note(obj, text, "shape", _OF_SUBDIVISION)

    def _note_hair_on_surfaces(self, obj: Any, slots: tuple[int, ...], mesh: MeshRecord) -> None:
        if mesh.kind == "curves" or not self.materials.are_hair(slots):
            return
        numbers = [0] if mesh.material_slots is None else np.unique(mesh.material_slots).tolist()
        used = tuple([slots[min(max(number, 0), len(slots) - 1)] for number in numbers])
        if self.materials.are_hair(used):
            self._note(obj, "its hair shader works on curves only; a diffuse surface is used")

    def _note_missing_layers(self, obj: Any, slots: tuple[int, ...], wanted: LayerRequest, mesh: MeshRecord) -> None:
        """Notes layers that materials use and a mesh lacks. wanted: all that the materials of these slots use."""
        uvs = {name for name in wanted.uvs if (mesh.named_uvs.get(name) if name else mesh.corner_uvs) is None}
        colors = {
            name for name in wanted.colors if (mesh.named_colors.get(name) if name else mesh.corner_colors) is None
        }
        if not uvs and not colors:
            return
        for row in sorted({row for row in slots if row >= 0}):
            material, layers = self.materials.records[row], self.materials.layers((row,))
            owner = obj.original.name
            told = [
                f"{f'the UV map {name}'.strip()} is not found on {owner}; one pixel of the image is used"
                for name in sorted(layers.uvs & uvs)
            ]
            for name in sorted(layers.colors & colors):
                what = f"the attribute {name}".strip()
                if self._is_unfit_for_strands(obj, name, mesh):
                    told.append(
                        f"{what} of {owner} must be a Byte Color of face corners for particle hair; black is used"
                    )
                else:
                    told.append(f"{what} is not found on {owner}; black is used")
            for text in told:
                self.not_shown[NotShown("material", material.name, material.session_uid, text)] = None

    @staticmethod
    def _is_unfit_for_strands(obj: Any, name: str, mesh: MeshRecord) -> bool:
        """Whether the mesh is particle hair, whose emitter has an attribute of this name that hair cannot show."""
        is_strands = isinstance(mesh.key, tuple) and mesh.key[0] == STRANDS
        attribute = obj.data.attributes.get(name) if is_strands and name else None
        return attribute is not None and (attribute.data_type, attribute.domain) != ("BYTE_COLOR", "CORNER")
