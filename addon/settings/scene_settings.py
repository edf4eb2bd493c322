"""The settings that a Blender scene carries: `scene.perfect_bvh`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from .bake_settings import PERFECT_BVH_PG_bake
from .label_settings import PERFECT_BVH_PG_label_images
from .modes import DEFAULT_MODE, MODES
from .properties import choice, number, pointer, switch, whole
from .scan_settings import PERFECT_BVH_PG_scan
from .view_settings import CLASSES as TREE_CLASSES
from .view_settings import PERFECT_BVH_PG_compare

if TYPE_CHECKING:
    from perfect_bvh import Camera, LightPaths, Shutter

# How far a scene lets light bounce: what Cycles keeps of it in the file, as both engines show the same scene.


# Of Cycles' settings and ours.
_NAMES = {
    "max_bounces": "max_bounces",
    "diffuse_bounces": "diffuse_bounces",
    "glossy_bounces": "glossy_bounces",
    "transmission_bounces": "transmission_bounces",
    "transparent_max_bounces": "transparent_bounces",
    "sample_clamp_direct": "clamp_direct",
    "sample_clamp_indirect": "clamp_indirect",
    "blur_glossy": "filter_glossy",
    "caustics_reflective": "reflective_caustics",
    "caustics_refractive": "refractive_caustics",
}
_MOST_BOUNCES = 250


def light_path_settings(scene: bpy.types.Scene) -> bpy.types.bpy_struct | None:
    """Returns the owner of the light path settings; None if Cycles is disabled."""
    return getattr(scene, "cycles", None)


def read_light_paths(scene: bpy.types.Scene) -> LightPaths:
    """Cycles' settings of `scene`; the engine's own where Cycles is not there."""
    import perfect_bvh

    settings = light_path_settings(scene)
    if settings is None:
        return perfect_bvh.LightPaths()
    values = {ours: getattr(settings, name) for name, ours in _NAMES.items()}
    return perfect_bvh.LightPaths(
        **{name: min(value, _MOST_BOUNCES) if name.endswith("_bounces") else value for name, value in values.items()}
    )


# Scene settings ------------------------------------------------------------------------------------------------------


ENGINE_NAME = "PERFECT_BVH"
MODE_ITEMS = [(mode.name.upper(), mode.label, mode.description, mode.number) for mode in MODES]


@dataclass(frozen=True, slots=True)
class RenderSettings:
    """The settings of one render, read from a scene's properties.

    threads: 0 for every core. audit_share: the share of camera rays to check again, 0 for none. denoise: whether it is
    denoised if the mode has noise. time_limit: seconds for tracing, 0 for any; the first sample is always finished.
    noise_threshold: pixels with less noise get no more samples than min_samples; 0 for none. min_samples: 0 for the
    renderer's own. light_paths: the limits of light's bounces, None for the renderer's own.
    """

    mode: str
    samples: int
    ao_distance: float
    use_material_colors: bool
    threads: int
    audit_share: float = 0.0
    denoise: bool = False
    seed: int = 0
    time_limit: float = 0.0
    noise_threshold: float = 0.0
    min_samples: int = 0
    light_paths: LightPaths | None = None


def _take_render_samples(settings: bpy.types.PropertyGroup, value: bool) -> None:
    """Otherwise the number begins as that of renders, to be changed from there."""
    if value != settings.use_render_samples:
        settings.viewport_samples = 0 if value else settings.samples


class PERFECT_BVH_PG_settings(bpy.types.PropertyGroup):
    """Saved in the .blend file, animatable like any other setting."""

    scan: pointer("Scan", "Settings of the Scan button", PERFECT_BVH_PG_scan)
    label_images: pointer("Label Images", "Settings of the Label Images button", PERFECT_BVH_PG_label_images)
    bake: pointer(
        "Bake Sun, Sky and Thickness",
        "What the Bake Sun, Sky and Thickness button asks of each face",
        PERFECT_BVH_PG_bake,
    )
    compare: pointer("Compare", "The two BVHs of the active object to compare", PERFECT_BVH_PG_compare)

    mode: choice("Mode", "What the image shows", MODE_ITEMS, DEFAULT_MODE.upper())
    samples: whole(
        "Samples",
        "Camera rays per pixel of a render, and of a view that is rendered to an image",
        *(16, 1, 65536),
        soft_max=256,
    )
    viewport_samples: whole(
        "Viewport Samples",
        "Final number of camera rays per pixel of a Rendered viewport; 0 for the number of a render",
        *(0, 0, 65536),
        soft_max=256,
    )
    # Separate from the number, which earlier files have, and which scripts set.
    use_render_samples: switch(
        "Samples as Render",
        "Use the number of samples of a render in Rendered viewports",
        get=lambda settings: settings.viewport_samples == 0,
        set=_take_render_samples,
        options=set(),
    )
    use_noise_threshold: switch("Noise Threshold", "Stop sampling a render where little noise is left", True)
    noise_threshold: number(
        "Noise Threshold",
        "Noise that may remain. Lower values take more samples; 0 takes all",
        *(0.01, 0.0, 1.0),
        soft_min=0.001,
        step=1,
        precision=4,
    )
    min_samples: whole(
        "Min Samples", "Minimum number of samples per pixel of a render; 0 for 16", 0, 0, 65536, soft_max=256
    )
    use_viewport_noise_threshold: switch(
        "Viewport Noise Threshold", "Stop sampling a Rendered viewport where little noise is left", True
    )
    viewport_noise_threshold: number(
        "Viewport Noise Threshold",
        "Noise that may remain in a Rendered viewport. Lower values take more samples; 0 takes all",
        *(0.1, 0.0, 1.0),
        soft_min=0.001,
        step=1,
        precision=4,
    )
    viewport_min_samples: whole(
        "Viewport Min Samples",
        "Minimum number of samples per pixel of a Rendered viewport; 0 for 16",
        *(0, 0, 65536),
        soft_max=256,
    )
    use_denoising: switch("Denoise", "Denoise renders, guided by the colors and normals of surfaces", True)
    use_viewport_denoising: switch(
        "Denoise Viewport", "Denoise Rendered viewports, guided by the colors and normals of surfaces", True
    )
    time_limit: number(
        "Time Limit",
        "Seconds for tracing a frame, with fewer samples if necessary; 0 for no limit",
        *(0.0, 0.0),
        soft_max=3600.0,
        step=100,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
    )
    seed: whole("Seed", "Seed of the noise pattern", 0, 0)
    ao_distance: number(
        "AO Distance",
        "Largest distance at which surfaces darken each other in Clay; 0 for the size of the scene",
        *(0.0, 0.0),
        soft_max=100.0,
        subtype="DISTANCE",
    )
    use_material_colors: switch("Material Colors", "Use the viewport colors of the materials instead of grey", True)
    preview_percentage: whole(
        "Image Size",
        "Size of the image, compared with the viewport, or with the render where there is no viewport",
        *(100, 1, 100),
        subtype="PERCENTAGE",
    )
    # In no panel: for scripts and the command line. It has a new name, so that files from the time when a panel had a
    # switch and a share for it do not have their renders checked without a visible setting.
    audit: number(
        "Audit",
        "Share of a render's camera rays that is checked again, in double precision and without a tree; "
        "those near hair and points cannot be judged",
        *(0.0, 0.0, 1.0),
        precision=4,
    )


def read_settings(scene: bpy.types.Scene, is_viewport: bool = False) -> RenderSettings:
    """The settings of `scene`, for a render or a viewport; threads follow Blender's own setting."""
    settings = scene.perfect_bvh
    is_adaptive = settings.use_viewport_noise_threshold if is_viewport else settings.use_noise_threshold
    threshold = settings.viewport_noise_threshold if is_viewport else settings.noise_threshold
    return RenderSettings(
        mode=settings.mode.lower(),
        samples=(settings.viewport_samples if is_viewport else 0) or settings.samples,
        ao_distance=settings.ao_distance,
        use_material_colors=settings.use_material_colors,
        threads=scene.render.threads if scene.render.threads_mode == "FIXED" else 0,
        audit_share=settings.audit,
        denoise=settings.use_viewport_denoising if is_viewport else settings.use_denoising,
        seed=settings.seed,
        time_limit=0.0 if is_viewport else settings.time_limit,
        noise_threshold=threshold if is_adaptive else 0.0,
        min_samples=settings.viewport_min_samples if is_viewport else settings.min_samples,
        light_paths=read_light_paths(scene),
    )


