"""Images of a scene: pictures to look at, and arrays of the surface that each pixel's ray hit."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal, TypedDict, Unpack, get_args

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Progress, share_of
from ._checks import check_choice, check_count, check_kind, check_number
from ._render_arguments import (
    LightPaths,
    appearance_arguments,
    check_color,
    check_size,
    check_tiles,
    find_bright_sky,
    light_path_arguments,
)
from .adaptive_sampling import TILE_SIZE, AdaptiveSampling
from .appearance import Appearance
from .audit import RenderAudit
from .camera import Camera, Shutter, camera_arguments, shutter_arguments
from .hits import Hits
from .scene import Scene, Snapshot

Mode = Literal[
    "preview", "clay", "matcap", "wireframe", "normal", "uv", "depth", "distance", "instance", "material", "cost"
]
Color = tuple[float, float, float]
Passes = dict[str, npt.NDArray[Any]]

MODES: tuple[str, ...] = get_args(Mode)

NO_DEPTH = 1e10
"""The depth where nothing was hit: the same number as in Blender's own depth pass."""

# By name: the shape after (H, W), the dtype, and the value where nothing was hit.
_PASSES: Mapping[str, tuple[tuple[int, ...], type[np.generic], float]] = {
    "combined": ((4,), np.float32, 0.0),
    "depth": ((), np.float32, NO_DEPTH),
    "distance": ((), np.float32, NO_DEPTH),
    "normal": ((3,), np.float32, 0.0),
    "object_index": ((), np.int32, 0),
    "material_index": ((), np.int32, 0),
    "instance": ((), np.int32, -1),
    "primitive": ((), np.int32, -1),
    "vector": ((4,), np.float32, 0.0),
    "nodes_visited": ((), np.int32, 0),
    "primitives_tested": ((), np.int32, 0),
    "denoising_color": ((4,), np.float32, 0.0),
    "denoising_albedo": ((3,), np.float32, 0.0),
    "denoising_normal": ((3,), np.float32, 0.0),
}
_GUIDES = ("denoising_color", "denoising_albedo", "denoising_normal")
_BLENDED = ("combined", *_GUIDES)  # passes that are means of samples
PASSES: tuple[str, ...] = tuple(_PASSES)


class RenderOptions(TypedDict, total=False):
    """Further arguments of `render`, `render_passes` and `render_progressively`, by keyword.

    Attributes:
        threads: The largest number of threads; 0, the default, for all that the process may use. It changes no pixel.
        seed: Another seed gives other noise; images of the same seed are equal bit for bit.
        first_sample: The number of the first sample, so that an image can be continued: the mean of samples 0 to 3 and
            4 to 7, weighted by their counts, is as good as that of 0 to 7. A single sample with first_sample 0 is
            at the pixel's centre; all others spread over the pixel filter.
        is_continued: Whether other samples will follow, so that a single first one spreads like them; default False.
        filter_width: How far the pixel filter (a Blackman-Harris window) reaches to each side, in pixels; default 1.5.
            0 puts every sample at the pixel's centre. Neighbouring pixels share samples.
        ao_distance: clay: the largest distance at which a surface occludes another, in world units; its effect fades to
            nothing over that distance. None, the default: 0.35 of the diagonal of the scene's bounding box.
        light_rays: clay: rays to the sky and to the key light for each sample. None, the default: 1 for a single
            sample, else 2, which takes less time for an image of the same noise.
        light_paths: preview: the limits of light paths, see `LightPaths`.
        clay_color: clay, matcap, wireframe: one scene-linear colour for everything instead of the materials' viewport
            colours.
        wire_width: wireframe: the width of the lines in pixels; default 1.
        wire_color: wireframe: the scene-linear colour of the lines.
        tiles: (rows, columns) bool, the tiles of the image to trace, 32 x 32 pixels each, the first in the upper left
            corner. Pixels in other tiles are like pixels outside a border. None, the default: all.
        shutter: How an image shows motion, see `Shutter`. None, the default: objects are shown at time 0.
        audit: A `RenderAudit`: it sets the share of the camera rays to check again, and receives the result.
    """

    threads: int
    seed: int
    first_sample: int
    is_continued: bool
    filter_width: float
    ao_distance: float | None
    light_rays: int | None
    light_paths: LightPaths
    clay_color: Color | None
    wire_width: float
    wire_color: Color
    tiles: npt.NDArray[np.bool_] | None
    shutter: Shutter | None
    audit: RenderAudit | None


