"""Perfect BVH: a two-level bounding volume hierarchy that answers rays by the million.

>>> scene = Scene()
>>> mesh = scene.add_mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
>>> instance = scene.add_instance(mesh)
>>> report = scene.commit()
>>> hits = scene.cast_rays([(0.2, 0.2, 1.0)], [(0.0, 0.0, -1.0)])
>>> float(hits.t_hit[0])
1.0
"""

from ._core import __version__
from ._render_arguments import LightPaths
from .adaptive_sampling import AdaptiveSampling
from .appearance import (
    Appearance,
    HairTable,
    ImageTexture,
    InstanceTable,
    LightTable,
    MaterialTable,
    MeshAppearance,
    World,
)
from .audit import Audit, RenderAudit
from .build_config import BuildConfig
from .calibration import Calibration
from .camera import Camera, Lens, Shutter
from .closest_points import ClosestPoints
from .denoise import Denoiser, apply_pixel_filter, denoise, denoiser_name, restore_detail
from .errors import Cancelled, EngineError, StaleSceneError
from .finishes import FinishTable
from .hits import Hits
from .nodes import NodeBuilder, NodeProgram
from .queries import Intersections, Queries
from .ray_walk import RayWalk, TreeBoxes, WalkEvent
from .render import (
    MODES,
    PASSES,
    RenderOptions,
    cost_to_color,
    depth_to_grey,
    materials_at,
    render,
    render_passes,
    render_progressively,
)
from .report import Alternative, CommitReport, MeshReport, SceneStatistics, TopLevelReport, TreeStatistics
from .scene import Scene, Snapshot
from .threads import (
    StopFlag,
    active_isa,
    available_isas,
    make_stop_flag,
    set_active_isa,
    set_thread_count,
    shutdown_threads,
    thread_count,
)

__all__ = [
    "MODES",
    "PASSES",
    "AdaptiveSampling",
    "Alternative",
    "Appearance",
    "Audit",
    "BuildConfig",
    "Calibration",
    "Camera",
    "Cancelled",
    "ClosestPoints",
    "CommitReport",
    "Denoiser",
    "EngineError",
    "FinishTable",
    "HairTable",
    "Hits",
    "ImageTexture",
    "InstanceTable",
    "Intersections",
    "Lens",
    "LightPaths",
    "LightTable",
    "MaterialTable",
    "MeshAppearance",
    "MeshReport",
    "NodeBuilder",
    "NodeProgram",
    "Queries",
    "RayWalk",
    "RenderAudit",
    "RenderOptions",
    "Scene",
    "SceneStatistics",
    "Shutter",
    "Snapshot",
    "StaleSceneError",
    "StopFlag",
    "TopLevelReport",
    "TreeBoxes",
    "TreeStatistics",
    "WalkEvent",
    "World",
    "__version__",
    "active_isa",
    "apply_pixel_filter",
    "available_isas",
    "cost_to_color",
    "denoise",
    "denoiser_name",
    "depth_to_grey",
    "make_stop_flag",
    "materials_at",
    "render",
    "render_passes",
    "render_progressively",
    "restore_detail",
    "set_active_isa",
    "set_thread_count",
    "shutdown_threads",
    "thread_count",
]
