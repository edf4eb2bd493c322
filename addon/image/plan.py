"""The needs of an image, worked out once: all code that takes part in making it gets the same plan.

Size and border, the attributes to read, the expected samples and rays, the passes. Does not use RenderEngine or syncs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt

from ..settings.modes import find_mode
from ..settings.preferences import denoising_data_settings
from ..settings.scene_settings import NEIGHBOURS, ShutterSettings, has_motion_blur, read_motion_blur, read_settings
from ..statistics.last_result import Owners
from ..support.memory import check_fits
from ..sync.records import AttributeRequest

if TYPE_CHECKING:
    from perfect_bvh import AdaptiveSampling, Appearance, Camera, Scene, Shutter, Snapshot
    from perfect_bvh.render import Passes, Progress

    from ..extract.camera import Frame
    from ..live.scene_sync import SceneSync
    from ..settings.modes import Mode
    from ..settings.scene_settings import RenderSettings


Window = tuple[int, int, int, int]

CLAY_GREY = (0.8, 0.8, 0.8)
# The renderer's names of a denoiser's input: the image of pixels' own samples, and its guides.
NOISY = "denoising_color"
GUIDES = (NOISY, "denoising_albedo", "denoising_normal")
VECTOR = "vector"
# Of a render at its greatest: two images, their noise, shared samples, passes, Blender's copies of them.
BYTES_A_PIXEL = 288
# The share of bounces that reach another surface: the other paths of light leave the scene, or nothing is reflected.
GOING_ON = 0.6


# Passes --------------------------------------------------------------------------------------------------------------
# The passes of a render: which ones a view layer asks for.


MODERN_PASS_NAMES = bpy.app.version >= (5, 0, 0)


@dataclass(frozen=True, slots=True)
class PassSpec:
    """A pass in Blender's words (name, channels, kind, the view layer's switch) and in a frame's images (source)."""

    name: str
    channels: str
    kind: str
    switch: str
    source: str


PASSES = (
    PassSpec("Depth", "Z", "VALUE", "use_pass_z", "depth"),
    PassSpec("Normal", "XYZ", "VECTOR", "use_pass_normal", "normal"),
    PassSpec("Vector", "XYZW", "VECTOR", "use_pass_vector", VECTOR),
    PassSpec("Object Index" if MODERN_PASS_NAMES else "IndexOB", "X", "VALUE", "use_pass_object_index", "object_index"),
    PassSpec(
        "Material Index" if MODERN_PASS_NAMES else "IndexMA", "X", "VALUE", "use_pass_material_index", "material_index"
    ),
)


# What compositors denoise by themselves, under the names that Cycles gives it.
DENOISING_PASSES = (
    PassSpec("Noisy Image", "RGBA", "COLOR", "denoising_store_passes", NOISY),
    PassSpec("Denoising Normal", "XYZ", "VECTOR", "denoising_store_passes", "denoising_normal"),
    PassSpec("Denoising Albedo", "RGB", "COLOR", "denoising_store_passes", "denoising_albedo"),
)


def enabled_passes(view_layer: bpy.types.ViewLayer, scene: bpy.types.Scene) -> tuple[PassSpec, ...]:
    """Returns the passes of a view layer, except Combined.

    With motion blur there are no vectors: a blurred image must not be blurred again. Blender's own engines do the same.
    """
    switches = denoising_data_settings(view_layer)
    denoising = () if switches is None else (spec for spec in DENOISING_PASSES if getattr(switches, spec.switch))
    with_vector = not has_motion_blur(view_layer, scene)
    wanted = (spec for spec in PASSES if getattr(view_layer, spec.switch) and (with_vector or spec.source != VECTOR))
    return (*wanted, *denoising)