def render(
    scene: Scene | Snapshot,
    camera: Camera,
    mode: Mode = "clay",
    size: tuple[int, int] = (960, 540),
    samples: int = 1,
    appearance: Appearance | None = None,
    progress: Progress | None = None,
    **options: Unpack[RenderOptions],
) -> npt.NDArray[np.float32]:
    """Renders an image of a scene: (H, W, 4) float32, scene-linear, premultiplied by alpha, row 0 on top.

    It is the pass "combined" of `render_passes`, which explains the arguments.
    """
    return _render("render", scene, camera, mode, size, samples, appearance, ("combined",), progress, options)[
        "combined"
    ]


def render_passes(
    scene: Scene | Snapshot,
    camera: Camera,
    *,
    mode: Mode = "clay",
    size: tuple[int, int] = (960, 540),
    samples: int = 1,
    appearance: Appearance | None = None,
    passes: Iterable[str] = ("combined", "depth", "normal"),
    progress: Progress | None = None,
    **options: Unpack[RenderOptions],
) -> Passes:
    """Renders an image of a scene and arrays of the surfaces in its pixels, all from one walk over the pixels.

    Returns the arrays by name, row 0 on top. Holdouts are transparent, and misses in the other passes. Pixels outside
    the camera's border are not traced: they are transparent black, and misses.

    Args:
        scene: A `Scene` without pending edits, or a `Snapshot`.
        mode: The look of the image. "preview": the scene under its own lights and world, by path tracing: base colours
            and images, metal, glass, emission, transparency, soft shadows, light that bounces
            (`RenderOptions.light_paths`). If the appearance has no world, the studio's sky lights the scene. "clay":
            diffuse surfaces in a photographer's studio: soft sky, ambient occlusion, one soft key light. "matcap": form
            from the normals as seen by the viewer, without shadows, like a sphere in a studio. "wireframe": the edges
            of the triangles over softly lit surfaces. "normal": the shading normal in world space, -1..1 as 0..1. "uv":
            the uv coordinates of the mesh's map as red and green, blue 1; black where there is no map. "depth",
            "distance": along the view axis, along the ray, in world units, in all of R, G and B; 1e10 where nothing was
            hit. These two are not blended: they always use one ray through the pixel's centre, for any `samples`.
            "instance", "material": one colour for each, always the same for the same id or row of the material table.
            "cost": nodes visited plus triangles tested by the camera ray, on a logarithmic scale from 2 (violet) to 512
            and more (pale yellow), the same for all images. The colours of the last three are meant for a plain sRGB
            display, without a scene's view transform.
        size: (width, height) in pixels.
        samples: Camera rays for each pixel of the image.
        appearance: materials, normals and visibility; None: everything is plain, flat and visible.
        passes: The arrays to make. All except "combined" hold the surface that the ray through the pixel's centre hits:
            they are exact, and never blended where an edge crosses the pixel. "combined" (H, W, 4) float32: the image,
            see `render`. "depth", "distance" (H, W) float32: along the view axis, along the ray; 1e10 where nothing was
            hit. They are equal in panoramas. "normal" (H, W, 3) float32: shading normal, world space, unit length,
            towards the viewer; zero on a miss. "object_index", "material_index" (H, W) int32: pass indices; 0 on a
            miss. "instance", "primitive" (H, W) int32: instance id, triangle of its mesh; -1 on a miss. "vector" (H, W,
            4) float32: the motion of the pixel's surface in the image, in pixels to the right and up, as in Blender's
            Vector pass: the offset from here to its position when the shutter opens, and the offset to here from its
            position when the shutter closes. Zero on a miss, for surfaces that are behind the camera at that time, and
            without a shutter. "nodes_visited", "primitives_tested" (H, W) int32: the cost of the ray. "denoising_color"
            (H, W, 4) float32: the image for a denoiser, which expects independent noise: the mean of each pixel's own
            samples, whereas neighbours share samples in "combined". "denoising_albedo", "denoising_normal" (H, W, 3)
            float32: guides for a denoiser: the share of light that surfaces reflect and their normal in world space.
            They are blended like "combined"; "preview" takes them from surfaces seen in mirrors and through panes, too.
        progress: Called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.
        options: See `RenderOptions`.

    Raises:
        ValueError: For bad arguments, StaleSceneError if edits wait, Cancelled.
    """
    return _render("render_passes", scene, camera, mode, size, samples, appearance, passes, progress, options)


