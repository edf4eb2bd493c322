"""The distinct meshes of one evaluation: each is read once, for any number of objects, and gets a key that lasts.

Evaluated meshes have new addresses and new session uids at every evaluation, so neither can be a key. The
object or mesh data-block that a mesh came from stays the same:

- ("mesh", uid of the data-block): shown unmodified, by any number of objects;
- ("object", uid of the object): the result of an object's modifiers, or of its curve, text or metaball;
- ("made", uid of the object, digest of the triangles): made by geometry nodes and shown as instances. The
  digest leaves the positions out, so that such a mesh is still the same one when it deforms;
- ("particle hair", uid of the object): the strands of all its particle systems.

Curves and points have such keys with their kind in the first word.

A last number distinguishes keys that would otherwise be equal.
"""

from __future__ import annotations

import hashlib
import zlib
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import numpy.typing as npt
from perfect_bvh.bulk import are_equal

from ...events.asking import EvaluationLog
from ...sync.compare import have_same_layers
from ...sync.not_shown import NotShown
from ...sync.records import MESH_COLUMNS, NO_LAYERS, AttributeRequest, LayerRequest, MeshRecord
from ..pointer_views import ArrayReader
from .curves_and_points import kind_of, read_curves_or_points
from .instancer_survey import find_remaker, guess_usage
from .meshes import read_mesh
from .particle_hair import ParticleHair, read_particle_hair

# The meshes of the last reading: those not evaluated since are not read, and equal ones are not copied.


Place = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class CachedMesh:
    """place: where the mesh was, see `place_of`. uids: whose evaluation would have changed it."""

    record: MeshRecord
    place: Place
    uids: tuple[int, ...]


@dataclass(slots=True)
class MeshCache:
    """One reading's meshes by token, and the state of the evaluation log at that time.

    A token identifies a mesh before it is read: its origin, and a number among others of that origin.
    """

    meshes: dict[Hashable, CachedMesh] = field(default_factory=dict)
    attributes: AttributeRequest | None = None
    graph: int = 0
    since: int = -1  # the log's time, -1 if there was no log

    def find_untouched(
        self, token: Hashable, mesh: Any, uids: tuple[int, ...], reading: MeshCache, log: EvaluationLog | None
    ) -> CachedMesh | None:
        """Return the cached mesh if a reading would surely give the same. reading: the new cache.

        An unchanged address proves nothing, but a changed one is reason enough to read the mesh.
        """
        cached = self.meshes.get(token)
        if cached is None or log is None or self.since < 0:
            return None
        if self.graph != reading.graph or self.attributes != reading.attributes:
            return None
        if not log.is_untouched(self.graph, (*uids, *cached.uids), self.since) or cached.place != place_of(mesh):
            return None
        return cached


def place_of(mesh: Any) -> Place:
    """Return addresses and sizes of an evaluated mesh's arrays; for particle hair also those of its source."""
    if isinstance(mesh, ParticleHair):
        return mesh.place()
    positions, corners = (mesh.attributes[name].data for name in ("position", ".corner_vert"))
    sizes = (len(positions), len(corners), len(mesh.polygons))
    return (*(array[0].as_pointer() if len(array) else 0 for array in (positions, corners)), *sizes)


# Mesh table ----------------------------------------------------------------------------------------------------------


NO_MESH = -1
_NOTHING = AttributeRequest(material_slots=False)
STRANDS = "particle hair"  # first in the keys of its records
_Mesh = bpy.types.Mesh  # looking it up is slow
_OF_VERTICES = "Delete such vertices in Edit Mode, or check which modifier or driver makes them"


