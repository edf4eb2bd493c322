"""The scene: meshes and instances, edited freely and committed into a two-level tree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Progress, as_integers, as_rows, as_steps, as_time_range, as_transforms, as_triangles
from ._checks import check_id, check_number
from .build_config import BuildConfig, Usage, as_config, check_usage
from .calibration import Calibration, current_calibration
from .curves_and_points import CurveChains, CurvesAndPoints
from .queries import ALL_MASK, Queries
from .ray_walk import TreeBoxes, list_tree_boxes
from .report import CommitReport

# Committed states of a scene.


class Snapshot(Queries):
    """An immutable committed scene. Any number of threads may query it while its scene is edited.

    Get one from `Scene.snapshot()`. `Scene` has the same queries and answers them from its latest snapshot.
    """

    __slots__ = ("_snapshot",)

    def __init__(self, core_snapshot: _core.Snapshot) -> None:
        self._snapshot = core_snapshot

    def _committed(self) -> _core.Snapshot:
        return self._snapshot

    @property
    def generation(self) -> int:
        """The number of this commit of the scene, counted from 1."""
        return self._snapshot.generation

    @property
    def scene_id(self) -> int:
        """The id of the `Scene` of this process that it came from."""
        return self._snapshot.scene_id

    def tree_boxes(
        self,
        mesh: int | None = None,
        *,
        first_level: int = 0,
        last_level: int | None = None,
        with_leaves_above: bool = False,
    ) -> TreeBoxes:
        """Lists the boxes of one tree that rays test on their way down, for drawing or judging the tree.

        Args:
            mesh: The id of the mesh whose tree is listed; None for the top level, over the instances.
            first_level, last_level: The range of levels, both included. The root is level 0; None is the deepest level.
                A node has up to eight children, so each level may hold eight times as many boxes as the one above.
            with_leaves_above: Also list the leaves above the first level. A single level with these leaves is a cut
                through the tree: together its boxes hold everything that the tree holds.

        Raises:
            ValueError: For a mesh that this snapshot does not have, and for levels out of order.
        """
        return list_tree_boxes(self._snapshot, mesh, first_level, last_level, with_leaves_above)

    def tree_sah(self, mesh: int) -> float:
        """Computes the expected cost of a random ray in a mesh's tree, if it meets its box: the `sah` of `tree_boxes`.

        Each visited node and each tested triangle costs 1 (MacDonald and Booth 1990). The order of summation differs
        from `tree_boxes`, so the last digits may differ. The tree is traversed once, and nothing is copied. Returns a
        float.

        Raises:
            ValueError: For a mesh that this snapshot does not have.
        """
        return _core.tree_sah(self._snapshot, check_id("tree_sah", "mesh", mesh))


# Scene ---------------------------------------------------------------------------------------------------------------


_MOST_RAYS = 1e18


class Scene(Queries, CurvesAndPoints):
    """A two-level tree over instanced meshes of triangles, curves or points.

    Edits are collected. `commit()` builds, refits or keeps each tree as its edits need. For a tree whose vertices
    moved, it chooses the action with the least expected cost of update and rays together. Queries then answer from the
    committed state, and raise `StaleSceneError` while edits are pending. Every edit checks its input before it changes
    anything. Arrays are copied in. Several threads may use a scene.

    Args:
        calibration: The cost of work on this machine. The default is the result of `perfect-bvh calibrate`, or else the
            calibration that comes with the package. Decisions depend only on the calibration, the edits and the
            expected rays, not on the machine.
    """

    __slots__ = (
        "__weakref__",
        "_calibration_numbers",
        "_chains",
        "_policy",
        "_scene",
        "before_query",
    )

    def __init__(self, *, calibration: Calibration | None = None) -> None:
        self._policy = "governed"
        self._calibration_numbers = (current_calibration() if calibration is None else calibration).as_numbers()
        self._scene = _core.make_scene()
        self._chains: dict[int, CurveChains] = {}
        self.before_query: Callable[[], object] | None = None
        """Called before each query that would be answered, and before `is_current` and `snapshot()`, on their thread.

        It serves code that can find out whether the source of this scene's data has changed: it may call `mark_stale`.
        The query raises any exception that it raises. Queries of snapshots do not call it.
        """

    def _committed(self) -> _core.Snapshot:
        self._check_source()
        return self._scene.snapshot()

    def _check_source(self) -> None:
        if self.before_query is not None and self._scene.is_current():
            self.before_query()

    # Editing

    def add_mesh(
        self,
        positions: npt.ArrayLike,
        triangles: npt.ArrayLike,
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
    ) -> int:
        """Adds a mesh and returns its id. It is visible only through instances.

        Args:
            positions: (V, 3) float. float64 positions keep their detail at any distance from zero. In a mesh larger
                than 2^20, detail below 2^-126 of its size is rounded.
            triangles: (T, 3) int, rows of positions; counter-clockwise seen from the front.
            build: "auto" or a `BuildConfig`.
            usage: The expected changes: "static" (none, or rigid motion), "deforming" (positions) or "changing"
                (topology). "auto" builds a "changing" mesh with the "fast" builder, others with "binned".

        Raises:
            ValueError: For non-finite positions and for indices out of range.
        """
        check_usage("add_mesh", usage)
        rows, corners = as_rows("add_mesh", "positions", positions), as_triangles("add_mesh", triangles)
        return self._scene.add_mesh(rows, corners, as_config("add_mesh", build).as_settings(), usage)

    def update_mesh(self, mesh: int, positions: npt.ArrayLike) -> None:
        """Moves a mesh's vertices: (V, 3), the same number of rows as before.

        The next commit refits its tree, or rebuilds it if a refitted tree would be too slow. Its report says which, and
        why. A tree with spatial splits cannot be refitted.
        """
        self._scene.update_mesh(check_id("update_mesh", "mesh", mesh), as_rows("update_mesh", "positions", positions))

    def set_mesh_motion(
        self, mesh: int, positions: npt.ArrayLike, time_range: tuple[float, float] = (0.0, 1.0)
    ) -> None:
        """Moves a mesh's vertices within the shutter: each ray sees the mesh at its own time (`times` of the queries).

        The next commit refits or rebuilds the first step's tree, as for `update_mesh`, and refits it to each of the
        other steps. Each step takes as much memory as the first.

        Args:
            positions: (S, V, 3), S steps from 2 to 255 at equal intervals, each with the same number of rows as before.
                Between two steps every vertex moves in a straight line, interpolated in float32. One step, (1, V, 3),
                is `update_mesh`, which ends the motion.
            time_range: The times of the first and the last step. Before and after, the mesh does not move.

        Raises:
            ValueError: For positions of other counts or not finite, for a range that is not a rising pair of finite
                numbers, and for a mesh that was added with the builder "spatial", whose trees cannot be refitted.
                Nothing is changed then.
        """
        name = "set_mesh_motion"
        steps, rows = as_steps(name, "positions", positions, 3)
        span = as_time_range(name, time_range)
        if steps == 1:
            self.update_mesh(mesh, rows)
            return
        self._scene.set_mesh_motion(check_id(name, "mesh", mesh), rows, steps, span)

    def replace_mesh(self, mesh: int, positions: npt.ArrayLike, triangles: npt.ArrayLike) -> None:
        """Replaces a mesh's geometry; its instances stay."""
        self._scene.replace_mesh(
            check_id("replace_mesh", "mesh", mesh),
            as_rows("replace_mesh", "positions", positions),
            as_triangles("replace_mesh", triangles),
        )

    def set_usage(self, mesh: int, usage: Usage) -> None:
        """Changes the expected usage of a mesh, see `add_mesh`. It applies to trees that are built from now on."""
        check_usage("set_usage", usage)
        self._scene.set_usage(check_id("set_usage", "mesh", mesh), usage)

    def remove_mesh(self, mesh: int) -> None:
        """Removes a mesh, curves or points that no instance uses; raises ValueError if one does."""
        number = check_id("remove_mesh", "mesh", mesh)
        self._scene.remove_mesh(number)
        self._keep(number, None)

    def add_instance(
        self, mesh: int, transform: npt.ArrayLike | None = None, mask: int = ALL_MASK, order: int | None = None
    ) -> int:
        """Places a mesh and returns the instance's id.

        Args:
            transform: (4, 4) or (3, 4), object to world, any affine map; None for the identity. Rays are mapped into
                the mesh's space in double precision. The hit test is exact for the mapped ray. The mapping itself may
                be inexact where the transform's condition number times the ray's distance in mesh sizes exceeds about
                2^36.
            mask: 32 bits, see `Queries`.
            order: Breaks ties: of several hits at exactly the same t, the smallest order wins. By default the instance
                that was added first wins.
        """
        transforms = np.eye(4)[None] if transform is None else transform
        orders = None if order is None else [order]
        return int(self.add_instances([mesh], transforms, [mask], orders)[0])

    def add_instances(
        self,
        meshes: npt.ArrayLike,
        transforms: npt.ArrayLike,
        masks: npt.ArrayLike | None = None,
        orders: npt.ArrayLike | None = None,
    ) -> npt.NDArray[np.int32]:
        """Places several instances: meshes (I,) ids, transforms (I, 4, 4) or (I, 3, 4), masks and orders (I,).

        Returns (I,) int32 ids, ascending; ids are never reused.
        """
        name = "add_instances"
        ids = as_integers(name, "meshes", meshes, np.int32).reshape(-1)
        count = len(ids)
        values = as_transforms(name, transforms, count) if count else np.empty((0, 3, 4))
        bits = np.full(count, ALL_MASK, np.uint32) if masks is None else _column(name, "masks", masks, np.uint32, count)
        keys = None if orders is None else _column(name, "orders", orders, np.int64, count)
        first = self._scene.add_instances(ids, values, bits, keys)
        return np.arange(first, first + count, dtype=np.int32)

    def set_transforms(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None:
        """Moves instances: ids (I,), transforms (I, 4, 4) or (I, 3, 4). The trees of meshes do not change."""
        rows = as_integers("set_transforms", "ids", ids, np.int32).reshape(-1)
        if len(rows):
            self._scene.set_transforms(rows, as_transforms("set_transforms", transforms, len(rows)))

    def set_instance_motion(
        self, ids: npt.ArrayLike, transforms: npt.ArrayLike, time_range: tuple[float, float] = (0.0, 1.0)
    ) -> None:
        """Moves instances within the shutter: each ray sees them at its own time (`times` of the queries).

        The trees of meshes do not change. An instance is not visible at a time at which its scale is zero. Raises
        ValueError for unknown ids, for matrices that are not finite or not affine, for matrices that flatten an
        instance (they do not define its rotation), and for other ranges and shapes. Nothing is changed then.

        Args:
            ids: (I,).
            transforms: (S, I, 4, 4) or (S, I, 3, 4), S steps from 2 to 255 at equal intervals. Between two steps the
                rotation turns evenly by the shorter path. The translation and the rest of the matrix (scale and shear)
                are interpolated linearly, as in Blender's and Cycles' motion blur. A turn of more than half a
                revolution needs more steps. One step is `set_transforms`, which ends the motion.
            time_range: The times of the first and the last step. Before and after, the instances do not move.
        """
        name = "set_instance_motion"
        rows = as_integers(name, "ids", ids, np.int32).reshape(-1)
        steps, matrices = as_steps(name, "transforms", transforms, 4)
        span = as_time_range(name, time_range)
        if len(rows) == 0:
            return
        values = as_transforms(name, matrices, steps * len(rows))
        if steps == 1:
            self._scene.set_transforms(rows, values)
        else:
            self._scene.set_instance_motion(rows, values, steps, span)

    def set_masks(self, ids: npt.ArrayLike, masks: npt.ArrayLike) -> None:
        """Changes which rays see the instances: ids (I,), masks (I,) or one for all."""
        rows = as_integers("set_masks", "ids", ids, np.int32).reshape(-1)
        if len(rows):
            self._scene.set_masks(rows, _column("set_masks", "masks", masks, np.uint32, len(rows)))

    def remove_instances(self, ids: npt.ArrayLike) -> None:
        """Removes instances by id: (I,)."""
        rows = as_integers("remove_instances", "ids", ids, np.int32).reshape(-1)
        if len(rows):
            self._scene.remove_instances(rows)

    def commit(self, expected_rays: int | None = None, *, progress: Progress | None = None) -> CommitReport:
        """Brings the trees up to date with all edits.

        With the build "auto", a mesh that does not change is rebuilt with a better builder as soon as past and expected
        rays repay that: at most twice for the same triangles.

        After a failed or cancelled commit the edits are still pending, and earlier snapshots stay valid.

        Args:
            expected_rays: The expected number of rays until the next commit. The engine weighs refits and builds
                against it, and chooses builders by it. The default is the number that the last commit was given (unless
                0), or the number of rays cast since the last commit (see `rays_cast`) if that is larger. If no commit
                was ever given a number, the usage selects the builder, or a better one if the rays cast since the last
                commit repay it; and a refitted tree is restructured or rebuilt if a ray is expected to cost 5 percent
                more than when the tree was built.
            progress: Called with the share done, up to 20 times a second. Returning False raises `Cancelled`. It must
                not use this scene. The work between two checks of the time does not grow with the meshes. Ctrl-C works
                too.
        """
        rays = None
        if expected_rays is not None:
            rays = check_number("commit", "expected_rays", expected_rays, 0.0, _MOST_RAYS)
        return CommitReport.from_core(self._scene.commit(self._policy, rays, self._calibration_numbers, progress))

    def mark_stale(self, why: str) -> None:
        """Makes every query raise `StaleSceneError(why)` until the next commit.

        For code that knows that the source of this scene's data has changed.
        """
        self._scene.mark_stale(why)

    # Asking

    @property
    def is_current(self) -> bool:
        """Whether queries would be answered: committed, no pending edits, not marked stale."""
        self._check_source()
        return self._scene.is_current()

    @property
    def scene_id(self) -> int:
        """The id of this `Scene`, unique within the process. Its snapshots and hits carry it."""
        return self._scene.scene_id()

    @property
    def rays_cast(self) -> int:
        """Rays cast so far at this scene's snapshots, also for images and their light; `walk_ray` does not count."""
        return self._scene.rays_cast()

    @property
    def mesh_count(self) -> int:
        """The number of meshes, including pending edits."""
        return self._scene.mesh_count()

    @property
    def instance_count(self) -> int:
        """The number of instances, including pending edits."""
        return self._scene.instance_count()

    def snapshot(self) -> Snapshot:
        """Returns the committed state, which is immutable. Raises StaleSceneError if edits are pending."""
        return Snapshot(self._committed())


def _column(function: str, name: str, value: npt.ArrayLike, dtype: type[Any], count: int) -> npt.NDArray[Any]:
    array = as_integers(function, name, value, dtype)
    if array.ndim == 0:
        return np.full(count, array, dtype)
    if array.shape != (count,):
        raise ValueError(f"{function}: {name} must have shape ({count},), got {array.shape}")
    return array