def preview_settings() -> RenderSettings:
    """Returns the settings of Blender's previews of materials, lights and worlds, repeated while a value is dragged."""
    return RenderSettings(
        DEFAULT_MODE, samples=64, ao_distance=0.0, use_material_colors=True, threads=0, time_limit=1.0
    )


CLASSES = (
    PERFECT_BVH_PG_scan,
    PERFECT_BVH_PG_label_images,
    PERFECT_BVH_PG_bake,
    *TREE_CLASSES,
    PERFECT_BVH_PG_settings,
)


def register() -> None:
    for group in CLASSES:
        bpy.utils.register_class(group)
    bpy.types.Scene.perfect_bvh = bpy.props.PointerProperty(
        name="Perfect BVH", description="How Perfect BVH renders and scans the scene", type=PERFECT_BVH_PG_settings
    )


def unregister() -> None:
    del bpy.types.Scene.perfect_bvh
    for group in reversed(CLASSES):
        bpy.utils.unregister_class(group)


# Motion blur ---------------------------------------------------------------------------------------------------------
# Motion in images: Blender's own settings, and those that Cycles keeps in the file.


# Where the shutter opens, in shares of the time that it is open, from the frame.
_OPENS = {"START": 0.0, "CENTER": -0.5, "END": -1.0}
# Of the curve that says how far it is open: places that are looked up.
_CURVE_SIZE = 65