class MeshTable:
    """Reads each mesh once and returns its row; pointers are only used within one evaluation.

    cache: of the last reading. log: the evaluations since, None if they are not known: then everything is read.
    only_places: no attributes are read, even if requested; cached meshes that have them are used.
    """

    def __init__(
        self,
        depsgraph: Any,
        attributes: AttributeRequest,
        reader: ArrayReader,
        cache: MeshCache | None = None,
        log: EvaluationLog | None = None,
        *,
        only_places: bool = False,
    ) -> None:
        self._depsgraph = depsgraph
        self._reader = reader
        self._log = log
        self._last = cache or MeshCache()
        self.cache = MeshCache({}, attributes, depsgraph.as_pointer(), -1 if log is None else log.now)
        self._attributes = attributes = _NOTHING if only_places else attributes
        # The layers that are requested of every mesh, for any materials.
        self._layers = LayerRequest(uvs=frozenset([""])) if attributes.corner_uvs else NO_LAYERS
        self._rows: dict[int, int] = {}  # by the mesh's pointer; twins have one
        self._mesh_counts: Counter[int] = Counter()  # by row: how many meshes have it
        self._tokens: dict[int, Hashable] = {}
        self._counts: Counter[Hashable] = Counter()  # by what meshes come from
        self._key_counts: Counter[Hashable] = Counter()  # of duplicates: by their keys without the number
        self._twins = _TwinFinder()
        self._timed: dict[int, bool] = {}  # see `guess_usage`
        self.records: list[MeshRecord] = []
        self.warnings: list[str] = []
        self.not_shown: list[NotShown] = []

    @property
    def for_render(self) -> bool:
        """Whether the depsgraph is a render's."""
        return bool(self._depsgraph.mode == "RENDER")

    def row(self, obj: Any, mesh: Any, is_own: bool, layers: LayerRequest) -> int:
        """Return the row of an evaluated mesh, or NO_MESH if it has no faces; or of curves, points or particle hair.

        obj: the evaluated object, or the depsgraph's temporary, that shows the mesh. is_own: whether it is the
        object's own mesh and not an additional result of geometry nodes. layers: those that the object's materials use;
        in the end the mesh has the layers for all objects that show it.
        """
        pointer = mesh.as_pointer()
        row = self._rows.get(pointer)
        if row is None:
            wanted = layers if self._layers is NO_LAYERS else self._layers | layers
            row = self._add(obj.original, mesh, is_own, wanted)
            self._place(pointer, row)
        elif layers is not NO_LAYERS and row != NO_MESH and not self.records[row].layers.covers(layers):
            self._mesh_counts[row] -= 1
            row = self._add_layers(obj.original, mesh, is_own, row, layers)
            self._place(pointer, row)
        return row

    def _place(self, pointer: int, row: int) -> None:
        self._rows[pointer] = row
        self._mesh_counts[row] += 1

    def _add_layers(self, original: Any, mesh: Any, is_own: bool, row: int, layers: LayerRequest) -> int:
        """The row of a mesh that has been read, with further layers; it is no longer counted among those of `row`."""
        record = self.records[row]
        layers = record.layers | layers
        if self._mesh_counts[row]:  # others have it, too: its twins' layers may be others
            return self._add(original, mesh, is_own, layers)
        token = self._tokens[row]
        read = self._read(original, mesh, token, layers)
        assert read is not None
        read = replace(
            read,
            key=record.key,
            usage=record.usage,
            usage_reason=record.usage_reason,
            remade_by=record.remade_by,
        )
        self.records[row] = read
        if token in self.cache.meshes:
            self.cache.meshes[token] = replace(self.cache.meshes[token], record=read)
        return row

    def _add(self, original: Any, mesh: Any, is_own: bool, layers: LayerRequest) -> int:
        origin = self._origin(original, mesh, is_own)
        token = (*origin, self._counts[origin])
        record = self._read(original, mesh, token, layers)
        if record is None:
            return NO_MESH
        if record.dropped_triangles:
            count = record.dropped_triangles
            part = record.kind.removesuffix("s")
            vertex = "vertex" if part == "triangle" else "number"
            text = f"left out {count:,} {part}{'s' * (count > 1)} with a {vertex} that is not finite or beyond 1e18"
            self.not_shown.append(NotShown("shape", original.name, original.session_uid, text, _OF_VERTICES))
            self.warnings.append(str(self.not_shown[-1]))
            if record.kind != "triangles" and not record.part_count:
                return NO_MESH
        twin = self._twins.find(original.data, record, self.records)
        if twin is None:
            guess = guess_usage(original, self._timed)
            key = self._lasting_key(origin, record)
            remade_by = find_remaker(original)
            record = replace(record, key=key, usage=guess.usage, usage_reason=guess.reason, remade_by=remade_by)
            self.records.append(record)
            twin = len(self.records) - 1
            self._tokens[twin] = token
        self._counts[origin] += 1
        if not isinstance(mesh, _Mesh | ParticleHair):
            self.cache.meshes[token] = CachedMesh(self.records[twin], (), _uids_of(original))
        elif isinstance(mesh, ParticleHair) or not mesh.is_editmode:
            self.cache.meshes[token] = CachedMesh(self.records[twin], place_of(mesh), _uids_of(original))
        return twin

    def _read(self, original: Any, mesh: Any, token: Hashable, layers: LayerRequest) -> MeshRecord | None:
        if not isinstance(mesh, _Mesh):
            cached = self._find_untouched(original, mesh, token, layers) if isinstance(mesh, ParticleHair) else None
            if cached is not None:
                return cached
            held = self._last.meshes.get(token)
            last = None if held is None else held.record
            if isinstance(mesh, ParticleHair):
                graph = self._depsgraph
                return read_particle_hair(mesh, None, mesh.name, layers, self._reader, last, lambda: graph.objects)
            return read_curves_or_points(mesh, None, _name_of(original, mesh), layers, self._reader, last)
        if mesh.is_editmode:  # its arrays are stale until they are written out of the edit mesh
            evaluated = original.evaluated_get(self._depsgraph)
            record = read_mesh(evaluated.to_mesh(), None, original.name, self._attributes, layers, self._reader)
            evaluated.to_mesh_clear()
            return record
        cached = self._find_untouched(original, mesh, token, layers)
        if cached is not None:
            return cached
        held = self._last.meshes.get(token)
        known = None if held is None else held.record
        return read_mesh(mesh, None, _name_of(original, mesh), self._attributes, layers, self._reader, known)

    def _find_untouched(self, original: Any, mesh: Any, token: Hashable, layers: LayerRequest) -> MeshRecord | None:
        """Return the last reading's mesh if it is surely the current one."""
        if original.mode != "OBJECT":
            return None
        cached = self._last.find_untouched(token, mesh, _uids_of(original), self.cache, self._log)
        if cached is None or not cached.record.layers.covers(layers):
            return None
        return replace(cached.record.narrowed(layers), name=_name_of(original, mesh), was_read=False)

    def _origin(self, original: Any, mesh: Any, is_own: bool) -> tuple[Any, ...]:
        """Return the origin of a mesh: all of its key but the last numbers."""
        uid = original.session_uid
        if isinstance(mesh, ParticleHair):
            return (STRANDS, uid)
        if not isinstance(mesh, _Mesh):
            kind = kind_of(mesh)
            if not is_own:
                return (f"made {kind}", uid)
            return (kind, uid) if len(original.modifiers) else (f"own {kind}", original.data.session_uid)
        if original.type != "MESH":
            # Curves and their like show even their own mesh as an instance; it comes before any other.
            is_own = not self._counts["object", uid]
        if not is_own:
            return ("made", uid)
        return self.own_key(original)

    @staticmethod
    def own_key(original: Any) -> tuple[str, int]:
        """Returns the first two parts of the key of an original object's own evaluated mesh."""
        if original.type == "MESH" and not len(original.modifiers):
            return ("mesh", original.data.session_uid)
        return ("object", original.session_uid)

    def _lasting_key(self, origin: tuple[Any, ...], record: MeshRecord) -> Hashable:
        if origin[0] == "made":
            origin = (*origin, hashlib.blake2b(record.triangles.data, digest_size=12).digest())
        elif str(origin[0]).startswith("made "):
            origin = (*origin, _digest(record))
        number = self._key_counts[origin]
        self._key_counts[origin] += 1
        return (*origin, number)


