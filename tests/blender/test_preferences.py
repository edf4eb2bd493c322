"""The add-on's preferences: the hardware that the engine runs on, or all reasons why it cannot run."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from blender.drawn_texts import RecordingLayout, drawn, render_a_cube  # noqa: E402
from perfect_bvh_addon.panels import common, render  # noqa: E402
from perfect_bvh_addon.settings import preferences  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import ENGINE_NAME  # noqa: E402


@pytest.fixture(autouse=True)
def rendered(registered: None) -> None:
    render_a_cube()


def test_a_missing_engine_is_explained_in_the_panel(monkeypatch) -> None:
    reason = "The native engine could not be loaded: undefined symbol"
    monkeypatch.setattr(render, "native_error", lambda: reason)
    monkeypatch.setattr(common, "native_error", lambda: reason)
    context = SimpleNamespace(engine=ENGINE_NAME, scene=bpy.context.scene)
    children = common.EnginePanel.__subclasses__()
    assert render.PERFECT_BVH_PT_film in children and not any(panel.poll(context) for panel in children)
    texts = drawn(render.PERFECT_BVH_PT_render)
    assert texts[0] == "The engine cannot run"
    assert " ".join(texts[1:]) == reason
    assert preferences.native_error() is None


@pytest.mark.parametrize(
    ("isas", "ending"),
    [(("scalar",), "threads"), (("scalar", "avx2"), ", AVX2"), (("scalar", "avx2", "avx512"), ", AVX-512")],
)
def test_the_preferences_say_what_the_engine_runs_on(monkeypatch, isas: tuple[str, ...], ending: str) -> None:
    monkeypatch.setattr(perfect_bvh, "available_isas", lambda: isas)
    texts = drawn_preferences()
    assert texts[0].startswith(f"Engine {perfect_bvh.__version__}, ") and texts[0].endswith(ending)
    slow = [text for text in texts if text.startswith("This processor has no AVX2")]
    assert bool(slow) == (isas == ("scalar",))
    assert texts[-2:] == ["threads", "cache_size"]


def test_the_preferences_say_all_of_why_the_engine_cannot_run(monkeypatch) -> None:
    reason = (
        "The native engine could not be loaded: this add-on is for Linux, but this system is Windows: install the other"
    )
    monkeypatch.setattr(preferences, "native_error", lambda: reason)
    texts = drawn_preferences()
    assert " ".join(texts) == reason and len(texts) == 2


def drawn_preferences() -> list[str]:
    layout = RecordingLayout()
    drawn_one = SimpleNamespace(layout=layout, bl_rna=preferences.PERFECT_BVH_AP_preferences.bl_rna)
    preferences.PERFECT_BVH_AP_preferences.draw(drawn_one, bpy.context)
    return layout.texts