# Plan -----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RenderPlan:
    """The plan of one image.

    size: (width, height) in pixels. window: (left, right, bottom, top), the pixels to trace, from the lower left.
    passes: the renderer's names of the requested passes except "combined". is_cropped: whether files hold only the
    window. motion: the shown part of the scene's motion; None if no pixel shows any. frame: the frame of the
    scene's camera; None for a view. specs: of Blender's passes except Combined.
    """

    settings: RenderSettings
    size: tuple[int, int]
    window: Window
    passes: tuple[str, ...] = ()
    is_cropped: bool = False
    motion: ShutterSettings | None = None
    frame: Frame | None = None
    specs: tuple[PassSpec, ...] = ()

    @property
    def pixel_count(self) -> int:
        """How many are traced."""
        left, right, bottom, top = self.window
        return (right - left) * (top - bottom)

    @property
    def mode(self) -> Mode:
        """The mode of the image."""
        return find_mode(self.settings.mode)

    @property
    def samples(self) -> int:
        """Camera rays for each pixel; distances cannot be averaged, so they get one."""
        return 1 if self.mode.has_range else self.settings.samples

    @property
    def is_denoised(self) -> bool:
        """Whether it will be denoised."""
        return self.settings.denoise and self.mode.is_noisy

    def make_sampling(self) -> AdaptiveSampling | None:
        """Makes an adaptive sampling; None if all pixels get all samples."""
        import perfect_bvh

        threshold = self.settings.noise_threshold
        if threshold == 0.0 or not self.mode.is_noisy:
            return None
        return perfect_bvh.AdaptiveSampling(self.size, threshold, self.settings.min_samples)

    @property
    def traced_passes(self) -> tuple[str, ...]:
        """The passes of the renderer except "combined": the requested ones, and those for denoising."""
        return tuple(dict.fromkeys((*self.passes, *(GUIDES if self.is_denoised else ()))))

    @property
    def expected_rays(self) -> int:
        """The approximate number of rays of all its samples: builds and refits are weighed against it."""
        return round(self.pixel_count * self.samples * self._rays_per_sample)

    @property
    def _rays_per_sample(self) -> float:
        mode = self.mode
        if not mode.has_bounces:
            return mode.rays_per_sample
        import perfect_bvh

        paths = self.settings.light_paths or perfect_bvh.LightPaths()
        places = sum(GOING_ON**bounces for bounces in range(paths.max_bounces + 1))
        # One from each to a light; and on to the next, which is looked for after the last bounce as well.
        return mode.rays_per_sample + places * (1.0 + GOING_ON)

    @property
    def attributes(self) -> AttributeRequest:
        """The attributes that the mode and the passes use; nothing else is read."""
        mode, passes = self.mode, self.passes
        return AttributeRequest(
            material_slots=mode.materials
            or (mode.offers_grey and self.settings.use_material_colors)
            or "material_index" in passes,
            corner_normals=mode.normals or "normal" in passes,
            corner_uvs=mode.uvs,
            shading=mode.shading,
        )

    @property
    def options(self) -> dict[str, Any]:
        """How `perfect_bvh.render` and its like are to trace it."""
        settings = self.settings
        paths = {} if settings.light_paths is None else {"light_paths": settings.light_paths}
        return {
            **paths,
            "threads": settings.threads,
            "seed": settings.seed,
            "ao_distance": settings.ao_distance or None,
            "clay_color": None if settings.use_material_colors else CLAY_GREY,
        }

    def check_memory(self) -> None:
        """Raises ValueError if there is no room for the image."""
        width, height = self.size
        what = f"An image of {width:,} x {height:,} pixels"
        check_fits(what, width * height * BYTES_A_PIXEL, "choose a smaller size")


def plan_render(
    scene: bpy.types.Scene, settings: RenderSettings, passes: tuple[str, ...] = (), *, is_blurred: bool = False
) -> RenderPlan:
    """Plans a render of `scene`, through its camera, inside its border.

    is_blurred: whether motion is blurred, if the mode shows light.
    """
    from ..extract.camera import border_pixels, is_cropped, read_frame

    frame = read_frame(scene)
    size = (frame.width, frame.height)
    motion = NEIGHBOURS if VECTOR in passes else None
    if is_blurred and find_mode(settings.mode).has_bounces:
        motion = read_motion_blur(scene)
    return RenderPlan(settings, size, border_pixels(frame.border, size), passes, is_cropped(scene), motion, frame)


