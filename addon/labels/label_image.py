"""One pass of rays through pixels' centres, which lists all surfaces on each, becomes a labelled image."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..extract.camera import check_resolution, image_window
from ..extract.label_values import OBJECT, LabelReader, LabelReading
from ..support.memory import check_fits
from ..sync.lookup import MISS, IdRows, LabelColumn
from ..sync.not_shown import without_scans
from ..sync.records import VISIBLE_TO_CAMERA, AttributeRequest
from .labels import Labels, describe_camera, distinct, find_things, masks_of

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    import bpy
    from perfect_bvh import Camera, Hits, Intersections, Snapshot
    from perfect_bvh._arrays import Progress

    from ..live.scene_sync import SceneSync
    from ..live.scene_view import SceneMoment
    from ..sync.records import MeshRecord

# Normals and uvs where rays hit triangles, from the meshes that a sync has read. Does not depend on Blender.


Floats = npt.NDArray[np.float32]


def corner_values(
    meshes: tuple[MeshRecord, ...], name: str, mesh_rows: npt.NDArray[Any], primitives: npt.NDArray[Any], uvs: Floats
) -> tuple[Floats | None, npt.NDArray[np.bool_]]:
    """Values of triangles' corners at hits, and which hits have any.

    Args:
        name: Of a field of the meshes, (T, 3, C).
        mesh_rows, primitives: (R,), which triangle of which mesh was hit.
        uvs: (R, 2), where on it.

    Returns:
        (R, C) float32, zero where a mesh has no such values, None if none of them has.
    """
    values: Floats | None = None
    found = np.zeros(len(mesh_rows), np.bool_)
    weights = np.column_stack([1.0 - uvs.sum(axis=1), uvs]).astype(np.float32)
    for row in np.unique(mesh_rows):
        corners = getattr(meshes[row], name)
        if corners is None or corners.ndim != 3:  # curves and points have one value each, and no corners
            continue
        hits = np.flatnonzero(mesh_rows == row)
        if values is None:
            values = np.zeros((len(mesh_rows), corners.shape[2]), np.float32)
        values[hits] = np.einsum("rk,rkc->rc", weights[hits], corners[primitives[hits]])
        found[hits] = True
    return values, found


def world_normals(
    normals: Floats, linear: npt.NDArray[np.float64], mirrored: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """Returns (R, 3) unit normals, object to world, from (R, 3) ones; linear: (R, 3, 3); mirrored: (R,), if it mirrors.

    Uses the cofactors: they equal the transposed inverse up to a factor, and exist for flattening transforms, too.
    """
    x, y, z = (linear[:, :, axis] for axis in range(3))
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=2)
    turned = np.einsum("rij,rj->ri", cofactors, normals.astype(np.float64))
    turned *= np.where(mirrored, -1.0, 1.0)[:, None]
    size = np.linalg.norm(turned, axis=1, keepdims=True)
    return np.divide(turned, size, out=np.zeros_like(turned), where=size > 0.0)


# Label image ---------------------------------------------------------------------------------------------------------


READ = AttributeRequest(material_slots=True, corner_normals=True, corner_uvs=True)
# Rays whose surfaces are listed at once: a few million of those, in usual scenes.
RAYS_IN_A_STEP = 1 << 17
# The bytes that are kept of a pixel, and of each of its layers.
BYTES_A_PIXEL, BYTES_A_LAYER = 200, 8
NEIGHBOURS = (-1.0, 1.0)  # frames, between which flow is asked for
MIDDLE = 0.5
BUILT = 0.3  # of the whole: when the trees are built
WAIT_SECONDS = 0.02  # for them, at a time
LISTED = ("instance_ids", "t_hit")  # of all surfaces; the rest only of the nearest
FIELDS = ("instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals", "positions", "t_hit")


def label_image(
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    sync: SceneSync | None = None,
    camera: bpy.types.Object | None = None,
    size: tuple[int, int] | None = None,
    layers: int = 1,
    category: str | None = None,
    labels: Sequence[str] = (),
    flow: bool = False,
    frame_set: Callable[[int, float], object] | None = None,
    threads: int = 0,
    progress: Progress | None = None,
    for_viewport: bool = False,
) -> Labels:
    """Labels a camera's view exactly: ids, depths, normals, uvs, masks of visible and of hidden parts.

    The visible surfaces are those of the depsgraph's render or viewport that cameras may see. Glass and transparent
    surfaces count as opaque.

    Args:
        depsgraph: evaluated; None, the default, for that of a render of the context's scene and view layer, at its
            current frame.
        for_viewport: With None as the depsgraph, uses the scene of viewports instead.
        sync: A sync that is kept from frame to frame, so that unchanged data is not read and built again; None, the
            default, for a new one. It is updated.
        camera: None, the default, for the scene's.
        size: (width, height) in pixels; None for the render size. If the scene has Crop to Render Region, only the
            render region of it is labelled.
        layers: The number of nearest surfaces along each ray whose depths are kept, 1 or more.
        category: The label whose values are the categories; None, the default: each object's name is one.
        labels: Names of others, for `Labels.labels` and the object instances. A label is a custom property, of the
            object, else of its instancer, of the object's data, of the instancer's data, of the material; or "object",
            "instancer", "material" or "collection" (the first by name that holds the object itself). Tables of names
            have those of the whole file, so that they are the same in each frame.
        flow: Whether to compute the motion of pixels from the previous frame to the next, which evaluates both.
            frame_set: the function for that, of a render its engine's; None, the default: the scene's own.
        threads: The largest number of threads for casting rays; 0 for all.
        progress: Called with 0 to 1; returning False raises `perfect_bvh.Cancelled`.

    Raises:
        ValueError: Without a usable camera, for a label that nothing in the file has or whose values are neither
            numbers, texts nor data-blocks, and the errors of the engine.
    """
    import bpy
    from perfect_bvh._checks import check_count

    from ..live.scene_view import SceneView

    check_count("label_image", "layers", layers, 1, 1000)
    classes, others = _readers(category, labels)

    def label(of: bpy.types.Depsgraph, frame_set: Callable[[int, float], object] | None) -> Labels:
        view = _view_of(camera, size, flow, frame_set)
        return _label_depsgraph(of, sync, view, layers, classes, others, threads, progress)

    if depsgraph is not None:
        return label(depsgraph, frame_set)
    scene = SceneView("label_image", bpy.context.scene, bpy.context.view_layer, for_viewport=for_viewport)

    def label_moment(moment: SceneMoment) -> Labels:
        if camera is None and moment.camera is None:
            raise ValueError(_no_camera(moment.scene, "no camera is active"))
        return label(moment.depsgraph, moment.frame_set if frame_set is None else frame_set)

    return scene.read(label_moment)


def label_steps(
    depsgraph: bpy.types.Depsgraph,
    sync: SceneSync,
    *,
    camera: bpy.types.Object | None = None,
    size: tuple[int, int] | None = None,
    layers: int = 1,
    category: str | None = None,
    labels: Sequence[str] = (),
    flow: bool = False,
    frame_set: Callable[[int, float], object] | None = None,
    threads: int = 0,
) -> Generator[float, None, Labels]:
    """Does the work of `label_image` in steps, between which the user can work in Blender.

    Reads Blender before its first `yield`, and nothing of the depsgraph after that. Yields the share done, 0 to 1;
    returns the labels. Closing it cancels. sync: one that does not watch Blender. The other arguments and the errors
    are those of `label_image`.
    """
    classes, others = _readers(category, labels)
    view = _view_of(camera, size, flow, frame_set)
    sync.request(READ)
    building = sync.begin_update(depsgraph, **view)
    try:
        asked = _Asked(depsgraph, sync, view, layers, classes, others, threads)
        yield 0.0
        while not building.wait(WAIT_SECONDS):
            yield BUILT * building.share
        building.result()
    finally:
        sync.stop_building()
    labelling = asked.labelling()
    for share in labelling.steps():
        yield BUILT + (1.0 - BUILT) * share
    return labelling.result()


def _readers(category: str | None, labels: Sequence[str]) -> tuple[LabelReader, LabelReader]:
    classes = LabelReader("label_image", (OBJECT if category is None else category,), as_names=True)
    return classes, LabelReader("label_image", labels)


def _view_of(
    camera: bpy.types.Object | None,
    size: tuple[int, int] | None,
    flow: bool,
    frame_set: Callable[[int, float], object] | None,
) -> dict[str, Any]:
    """Arguments of `SceneSync.update`."""
    shutter = NEIGHBOURS if flow else None
    return {"camera": camera, "size": size, "shutter": shutter, "frame_set": frame_set if flow else None}


def _no_camera(scene: bpy.types.Scene, reason: str) -> str:
    return f"label_image: scene {scene.name!r} has no usable camera: {reason}"


class _Asked:
    """The data to label, read from Blender. Raises ValueError for a camera or a size that cannot be used."""

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        sync: SceneSync,
        view: dict[str, Any],
        layers: int,
        classes: LabelReader,
        others: LabelReader,
        threads: int,
    ) -> None:
        if sync.camera is None:
            raise ValueError(_no_camera(depsgraph.scene, sync.warnings[-1] if sync.warnings else "no camera is active"))
        try:
            if view["size"] is None:
                check_resolution(depsgraph.scene_eval)
            window = image_window(depsgraph.scene_eval, sync.size)
        except ValueError as error:
            raise ValueError(f"label_image: {error}") from None
        width, height = sync.size
        bytes_needed = width * height * (BYTES_A_PIXEL + BYTES_A_LAYER * layers)
        check_fits(f"label_image: {width:,} x {height:,} pixels", bytes_needed, "choose a smaller size")
        values = classes.read(depsgraph), others.read(depsgraph)
        flow = view["shutter"] is not None
        self.labelling = lambda: _Labelling(sync, sync.camera, sync.size, window, layers, flow, threads, *values)


def _label_depsgraph(
    depsgraph: bpy.types.Depsgraph,
    sync: SceneSync | None,
    view: dict[str, Any],
    layers: int,
    classes: LabelReader,
    others: LabelReader,
    threads: int,
    progress: Progress | None,
) -> Labels:
    """Does the work of `label_image` for an evaluated depsgraph. view: for `SceneSync.update`."""
    from perfect_bvh._arrays import share_of

    from ..live.scene_sync import SceneSync

    own = SceneSync(READ, watch=False) if sync is None else sync
    own.request(READ)
    try:
        own.update(depsgraph, **view, progress=share_of(progress, 0.0, BUILT))
        labelling = _Asked(depsgraph, own, view, layers, classes, others, threads).labelling()
        labelling.run(share_of(progress, BUILT, 1.0 - BUILT))
        return labelling.result()
    finally:
        if sync is None:
            own.close()


@dataclass
class _Labelling:
    """Labels one synced scene, block of rows after block of rows.

    frame: (width, height) of the whole image. window: (left, right, bottom, top), the labelled pixels of it.
    classes: the label that defines categories. others: the further ones.
    """

    sync: SceneSync
    camera: Camera
    frame: tuple[int, int]
    window: tuple[int, int, int, int]
    layers: int
    flow: bool
    threads: int
    classes: LabelReading
    others: LabelReading
    owners: list[npt.NDArray[np.int64]] = field(default_factory=list)  # whose pixel, block by block ...
    pixels: list[npt.NDArray[np.int64]] = field(default_factory=list)  # ... and which

    def __post_init__(self) -> None:
        from perfect_bvh.render import NO_DEPTH

        left, right, bottom, top = self.window
        self.size = right - left, top - bottom
        self.cut = slice(self.frame[1] - top, self.frame[1] - bottom), slice(left, right)
        count = self.size[0] * self.size[1]
        self.mesh_rows = IdRows(self.sync.mesh_ids)
        self.instance_rows = IdRows(self.sync.appearance.instances.ids)
        self.linear = self.sync.record.instances.transforms[:, :, :3].astype(np.float64)
        self.volumes = np.linalg.det(self.linear)
        self.depth = np.full(count, NO_DEPTH, np.float32)
        self.positions = np.zeros((count, 3))
        self.normals, self.uvs = np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32)
        self.instances, self.materials = np.full(count, MISS, np.int32), np.full(count, MISS, np.int32)
        self.layer_depths = np.full((self.layers, count), NO_DEPTH, np.float32)
        self.layer_instances = np.full((self.layers, count), MISS, np.int32)

    def run(self, progress: Progress | None) -> None:
        """Casts all rays and keeps their hits."""
        for share in self.steps():
            if progress is not None and progress(share) is False:
                import perfect_bvh

                raise perfect_bvh.Cancelled("labelling was cancelled")

    def steps(self) -> Iterator[float]:
        """The same in steps; yields the share done."""
        width, height = self.size
        snapshot = self.sync.scene.snapshot()
        step = max(1, RAYS_IN_A_STEP // width)
        for first in range(0, height, step):
            rows = slice(first, min(first + step, height))
            self._label(snapshot, rows)
            yield rows.stop / height

    def _label(self, snapshot: Snapshot, rows: slice) -> None:
        rows_cut, columns = self.cut
        of_frame = slice(rows_cut.start + rows.start, rows_cut.start + rows.stop)
        parts = self.camera.pixel_rays(self.frame, of_frame)
        origins, directions = (part[:, columns].reshape(-1, 3) for part in parts)
        rays, limits = (origins, directions), {"t_min": self.camera.clip_start, "t_max": self.camera.clip_end}
        how = {**limits, "mask": VISIBLE_TO_CAMERA, "threads": self.threads, "times": MIDDLE if self.flow else 0.0}
        listed = snapshot.list_intersections(*rays, fields=LISTED, **how)
        first_pixel = rows.start * self.size[0]
        counts = np.diff(listed.ray_splits)
        pixels = np.repeat(np.arange(len(counts), dtype=np.int64) + first_pixel, counts)
        keys = distinct(listed.hits.instance_ids.astype(np.int64) * (1 << 32) + pixels)
        self.owners.append(keys >> 32)
        self.pixels.append(keys & 0xFFFFFFFF)
        self._keep_layers(listed, counts, first_pixel)
        # The nearest once more, by rays that end there: their hits are the first that were listed.
        self._keep_first(snapshot.cast_rays(*rays, fields=FIELDS, **how), first_pixel, directions)

    def _keep_layers(self, listed: Intersections, counts: npt.NDArray[np.int64], first_pixel: int) -> None:
        for layer in range(self.layers):
            rays = np.flatnonzero(counts > layer)
            hits = listed.ray_splits[rays] + layer
            self.layer_depths[layer, first_pixel + rays] = listed.hits.t_hit[hits]
            self.layer_instances[layer, first_pixel + rays] = listed.hits.instance_ids[hits]

    def _keep_first(self, hits: Hits, first_pixel: int, directions: npt.NDArray[np.float64]) -> None:
        """Stores the first hits of the rays that hit something."""
        rows = np.flatnonzero(hits.instance_ids >= 0)
        pixels = first_pixel + rows
        self.depth[pixels], self.positions[pixels] = hits.t_hit[rows], hits.positions[rows]
        self.instances[pixels] = hits.instance_ids[rows]
        self.materials[pixels] = self.sync.material_ids(hits)[rows]
        meshes = self.mesh_rows.find(hits.mesh_ids[rows], "label_image: mesh")
        where = (meshes, hits.primitive_ids[rows], hits.primitive_uvs[rows])
        uvs, _ = corner_values(self.sync.record.meshes, "corner_uvs", *where)
        if uvs is not None:
            self.uvs[pixels] = uvs
        smooth, is_smooth = corner_values(self.sync.record.meshes, "corner_normals", *where)
        self.normals[pixels] = self._facing(hits, rows, smooth, is_smooth, directions[rows])

    def _facing(
        self,
        hits: Hits,
        rows: npt.NDArray[np.intp],
        smooth: npt.NDArray[np.float32] | None,
        is_smooth: npt.NDArray[np.bool_],
        directions: npt.NDArray[np.float64],
    ) -> npt.NDArray[np.float64]:
        """Shading normals, on the side that the triangle shows."""
        instances = self.instance_rows.find(hits.instance_ids[rows], "label_image: instance")
        volumes = self.volumes[instances]
        mirrored, is_smooth = volumes < 0.0, is_smooth & (volumes != 0.0)  # a flattened instance is a plane
        normals = hits.geometric_normals[rows].astype(np.float64)
        normals[mirrored & is_smooth] *= -1.0
        away = np.einsum("ij,ij->i", normals, directions) > 0.0
        if smooth is not None and is_smooth.any():
            turned = self.linear[instances[is_smooth]]
            normals[is_smooth] = world_normals(smooth[is_smooth], turned, mirrored[is_smooth])
        normals[away] *= -1.0
        return normals

    def result(self) -> Labels:
        """Returns the stored results, by the object instances that were hit."""
        width, height = self.size
        owners, pixels = np.concatenate(self.owners), np.concatenate(self.pixels)
        present = distinct(owners).astype(np.int32)
        present_rows = IdRows(present)
        (category,) = self.classes.of(self.sync.record).values()
        labels = self.others.of(self.sync.record)
        things, categories = find_things(self.sync, present, category, labels)
        rows = self.instance_rows.find(self.instances, "label_image: instance")

        def numbered(ids: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
            return present_rows.find(ids, "label_image: instance")

        seen = numbered(self.instances)
        visible = np.flatnonzero(seen >= 0)
        of_things = np.array([thing.category for thing in things] + [MISS], np.int32)
        return Labels(
            depth=self.depth.reshape(height, width),
            positions=self.positions.reshape(height, width, 3),
            normals=self.normals.reshape(height, width, 3),
            uvs=self.uvs.reshape(height, width, 2),
            thing_ids=seen.reshape(height, width),
            material_ids=self.materials.reshape(height, width),
            category_ids=of_things[seen].reshape(height, width),
            layer_depths=self.layer_depths.reshape(-1, height, width),
            layer_ids=numbered(self.layer_instances).reshape(-1, height, width),
            visible=masks_of(seen[visible].astype(np.int64), visible.astype(np.int64), len(present), self.size),
            amodal=masks_of(numbered(owners).astype(np.int64), pixels, len(present), self.size),
            things=things,
            categories=categories,
            material_names=tuple(str(name) for name in self.sync.material_names),
            labels={
                name: LabelColumn(label.at(rows, self.materials).reshape(height, width), label.table)
                for name, label in labels.items()
            },
            flow=self._flow() if self.flow else None,
            camera=describe_camera(self.camera, self.frame, self.cut),
            warnings=without_scans(self.sync.warnings, self.sync.record.not_shown),
        )

    def _flow(self) -> npt.NDArray[np.float32]:
        import perfect_bvh

        shutter = perfect_bvh.Shutter(cameras=self.sync.camera_motion, blurs=False)
        made: npt.NDArray[np.float32] = perfect_bvh.render_passes(
            self.sync.scene,
            replace(self.camera, border=(0.0, 1.0, 0.0, 1.0)),
            size=self.frame,
            appearance=self.sync.appearance,
            passes=("vector",),
            shutter=shutter,
            threads=self.threads,
        )["vector"]
        return made[self.cut]
