"""Settings that the add-on reads and no panel has to show, with the reason."""

from __future__ import annotations

BLENDERS_OWN = "Blender shows it elsewhere than in panels"
NAMED_AS_NOT_SHOWN = "another engine's, which is only told that it changes nothing"
NAMESAKE = "the code reads something else of this name"
EXCUSED = {
    ("Object", "instance_collection"): BLENDERS_OWN,
    ("Object", "matrix_world"): BLENDERS_OWN,
    ("CameraDOFSettings", "focus_subtarget"): "Blender shows it where an armature is in focus",
    ("RenderSettings", "border_max_x"): BLENDERS_OWN,
    ("RenderSettings", "border_max_y"): BLENDERS_OWN,
    ("RenderSettings", "border_min_x"): BLENDERS_OWN,
    ("RenderSettings", "border_min_y"): BLENDERS_OWN,
    ("Scene", "frame_current"): BLENDERS_OWN,
    ("Scene", "frame_subframe"): BLENDERS_OWN,
    ("View3DShading", "type"): BLENDERS_OWN,
    ("PERFECT_BVH_PG_settings", "audit"): "for scripts and the command line",
    ("PERFECT_BVH_PG_settings", "viewport_min_samples"): "for scripts",
    ("RenderSettings", "hair_type"): "shown where Cycles, whose setting comes first, is off",
    ("ViewLayer", "use_pass_combined"): "it is always written",
    ("Material", "use_nodes"): "always on from Blender 5.0 on",
    ("World", "use_nodes"): "always on from Blender 5.0 on",
    **dict.fromkeys(
        (
            ("CyclesLightSettings", "is_portal"),
            ("CyclesRenderSettings", "feature_set"),
            ("CyclesRenderSettings", "film_exposure"),
            ("CyclesRenderSettings", "film_transparent_glass"),
            ("CyclesRenderSettings", "use_camera_cull"),
            ("CyclesRenderSettings", "use_distance_cull"),
            ("CyclesRenderSettings", "use_fast_gi"),
            ("RenderSettings", "use_freestyle"),
            ("ViewLayer", "use_freestyle"),
            ("ViewLayer", "use_pass_cryptomatte_accurate"),
            ("ViewLayer", "use_pass_cryptomatte_asset"),
            ("ViewLayer", "use_sky"),
            ("ViewLayer", "use_solid"),
            ("ViewLayer", "world_override"),
        ),
        NAMED_AS_NOT_SHOWN,
    ),
    **dict.fromkeys(
        (
            ("AreaLight", "shadow_soft_size"),
            ("SunLight", "shadow_soft_size"),
            ("CyclesLightSettings", "max_bounces"),
            ("CyclesRenderLayerSettings", "use_denoising"),
            ("CyclesRenderSettings", "samples"),
            ("CyclesRenderSettings", "seed"),
            ("CyclesRenderSettings", "time_limit"),
            ("CyclesRenderSettings", "use_denoising"),
            ("Scene", "grease_pencil"),
            ("Scene", "use_nodes"),
            ("View3DShading", "light"),
            ("View3DShading", "use_dof"),
            ("ViewLayer", "samples"),
        ),
        NAMESAKE,
    ),
}
# As with Blender's own engines: without nodes the viewport's color is the surface's.
MAY_STAND_TWICE = {("Material", "diffuse_color")}