def render_progressively(
    scene: Scene | Snapshot,
    camera: Camera,
    *,
    mode: Mode = "clay",
    size: tuple[int, int] = (960, 540),
    samples: int = 16,
    appearance: Appearance | None = None,
    passes: Iterable[str] = ("combined",),
    time_limit: float = 0.0,
    sampling: AdaptiveSampling | None = None,
    noise: Passes | None = None,
    progress: Progress | None = None,
    **options: Unpack[RenderOptions],
) -> Iterator[tuple[int, Passes]]:
    """Renders 1, 2, 4, 8 ... samples of a pixel, and yields (samples done, passes) after each of these rounds.

    The arguments are those of `render_passes`; `progress` counts over all rounds. Each round yields the same array
    objects. "combined" and a denoiser's guides are refined in place; the other passes are complete after the first
    round. The scene may be edited during the iteration: all rounds show its state at the first one.

    Args:
        time_limit: In seconds, 0 for none. Rounds are made smaller so that their expected time fits. They end when not
            one more sample fits. The first sample is always rendered. The caller's time between rounds counts.
        sampling: A new `AdaptiveSampling` of this size. Tiles that are good enough get no more samples, and rounds end
            when all tiles are. It holds the number of samples of each tile; the yielded number is that of the
            unfinished tiles. None, the default: all tiles get the same number.
        noise: A dictionary that receives, by the name of each refined pass, an array of the pass's shape and dtype. It
            holds an error of the same expected size as the pass's own, see `restore_detail`. It is zero while there is
            only one round. None, the default: it is not computed.
    """
    snapshot = _snapshot_of("render_progressively", scene)
    total = check_count("render_progressively", "samples", samples, 1)
    names = _check_passes("render_progressively", passes)
    limit = check_number("render_progressively", "time_limit", time_limit, 0.0, 1e9)
    if sampling is not None:
        _check_sampling(sampling, size, names, options.get("tiles"))
        sampling.keep_within(camera.border)
    start = options.get("first_sample", 0)
    options["is_continued"] = options.get("is_continued", False) or total > 1
    started = time.perf_counter()
    done, work = 0, 0  # samples of a pixel; samples of all tiles
    result: Passes = {}
    while done == 0 or (done < total and not (sampling and sampling.is_finished)):
        count = min(max(done, 1), total - done)
        tile_count = 1 if sampling is None else sampling.tile_count
        if limit and done:
            seconds = time.perf_counter() - started
            count = min(count, int((limit - seconds) / max(seconds * tile_count / work, 1e-9)))
            if count <= 0:
                return
        options["first_sample"] = start + done
        if done and sampling is not None:
            options["tiles"] = sampling.tiles
        share = share_of(progress, done / total, count / total)
        wanted = names if done == 0 else [name for name in names if name in _BLENDED]
        made = _render("render_progressively", snapshot, camera, mode, size, count, appearance, wanted, share, options)
        result = result or made
        _add_round(result, made, done, count, sampling, noise)
        done, work = done + count, work + count * tile_count
        yield done, result


def _add_round(
    result: Passes, made: Passes, done: int, count: int, sampling: AdaptiveSampling | None, noise: Passes | None
) -> None:
    """Merges a round of samples into the mean of the `done` samples before it, and updates the adaptive sampling."""
    pixels = None
    if sampling is not None:
        pixels = sampling.pixels()
        sampling.note_round(result["combined"], made["combined"], done, count)
    for name in (name for name in made if name in _BLENDED):
        error = None if noise is None else noise.setdefault(name, np.zeros_like(result[name]))
        if done:
            add_samples(result[name], made[name], done, count, pixels, error)