def plan_layer(depsgraph: bpy.types.Depsgraph) -> RenderPlan:
    """Plans a render of the view layer of an evaluated depsgraph, by its scene's settings and its passes."""
    scene, layer = depsgraph.scene, depsgraph.view_layer
    specs = enabled_passes(layer, scene)
    sources = tuple(spec.source for spec in specs)
    plan = plan_render(scene, read_settings(scene), sources, is_blurred=has_motion_blur(layer, scene))
    return replace(plan, specs=specs)


def plan_view(settings: RenderSettings, size: tuple[int, int]) -> RenderPlan:
    """Plans an image that fills a region of the screen, or another of this size."""
    return RenderPlan(settings, size, (0, size[0], 0, size[1]))


# Costs ---------------------------------------------------------------------------------------------------------------
# The objects on which an image's camera rays spend their work, by a part of its pixels. Does not depend on Blender.


COST_PASSES = ("instance", "nodes_visited", "primitives_tested")
# The step of the sampled pixels, each way: counted rays take longer, and shares need no precision of a thousandth.
COST_STEP = 4
WHOLE = (0.0, 1.0, 0.0, 1.0)


def trace_costs(
    scene: Scene | Snapshot,
    camera: Camera,
    size: tuple[int, int],
    appearance: Appearance,
    threads: int,
    progress: Progress | None = None,
    shutter: Shutter | None = None,
) -> Passes:
    """`COST_PASSES` of an image of `size` pixels, smaller by COST_STEP. Arguments and errors: `render_passes`."""
    import perfect_bvh

    width, height = size
    return perfect_bvh.render_passes(
        scene,
        camera,
        mode="cost",
        size=(max(1, width // COST_STEP), max(1, height // COST_STEP)),
        appearance=appearance,
        passes=COST_PASSES,
        progress=progress,
        threads=threads,
        shutter=shutter,
    )


def trace_visits(
    scene: Scene | Snapshot, camera: Camera, size: tuple[int, int], appearance: Appearance, pixel: tuple[int, int]
) -> tuple[int, int] | None:
    """How many nodes the ray through the middle of a pixel visits, and how many triangles it tests.

    pixel: its column, and its row from below, of an image of `size` pixels. None beyond the image or its border.
    Arguments and errors: `render_passes`.
    """
    import perfect_bvh

    (width, height), (column, row) = size, pixel
    x, y = (column + 0.5) / width, (row + 0.5) / height
    first, end, below, above = camera.border
    if not (first <= x < end and below <= y < above and 0 <= column < width and 0 <= row < height):
        return None
    left, right, bottom, top = camera.window
    wide, high = (right - left) / width, (top - bottom) / height
    window = (left + column * wide, left + (column + 1) * wide, bottom + row * high, bottom + (row + 1) * high)
    passes = perfect_bvh.render_passes(
        scene,
        replace(camera, window=window, border=WHOLE),
        mode="cost",
        size=(1, 1),
        appearance=appearance,
        passes=COST_PASSES,
    )
    return int(passes["nodes_visited"][0, 0]), int(passes["primitives_tested"][0, 0])


def owners_of(sync: SceneSync, costs: Passes | None = None) -> Owners:
    """Returns which objects show which meshes of a sync, with the shares of the work of these rays."""
    record = sync.record
    instances = record.instances
    return Owners(
        mesh_ids=sync.mesh_ids,
        objects=record.objects,
        mesh_rows=instances.mesh_indices,
        object_rows=instances.object_indices,
        parent_rows=instances.parent_indices,
        shares=instance_shares(sync, costs) if costs else None,
    )


def instance_shares(sync: SceneSync, costs: Passes) -> npt.NDArray[np.float64]:
    """(I,): the share of the work of all these rays that went into those that end on each instance of the record."""
    seen: npt.NDArray[np.int32] = costs["instance"].ravel()
    work = (costs["nodes_visited"] + costs["primitives_tested"]).ravel()
    ids, hit = sync.appearance.instances.ids, seen >= 0
    if not hit.any():
        return np.zeros(len(ids))
    by_id = np.bincount(seen[hit], weights=work[hit], minlength=int(ids.max()) + 1)
    return np.asarray(by_id[ids] / float(work.sum()))
