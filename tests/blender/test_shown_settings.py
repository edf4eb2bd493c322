"""Every setting that is read can be seen and changed with this engine, and no setting is shown twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from extension import drawn_panels, shown_settings, unshown_settings  # noqa: E402
from perfect_bvh_addon import panels  # noqa: E402

PACKAGE = Path(perfect_bvh_addon.__file__).parent


@pytest.fixture(autouse=True)
def factory(registered: None) -> None:
    bpy.ops.wm.read_factory_settings()


def test_each_setting_that_is_read_is_shown_once() -> None:
    assert shown_settings.what_is_wrong(PACKAGE) == []


def test_the_list_follows_the_code() -> None:
    """The list has the settings that are read of each kind of data-block, and no setting that is never read."""
    read = shown_settings.settings_read(shown_settings.names_read(PACKAGE))
    assert read >= {
        ("Object", "visible_glossy"),
        ("Object", "is_shadow_catcher"),
        ("AreaLight", "spread"),
        ("PointLight", "use_shadow"),
        ("SpotLight", "spot_blend"),
        ("Material", "pass_index"),
        ("World", "color"),
        ("Camera", "clip_end"),
        ("CameraDOFSettings", "aperture_fstop"),
        ("RenderSettings", "film_transparent"),
        ("ViewLayer", "use_pass_normal"),
        ("View3DShading", "use_scene_world_render"),
        ("CyclesRenderSettings", "caustics_refractive"),
        ("PERFECT_BVH_PG_settings", "time_limit"),
    }
    assert not read & {("Object", "lock_location"), ("PointLight", "use_soft_falloff"), ("World", "probe_resolution")}
    assert len(read) > 150


def test_no_excuse_is_out_of_date() -> None:
    read = shown_settings.settings_read(shown_settings.names_read(PACKAGE))
    of_older_blenders = {("Scene", "grease_pencil"), ("CyclesRenderSettings", "feature_set"), ("ViewLayer", "samples")}
    assert set(unshown_settings.EXCUSED) - read <= of_older_blenders


@pytest.mark.parametrize("name", ["PERFECT_BVH_PT_ray_visibility", "PERFECT_BVH_PT_light_settings"])
def test_a_panel_that_is_gone_is_missed(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    panel = getattr(bpy.types, name)
    monkeypatch.setattr(panel, "poll", classmethod(lambda cls, context: False))
    wrong = shown_settings.what_is_wrong(PACKAGE)
    assert wrong and all(text.endswith("is read, but no panel shows it") for text in wrong)


def test_a_panel_that_stands_twice_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plain and the full panel of lights were once both shown."""
    plain: Any = bpy.types.DATA_PT_light
    plain.COMPAT_ENGINES.add(drawn_panels.ENGINE)
    try:
        assert "data: the panel Light stands twice" in shown_settings.what_is_wrong(PACKAGE)
    finally:
        plain.COMPAT_ENGINES.discard(drawn_panels.ENGINE)


def test_panels_leave_nothing_behind() -> None:
    """After the add-on is disabled, Blender's own panels are unchanged."""
    perfect_bvh_addon.unregister()
    found = [panel for panel in panels.objects.shared_panels() if drawn_panels.ENGINE in panel.COMPAT_ENGINES]
    names = [draw.__module__ for draw in bpy.types.OBJECT_PT_visibility.draw._draw_funcs]
    assert found == [] and not any("perfect_bvh" in name for name in names)
    perfect_bvh_addon.register()