@dataclass(frozen=True, slots=True)
class ShutterSettings:
    """The part of a scene's motion that an image shows.

    begin, end: the interval of the animation, in frames from the current one. blurs: whether motion in it
    is blurred; if not, objects are shown at its middle. curve, rolling: as `perfect_bvh.Shutter` takes them.
    """

    begin: float
    end: float
    blurs: bool = True
    curve: tuple[float, ...] | None = None
    rolling: float | None = None

    def make_shutter(self, cameras: tuple[Camera, ...]) -> Shutter:
        """Makes a shutter. cameras: at evenly spaced times from begin to end; empty if the camera does not move."""
        import perfect_bvh

        frame_time = min(max(-self.begin / (self.end - self.begin), 0.0), 1.0)
        return perfect_bvh.Shutter(self.curve, self.rolling, cameras, frame_time, self.blurs)


# From the previous frame to the next: the interval of the Vector pass, as in Cycles.
NEIGHBOURS = ShutterSettings(-1.0, 1.0, blurs=False)


def rolling_shutter_settings(scene: bpy.types.Scene) -> bpy.types.bpy_struct | None:
    """Returns the owner of the rolling shutter's settings; None if Cycles is disabled."""
    return getattr(scene, "cycles", None)


def object_motion_settings(owner: bpy.types.Object) -> bpy.types.bpy_struct | None:
    """Returns the owner of an object's own switches and steps; None if Cycles is disabled."""
    return getattr(owner, "cycles", None)


def has_motion_blur(view_layer: bpy.types.ViewLayer, scene: bpy.types.Scene) -> bool:
    """Whether renders blur motion; a layer may disable it, and a shutter of zero duration shows none."""
    render = scene.render
    return bool(render.use_motion_blur and render.motion_blur_shutter > 0.0 and view_layer.use_motion_blur)


def read_motion_blur(scene: bpy.types.Scene) -> ShutterSettings:
    """Reads the settings for a render of `scene` with motion blur."""
    render = scene.render
    opens = _OPENS[render.motion_blur_position] * render.motion_blur_shutter
    return ShutterSettings(
        opens, opens + render.motion_blur_shutter, curve=_read_curve(scene), rolling=_read_rolling(scene)
    )


def _read_curve(scene: bpy.types.Scene) -> tuple[float, ...] | None:
    """Reads the shutter's curve; None if it is fully open all the time, or never opens."""
    mapping = scene.render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    heights = tuple(max(mapping.evaluate(curve, place / (_CURVE_SIZE - 1)), 0.0) for place in range(_CURVE_SIZE))
    return None if min(heights) == max(heights) else heights


def _read_rolling(scene: bpy.types.Scene) -> float | None:
    settings = rolling_shutter_settings(scene)
    if settings is None or settings.rolling_shutter_type == "NONE":
        return None
    return float(settings.rolling_shutter_duration)
