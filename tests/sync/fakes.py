"""Records made by hand, and a fake of the engine's scene that checks the calls it receives."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh_addon.sync.look_records import MaterialRecord
from perfect_bvh_addon.sync.records import CameraRecord, InstanceRecords, MeshRecord, ObjectRecord, SceneRecord

UNUSED = 2**31 - 1


def mesh(key: Hashable, triangle_count: int = 2, shift: float = 0.0, **columns: Any) -> MeshRecord:
    """A strip of triangles, moved by shift."""
    steps = np.arange(triangle_count + 2)
    positions = np.stack([steps // 2, steps % 2, np.full(len(steps), shift)], axis=1).astype(np.float32)
    triangles = np.stack([steps[:-2], steps[1:-1], steps[2:]], axis=1).astype(np.int32)
    polygon_ids = np.arange(triangle_count, dtype=np.int32)
    return MeshRecord(
        key=(key,), name=str(key), positions=positions, triangles=triangles, polygon_ids=polygon_ids, **columns
    )


@dataclass
class Shown:
    """One instance to be: the mesh's key, the object's uid, where, and how."""

    mesh: Hashable
    uid: int
    x: float = 0.0
    mask: int = 0x3F
    parent: int = 0
    persistent_id: Sequence[int] = ()


def record(
    meshes: Sequence[MeshRecord],
    shown: Sequence[Shown],
    *,
    slots: dict[int, tuple[int, ...]] | None = None,
    materials: tuple[MaterialRecord, ...] = (),
    camera: CameraRecord | None = None,
    names: dict[int, str] | None = None,
    **settings: Any,
) -> SceneRecord:
    """A record of these instances; objects are called after their uids unless named."""
    uids = sorted({item.uid for item in shown} | {item.parent for item in shown if item.parent})
    objects = tuple(
        ObjectRecord((names or {}).get(uid, f"object {uid}"), uid, uid % 7, (slots or {}).get(uid, ())) for uid in uids
    )
    mesh_rows = {item.key: row for row, item in enumerate(meshes)}
    transforms = np.tile(np.eye(3, 4, dtype=np.float32), (len(shown), 1, 1))
    persistent_ids = np.zeros((len(shown), 8), np.int32)
    for row, item in enumerate(shown):
        transforms[row, 0, 3] = item.x
        if item.parent:
            persistent_ids[row] = [*item.persistent_id, *[UNUSED] * (8 - len(item.persistent_id))]
    instances = InstanceRecords(
        mesh_indices=np.array([mesh_rows[(item.mesh,)] for item in shown], np.int32),
        object_indices=np.array([uids.index(item.uid) for item in shown], np.int32),
        parent_indices=np.array([uids.index(item.parent) if item.parent else -1 for item in shown], np.int32),
        transforms=transforms,
        masks=np.array([item.mask for item in shown], np.uint32),
        persistent_ids=persistent_ids,
    )
    return SceneRecord(
        name="scene",
        frame=1.0,
        meshes=tuple(meshes),
        objects=objects,
        materials=materials,
        instances=instances,
        camera=camera,
        **{"size": (16, 9), **settings},
    )


@dataclass
class FakeMesh:
    positions: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    usage: str
    motion: bytes = b""


@dataclass
class FakeInstance:
    mesh: int
    transform: npt.NDArray[np.float64]
    mask: int
    order: int
    motion: bytes = b""


class StaleError(Exception):
    """The fake's StaleSceneError."""


class FailureError(Exception):
    """The error that a fake scene raises when a test makes it fail."""