def add_samples(
    mean: npt.NDArray[np.float32],
    made: npt.NDArray[np.float32],
    done: int,
    count: int,
    pixels: npt.NDArray[np.bool_] | None = None,
    noise: npt.NDArray[np.float32] | None = None,
) -> None:
    """Turns the mean of `done` samples of pixels, (H, W, C), into the mean that includes `count` more, in place.

    Args:
        made: The mean of the new samples.
        pixels: (H, W), the pixels that have new samples; None for all.
        noise: Like `mean`, receives an error of the same expected size as the new mean's. The mean of the old samples
            and that of all samples have errors of known proportion, so their difference, scaled, has the new mean's
            variance.
    """
    change = (made - mean) * np.float32(count / (done + count))
    where = True if pixels is None else pixels[..., np.newaxis]
    np.add(mean, change, out=mean, where=where)
    if noise is not None:
        np.multiply(change, np.float32(math.sqrt(done / count)), out=noise, where=where)


def depth_to_grey(
    depth: npt.NDArray[np.float32], near: float | None = None, far: float | None = None
) -> npt.NDArray[np.float32]:
    """Converts a depth pass to greys to look at: 1 at `near` and nearer, 0 at `far` and beyond, linear between.

    Args:
        depth: (...) float32, as the passes "depth" and "distance".
        near, far: None for the nearest and the farthest depth that was hit.

    Returns:
        (...) float32; 0 where nothing was hit.
    """
    hit = depth < NO_DEPTH
    if not hit.any():
        return np.zeros_like(depth)
    low = float(depth[hit].min()) if near is None else near
    high = float(depth[hit].max()) if far is None else far
    scale = 1.0 / (high - low) if high > low else 0.0
    return np.asarray(np.where(hit, np.clip(1.0 - (depth - low) * scale, 0.0, 1.0), 0.0), np.float32)


