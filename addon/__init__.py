"""Perfect BVH for Blender: a render engine, and ray queries that stay in step with the scene.

`register()` makes the engine "PERFECT_BVH" known to Blender; scripts that only cast rays need no more than
`SceneSync`. Importing the package touches neither Blender nor the native engine: the command line and the
tests of `sync` rely on that.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .baking import (
        Bake,
        BakedObject,
        DirectionTable,
        Place,
        bake_rays,
        irradiance_table,
        read_epw,
        sun_position,
        sun_table,
    )
    from .labels import CocoFile, Labels, label_image, save_labels
    from .live.drop_in import BVHTree, ray_cast
    from .live.scene_sync import SceneSync
    from .scanning import (
        Beam,
        CameraGrid,
        DepthCamera,
        Detection,
        Light,
        Noise,
        Optics,
        PointCloud,
        Raster,
        RayCounts,
        Rosette,
        Sensor,
        SpinningLidar,
        load_sensor,
        save_cloud,
        scan,
        sensor_names,
    )
    from .sync.records import AttributeRequest

__all__ = [
    "AttributeRequest",
    "BVHTree",
    "Bake",
    "BakedObject",
    "Beam",
    "CameraGrid",
    "CocoFile",
    "DepthCamera",
    "Detection",
    "DirectionTable",
    "Labels",
    "Light",
    "Noise",
    "Optics",
    "Place",
    "PointCloud",
    "Raster",
    "RayCounts",
    "Rosette",
    "SceneSync",
    "Sensor",
    "SpinningLidar",
    "bake_rays",
    "irradiance_table",
    "label_image",
    "load_sensor",
    "ray_cast",
    "read_epw",
    "register",
    "save_cloud",
    "save_labels",
    "scan",
    "sensor_names",
    "sun_position",
    "sun_table",
    "unregister",
]

_EXPORTS = {
    "AttributeRequest": ".sync.records",
    "BVHTree": ".live.drop_in",
    "Bake": ".baking",
    "BakedObject": ".baking",
    "DirectionTable": ".baking",
    "Place": ".baking",
    "irradiance_table": ".baking",
    "read_epw": ".baking",
    "sun_position": ".baking",
    "sun_table": ".baking",
    "Beam": ".scanning",
    "CameraGrid": ".scanning",
    "CocoFile": ".labels",
    "Labels": ".labels",
    "DepthCamera": ".scanning",
    "Detection": ".scanning",
    "Light": ".scanning",
    "Noise": ".scanning",
    "Optics": ".scanning",
    "PointCloud": ".scanning",
    "Raster": ".scanning",
    "RayCounts": ".scanning",
    "Rosette": ".scanning",
    "SceneSync": ".live.scene_sync",
    "Sensor": ".scanning",
    "SpinningLidar": ".scanning",
    "bake_rays": ".baking",
    "label_image": ".labels",
    "load_sensor": ".scanning",
    "ray_cast": ".live.drop_in",
    "save_cloud": ".scanning",
    "save_labels": ".labels",
    "scan": ".scanning",
    "sensor_names": ".scanning",
}
# In the order of registration. Those that load the native engine are left out where it cannot be loaded.
_MODULES = (
    ".settings.preferences",
    ".settings.scene_settings",
    ".settings.shading_settings",
    ".statistics.last_result",
    ".statistics.messages",
    ".statistics.not_shown",
    ".statistics.update_list",
    ".image.saving",
    ".view3d.rendered.redraws",
    ".view3d.rendered.opening",
    ".engine",
    ".image.data_previews",
    ".operators",
    ".view3d.pointer",
    ".view3d.tree_overlay.overlay",
    ".view3d.cost_scale",
    ".view3d.baked_view",
    ".view3d.view_words",
    ".panels",
    ".cli.blender_command",
)
_NATIVE_MODULES = (
    ".live.sync_cache",
    ".view3d.compare.compare_view",
    ".view3d.scan_points",
    ".view3d.sensor_view",
    ".view3d.walk.walk_view",
)
_LANDMARK = "PERFECT_BVH_PT_render"

_registered: list[Any] = []


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_EXPORTS[name], __name__), name)


def _other_copy() -> str | None:
    """The package that has registered the add-on already, if it is not this one."""
    import bpy

    panel = getattr(bpy.types, _LANDMARK, None)
    return None if panel is None else panel.__module__.partition(".panels")[0]


def register() -> None:
    """Registers the engine, its settings and its panels with Blender; does nothing if they are already registered.

    Raises RuntimeError if another copy of the add-on (pip's in addition to the extension's) is registered. A native
    engine that cannot be loaded is no error here: the panel and each render say why.
    """
    if _registered:
        return
    other = _other_copy()
    if other is not None:
        raise RuntimeError(
            f"Perfect BVH is already registered by {other!r}: disable that copy before {__name__!r} is enabled"
        )
    from .settings.preferences import native_error

    names = _MODULES if native_error() else _MODULES + _NATIVE_MODULES
    try:
        for name in names:
            module = importlib.import_module(name, __name__)
            module.register()
            _registered.append(module)
    except BaseException:
        unregister()
        raise


def unregister() -> None:
    """Undo `register`; does nothing if this copy is not registered."""
    while _registered:
        _registered.pop().unregister()