@dataclass
class FakeScene:
    """Keeps its arguments, records each call, and refuses calls that the engine would refuse.

    fail_at: the name of the call that raises once; fail_after: whether it has done its work by then.
    """

    meshes: dict[int, FakeMesh] = field(default_factory=dict)
    instances: dict[int, FakeInstance] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    committed: list[Any] | None = None
    stale: str | None = None
    scene_id: int = 0
    generation: int = 0
    fail_at: str = ""
    fail_after: bool = False
    _next_mesh: int = 0
    _next_instance: int = 0
    commit_keywords: dict[str, Any] = field(default_factory=dict)

    def _note(self, call: str) -> None:
        self.calls.append(call)
        if self.fail_at == call and not self.fail_after:
            self.fail_at = ""
            raise FailureError(call)

    def _done(self, call: str) -> None:
        if self.fail_at == call:
            self.fail_at = ""
            raise FailureError(call)

    def add_mesh(self, positions: Any, triangles: Any, *, usage: str) -> int:
        self._note("add_mesh")
        self._next_mesh += 1
        self.meshes[self._next_mesh] = FakeMesh(positions.copy(), triangles.copy(), usage)
        self._done("add_mesh")
        return self._next_mesh

    def update_mesh(self, mesh: int, positions: Any) -> None:
        self._note("update_mesh")
        assert positions.shape == self.meshes[mesh].positions.shape
        self.meshes[mesh].positions, self.meshes[mesh].motion = positions.copy(), b""
        self._done("update_mesh")

    def set_mesh_motion(self, mesh: int, positions: Any) -> None:
        self._note("set_mesh_motion")
        assert len(positions) > 1 and positions[0].shape == self.meshes[mesh].positions.shape
        self.meshes[mesh].motion = positions.tobytes()
        self._done("set_mesh_motion")

    def replace_mesh(self, mesh: int, positions: Any, triangles: Any) -> None:
        self._note("replace_mesh")
        self.meshes[mesh].positions, self.meshes[mesh].triangles = positions.copy(), triangles.copy()
        self.meshes[mesh].motion = b""
        self._done("replace_mesh")

    def set_usage(self, mesh: int, usage: str) -> None:
        self._note("set_usage")
        self.meshes[mesh].usage = usage
        self._done("set_usage")

    def remove_mesh(self, mesh: int) -> None:
        self._note("remove_mesh")
        assert all(instance.mesh != mesh for instance in self.instances.values()), "mesh is still shown"
        del self.meshes[mesh]
        self._done("remove_mesh")

    def add_instances(self, meshes: Any, transforms: Any, masks: Any, orders: Any) -> npt.NDArray[np.int32]:
        self._note("add_instances")
        first = self._next_instance
        for mesh_id, transform, mask, order in zip(meshes, transforms, masks, orders, strict=True):
            assert int(mesh_id) in self.meshes
            self.instances[self._next_instance] = FakeInstance(int(mesh_id), transform.copy(), int(mask), int(order))
            self._next_instance += 1
        self._done("add_instances")
        return np.arange(first, self._next_instance, dtype=np.int32)

    def set_transforms(self, ids: Any, transforms: Any) -> None:
        self._note("set_transforms")
        for instance, transform in zip(ids, transforms, strict=True):
            held = self.instances[int(instance)]
            held.transform, held.motion = transform.copy(), b""
        self._done("set_transforms")

    def set_instance_motion(self, ids: Any, transforms: Any) -> None:
        self._note("set_instance_motion")
        assert len(transforms) > 1 and len(ids) > 0
        for row, instance in enumerate(ids):
            self.instances[int(instance)].motion = transforms[:, row].tobytes()
        self._done("set_instance_motion")

    def set_masks(self, ids: Any, masks: Any) -> None:
        self._note("set_masks")
        for instance, mask in zip(ids, masks, strict=True):
            self.instances[int(instance)].mask = int(mask)
        self._done("set_masks")

    def remove_instances(self, ids: Any) -> None:
        if len(ids):
            self._note("remove_instances")
        for instance in ids:
            del self.instances[int(instance)]
        self._done("remove_instances")

    def commit(self, **keywords: Any) -> Any:
        self._note("commit")
        self.commit_keywords = keywords
        self.committed = self.content()
        self.stale = None
        self.generation += 1
        return SimpleNamespace(byte_count=1234, generation=self.generation)

    def mark_stale(self, why: str) -> None:
        self.stale = why

    def content(self) -> list[Any]:
        """Everything that rays could see, without ids: sorted by order."""
        return sorted(
            (
                instance.order,
                instance.mask,
                instance.transform.tobytes(),
                self.meshes[instance.mesh].positions.tobytes(),
                self.meshes[instance.mesh].triangles.tobytes(),
                instance.motion,
                self.meshes[instance.mesh].motion,
            )
            for instance in self.instances.values()
        )

    def answer(self) -> list[Any]:
        """The snapshot for queries; raises StaleError as the engine does."""
        if self.stale is not None:
            raise StaleError(self.stale)
        assert self.committed is not None
        return self.committed