def _digest(record: MeshRecord) -> bytes:
    """Digests the data that stays the same when curves or points move."""
    offsets = record.curve_offsets
    lasting = len(record.positions).to_bytes(8, "little") if offsets is None else offsets.data
    return hashlib.blake2b(lasting, digest_size=12).digest()


_UNNAMED = ("Mesh", "Curves", "Point Cloud", "PointCloud")


def _name_of(original: Any, mesh: Any) -> str:
    """Returns the name by which users know a mesh: Blender calls one that it makes for an evaluation "Mesh"."""
    return original.name if mesh.name in _UNNAMED else mesh.name


def _uids_of(original: Any) -> tuple[int, ...]:
    data = original.data
    return (original.session_uid,) if data is None else (original.session_uid, data.session_uid)


class _TwinFinder:
    """Finds meshes that were evaluated once an object although they are equal.

    Linked text and curves are, and linked meshes under equal modifiers. They become one mesh again.
    """

    def __init__(self) -> None:
        self._candidates: dict[Hashable, list[int]] = {}
        self._checksums: dict[int, int] = {}

    def find(self, data: Any, record: MeshRecord, records: list[MeshRecord]) -> int | None:
        """The row of an equal mesh from the same data-block; if there is none, record will be records' next."""
        if data is None or data.users < 2:
            return None
        likeness = (data.session_uid, len(record.positions), len(record.triangles))
        candidates = self._candidates.setdefault(likeness, [])
        for row in candidates:
            if records[row].positions is record.positions and _have_equal_content(records[row], record):
                return row
        if candidates:  # checksums are for telling many copies apart: the first needs none
            checksum = zlib.crc32(record.positions.data)
            for row in candidates:
                if self._checksum(row, records) == checksum and _have_equal_content(records[row], record):
                    return row
        candidates.append(len(records))
        return None

    def _checksum(self, row: int, records: list[MeshRecord]) -> int:
        checksum = self._checksums.get(row)
        if checksum is None:
            checksum = self._checksums[row] = zlib.crc32(records[row].positions.data)
        return checksum


def _have_equal_content(first: MeshRecord, second: MeshRecord) -> bool:
    if first.layers != second.layers:  # layers that were not read may differ
        return False
    if first.form != second.form:
        return False
    are_equal = all(_are_equal(getattr(first, name), getattr(second, name)) for name in MESH_COLUMNS)
    return are_equal and have_same_layers(first, second)


def _are_equal(first: npt.NDArray[Any] | None, second: npt.NDArray[Any] | None) -> bool:
    if first is second or first is None or second is None:
        return first is second
    return are_equal(first, second)