def cost_to_color(costs: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Returns the colours of the mode "cost" for sums of nodes visited and triangles tested, for a legend.

    Args:
        costs: (...) numbers.

    Returns:
        (..., 3) float32, scene-linear RGB, as the image has it.
    """
    values = np.asarray(costs, np.float32)
    return _core.cost_colors(np.ascontiguousarray(values.reshape(-1))).reshape(*values.shape, 3)


# The columns of `materials_at`, with their widths.
_MATERIAL_COLUMNS = {
    **dict.fromkeys(("colors", "metals", "tints", "specular_tints"), 3),
    **dict.fromkeys(("alphas", "metallics", "roughnesses", "reflectances", "transmissions"), 1),
    **dict.fromkeys(("translucencies", "iors", "even_metals", "plain_refractions"), 1),
}


def materials_at(scene: Scene | Snapshot, appearance: Appearance, hits: Hits) -> dict[str, npt.NDArray[np.float32]]:
    """Finds the material properties where rays hit, as the mode "preview" sees them at perpendicular incidence.

    Args:
        scene: The scene that was hit.
        appearance: The appearance of that scene.
        hits: (N,), none of them a miss, with instance_ids, primitive_ids and primitive_uvs.

    Returns:
        (N,) or (N, 3) float32 columns by their names in `MaterialTable`: colors, metals, tints (of refracted
        light), specular_tints, alphas, metallics, roughnesses, reflectances, transmissions, translucencies, iors,
        even_metals and plain_refractions.

    Raises:
        ValueError: The hits are of another scene.
    """
    snapshot = _snapshot_of("materials_at", scene)
    looks = appearance_arguments("materials_at", check_kind("materials_at", "appearance", appearance, Appearance))
    found = _core.materials_at(
        snapshot._snapshot, looks, hits.instance_ids, hits.primitive_ids, np.ascontiguousarray(hits.primitive_uvs)
    )
    columns, first = {}, 0
    for name, width in _MATERIAL_COLUMNS.items():
        columns[name] = found[:, first] if width == 1 else found[:, first : first + width]
        first += width
    return columns


def _render(
    function: str,
    scene: Scene | Snapshot,
    camera: Camera,
    mode: str,
    size: tuple[int, int],
    samples: int,
    appearance: Appearance | None,
    passes: Iterable[str],
    progress: Progress | None,
    options: RenderOptions,
) -> Passes:
    snapshot = _snapshot_of(function, scene)
    width, height = check_size(function, size)
    count = check_count(function, "samples", samples, 1)
    view = camera_arguments(function, camera)
    settings = _settings(function, options, count) | {
        "mode": check_choice(function, "mode", mode, MODES),
        "width": width,
        "height": height,
        "samples": count,
        "tiles": check_tiles(function, options.get("tiles"), (width, height), TILE_SIZE),
        "shutter": shutter_arguments(function, view["projection"], options.get("shutter")),
    }
    looks = appearance_arguments(function, appearance or Appearance())
    if mode == "preview" and looks["world"] is not None and 0 <= looks["world"]["image"] < len(looks["images"]):
        looks["bright_sky"] = find_bright_sky(looks["images"][looks["world"]["image"]], settings["threads"])
    wanted = _check_passes(function, passes)
    # Guides are made together, and always with the image that they are for.
    made = (*wanted, *_BLENDED) if any(name in _GUIDES for name in wanted) else wanted
    kinds = {name: _PASSES[name] for name in made}
    arrays = {name: np.full((height, width, *row), nothing, dtype) for name, (row, dtype, nothing) in kinds.items()}
    audit = options.get("audit")
    share = progress if audit is None else share_of(progress, 0.0, 0.5)
    kept = _core.render(snapshot._snapshot, view, looks, settings, arrays, share)
    if audit is not None:
        audit.check(snapshot._snapshot, kept, settings["threads"], share_of(progress, 0.5, 0.5))
    return {name: arrays[name] for name in wanted}


def _snapshot_of(function: str, scene: Scene | Snapshot) -> Snapshot:
    if not isinstance(scene, Scene | Snapshot):
        raise ValueError(f"{function}: scene must be a Scene or a Snapshot, got {type(scene).__name__}")
    return scene.snapshot() if isinstance(scene, Scene) else scene


def _check_sampling(sampling: AdaptiveSampling, size: tuple[int, int], passes: list[str], tiles: object) -> None:
    function = "render_progressively"
    check_kind(function, "sampling", sampling, AdaptiveSampling)
    if sampling.size != check_size(function, size):
        raise ValueError(f"{function}: sampling must be for an image of {tuple(size)} pixels, got {sampling.size}")
    if sampling.sample_counts.any():
        raise ValueError(f"{function}: sampling must be new, got one of an image that was rendered before")
    if "combined" not in passes:
        raise ValueError(f"{function}: passes must hold 'combined', which sampling judges, got {', '.join(passes)}")
    if tiles is not None:
        raise ValueError(f"{function}: tiles must be None where sampling is given, which chooses them")


def _check_passes(function: str, passes: Iterable[str]) -> list[str]:
    names = [passes] if isinstance(passes, str) else list(passes)
    if not names:
        raise ValueError(f"{function}: passes is empty; name at least one of {', '.join(PASSES)}")
    return list(dict.fromkeys(check_choice(function, "passes", name, PASSES) for name in names))


def _settings(function: str, options: RenderOptions, samples: int) -> dict[str, Any]:
    """Returns the checked options as the native module takes them, with defaults for missing ones."""
    known = RenderOptions.__annotations__
    for name in sorted(set(options) - set(known)):
        raise TypeError(f"{function}: unknown option {name!r}; there are {', '.join(known)}")
    distance, color, audit = options.get("ao_distance"), options.get("clay_color"), options.get("audit")
    light_rays = options.get("light_rays")
    if audit is not None:
        check_kind(function, "audit", audit, RenderAudit)
    return {
        **{name: check_count(function, name, options.get(name, 0), 0) for name in ("threads", "seed", "first_sample")},
        "is_continued": bool(options.get("is_continued", False)),
        "filter_width": check_number(function, "filter_width", options.get("filter_width", 1.5), 0.0, 16.0),
        "ao_distance": 0.0 if distance is None else check_number(function, "ao_distance", distance, 1e-30, 1e30),
        "light_rays": check_count(function, "light_rays", min(samples, 2) if light_rays is None else light_rays, 1),
        "light_paths": light_path_arguments(function, options.get("light_paths", LightPaths())),
        "clay_color": None if color is None else check_color(function, "clay_color", color),
        "wire_width": check_number(function, "wire_width", options.get("wire_width", 1.0), 0.01, 1000.0),
        "wire_color": check_color(function, "wire_color", options.get("wire_color", (0.02, 0.02, 0.025))),
        "kept_share": 0.0 if audit is None else audit.share,
    }
