"""The settings that a Blender scene carries: `scene.perfect_bvh`."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .modes import DEFAULT_MODE, MODES

ENGINE_NAME = "PERFECT_BVH"
MODE_ITEMS = [(mode.name.upper(), mode.label, mode.description, index) for index, mode in enumerate(MODES)]


@dataclass(frozen=True, slots=True)
class RenderSettings:
    """What one render uses, read from a scene's properties. threads: 0 for every core."""

    mode: str
    samples: int
    ao_distance: float
    use_material_colors: bool
    threads: int


class PERFECT_BVH_PG_settings(bpy.types.PropertyGroup):
    """Saved in the .blend file, animatable like any other setting."""

    mode: bpy.props.EnumProperty(
        name="Mode", description="What the image shows", items=MODE_ITEMS, default=DEFAULT_MODE.upper()
    )
    samples: bpy.props.IntProperty(
        name="Samples", description="Camera rays for each pixel of a render", default=16, min=1, soft_max=256, max=65536
    )
    ao_distance: bpy.props.FloatProperty(
        name="Occlusion Distance",
        description="How far away a surface still darkens another in clay; 0 is as far as the scene reaches",
        default=0.0,
        min=0.0,
        soft_max=100.0,
        subtype="DISTANCE",
    )
    use_material_colors: bpy.props.BoolProperty(
        name="Material Colors", description="Clay in the viewport colours of the materials, not in grey", default=True
    )


def read_settings(scene: bpy.types.Scene) -> RenderSettings:
    """The settings of `scene`; threads follow Blender's own setting."""
    settings = scene.perfect_bvh
    return RenderSettings(
        mode=settings.mode.lower(),
        samples=settings.samples,
        ao_distance=settings.ao_distance,
        use_material_colors=settings.use_material_colors,
        threads=scene.render.threads if scene.render.threads_mode == "FIXED" else 0,
    )


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_PG_settings)
    bpy.types.Scene.perfect_bvh = bpy.props.PointerProperty(name="Perfect BVH", type=PERFECT_BVH_PG_settings)


def unregister() -> None:
    del bpy.types.Scene.perfect_bvh
    bpy.utils.unregister_class(PERFECT_BVH_PG_settings)
