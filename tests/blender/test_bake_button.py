"""The bake's button: its values are those of `bake_rays`, and are shown as colours with a legend and a chart."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.drawn_texts import RecordingLayout, drawn  # noqa: E402
from blender.long_builds import ESCAPE, TIMER, FakeOperator, FakeWindow, patiently  # noqa: E402
from perfect_bvh_addon import Place, bake_rays, panels, sun_table  # noqa: E402
from perfect_bvh_addon.operators import bake_button, piece_jobs  # noqa: E402
from perfect_bvh_addon.operators.bake_button import PERFECT_BVH_OT_bake_rays, table_of  # noqa: E402
from perfect_bvh_addon.view3d import baked_colors, baked_view  # noqa: E402

BERLIN = Place(52.52, 13.4, "Europe/Berlin")
NAME = "sun_hours"


@pytest.fixture
def yard(scene: Any, registered: None) -> Any:
    """A ground of 64 faces with a wall on its south side, selected; a sphere that only casts shadows."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(2.0, 2.0, 1.0))
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, -2.0, 1.0))
    bpy.context.object.scale = (8.0, 0.2, 2.0)
    bpy.ops.object.transform_apply()
    wall = bpy.context.object
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=8.0)
    ground = bpy.context.object
    ground.name = "Ground"
    wall.select_set(True)
    settings = bpy.context.scene.perfect_bvh.bake
    settings.latitude, settings.longitude, settings.zone = BERLIN.latitude, BERLIN.longitude, BERLIN.zone
    settings.year, settings.month, settings.day, settings.step = 2026, 3, 21, 30
    yield ground
    baked_view.last_sun.hide()
    bake_button.forget()


def bake(**values: Any) -> Any:
    settings = bpy.context.scene.perfect_bvh.bake
    for name, value in values.items():
        setattr(settings, name, value)
    return bpy.ops.perfect_bvh.bake_rays()


def attributes() -> set[str]:
    return {found.name for mesh in bpy.data.meshes for found in mesh.attributes}


def viewport(obj: Any, **shading: Any) -> Any:
    shown = SimpleNamespace(**({"type": "SOLID", "color_type": "VERTEX"} | shading))
    space = SimpleNamespace(shading=shown, overlay=SimpleNamespace(show_overlays=True))
    region = SimpleNamespace(as_pointer=lambda: 77, tag_redraw=lambda: None)
    view = SimpleNamespace(perspective_matrix=np.eye(4))
    context = {"scene": bpy.context.scene, "view_layer": bpy.context.view_layer, "object": obj}
    return SimpleNamespace(space_data=space, region=region, region_data=view, **context)


def panel_texts(context: Any) -> list[str]:
    context.region, context.preferences = (
        SimpleNamespace(width=280),
        SimpleNamespace(system=SimpleNamespace(ui_scale=1)),
    )
    context.mode, context.selected_objects = "OBJECT", bpy.context.selected_objects
    panel = panels.output.PERFECT_BVH_PT_bake_rays
    stand = SimpleNamespace(layout=RecordingLayout(), bl_label=panel.bl_label)
    panel.draw(stand, context)
    return stand.layout.texts


def test_values_are_those_of_the_function_and_colours_are_on_the_ramp(yard: Any) -> None:
    assert bake() == {"FINISHED"}
    expected = bake_rays(kind="SUN_HOURS", directions=sun_table(BERLIN, date(2026, 3, 21), step=30))["Ground"].values
    values = baked_colors.read_values(yard.data, NAME)
    np.testing.assert_allclose(values, expected, rtol=1e-6)
    assert values.min() < values.max() - 2.0  # the wall's shade
    colors = yard.data.color_attributes.active_color
    assert (colors.name, colors.domain, colors.data_type) == (NAME + baked_colors.SUFFIX, "CORNER", "BYTE_COLOR")
    found = np.empty(len(colors.data) * 4, np.float32)
    colors.data.foreach_get("color_srgb", found)
    meaning = baked_colors.meaning_of(yard.data)
    most = max(baked_colors.read_values(obj.data, NAME).max() for obj in bpy.context.selected_objects)
    assert (meaning.attribute, meaning.unit, meaning.least) == (NAME, "h", 0.0) and meaning.most == pytest.approx(most)
    wanted = baked_colors.ramp_colors(np.repeat(values, 4), 0.0, meaning.most)
    np.testing.assert_allclose(found.reshape(-1, 4), wanted, atol=0.5 / 255)
    assert "Sphere" not in {obj.name for obj in bpy.data.objects if obj.type == "MESH" and NAME in obj.data.attributes}
    assert "UNDO" in PERFECT_BVH_OT_bake_rays.bl_options


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("SKY_VIEW", {"cosine": False}),
        ("AMBIENT_OCCLUSION", {"distance": 3.0, "falloff": 2.0}),
        ("THICKNESS", {"angle": 0.1}),
        ("THICKNESS", {"method": "SPHERE"}),
    ],
)
def test_options_of_a_kind_are_used(kind: str, options: dict[str, Any], yard: Any) -> None:
    assert bake(kind=kind, rays=16, **options) == {"FINISHED"}
    found = [baked_colors.read_values(obj.data, kind.lower()) for obj in bpy.context.selected_objects]
    expected, plain = (
        [np.nan_to_num(one.values.astype(np.float32)) for one in bake_rays(kind=kind, rays=16, **how).objects]
        for how in (options, {"distance": 3.0} if kind == "AMBIENT_OCCLUSION" else {})
    )
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6)
    assert any(not np.array_equal(one, other) for one, other in zip(expected, plain, strict=True))


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        ({"kind": "SKY_VIEW"}, ["cosine", "rays"]),
        ({"kind": "AMBIENT_OCCLUSION"}, ["distance", "falloff", "rays"]),
        ({"kind": "THICKNESS", "method": "CONE"}, ["method", "angle", "rays"]),
        ({"kind": "THICKNESS", "method": "SPHERE"}, ["method"]),
        ({"kind": "EXPOSURE"}, ["viewers", "use_frames"]),
        ({"kind": "SKY_VIEW", "domain": "TEXEL"}, ["uv_map", "width", "height", "margin", "cosine", "rays"]),
    ],
)
def test_the_panel_has_the_options_of_the_kind(values: dict[str, Any], shown: list[str], yard: Any) -> None:
    bpy.context.scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    for name, value in values.items():
        setattr(bpy.context.scene.perfect_bvh.bake, name, value)
    settings = set(bpy.context.scene.perfect_bvh.bake.bl_rna.properties.keys())
    drawn_ones = [text for text in drawn(panels.output.PERFECT_BVH_PT_bake_rays) if text in settings]
    assert drawn_ones == ["kind", "domain", *shown, "table"]


def test_images_are_written_and_named(yard: Any, tmp_path: Path) -> None:
    for obj in bpy.context.selected_objects:
        obj.select_set(obj == yard)
    settings = bpy.context.scene.perfect_bvh.bake
    settings.domain, settings.width, settings.height, settings.margin = "TEXEL", 16, 8, 0
    settings.table = str(tmp_path / "hours.csv")
    operator = FakeOperator(PERFECT_BVH_OT_bake_rays)
    assert operator.execute(FakeWindow()) == {"FINISHED"}
    image = bpy.data.images[f"Ground {NAME}"]
    assert tuple(image.size) == (16, 8) and NAME not in yard.data.attributes
    ((_, told),) = operator.reports
    assert told.startswith("Sun Hours: 128 values from ") and f"in the image 'Ground {NAME}', also in " in told
    settings.uv_map = "Other"
    with pytest.raises(RuntimeError, match="has no UV map 'Other'"):
        bpy.ops.perfect_bvh.bake_rays()


def test_nothing_is_written_if_values_have_no_place(yard: Any, tmp_path: Path) -> None:
    path = tmp_path / "hours.csv"
    yard.data.attributes.new(NAME, "INT", "FACE")
    with pytest.raises(RuntimeError, match=f"'Ground' has an attribute '{NAME}', a INT"):
        bake(table=str(path))
    yard.data.attributes.remove(yard.data.attributes[NAME])
    yard.vertex_groups.new(name=NAME + baked_colors.SUFFIX)
    with pytest.raises(RuntimeError, match=r"'Ground' has a vertex group 'sun_hours \(color\)': rename it"):
        bake(table=str(path))
    assert not path.exists() and NAME not in attributes()


def test_the_widest_cone_is_one(yard: Any) -> None:
    assert bake(kind="THICKNESS", rays=4, angle=4.0) == {"FINISHED"}


def test_another_file_drops_the_last_bake(yard: Any) -> None:
    assert bake() == {"FINISHED"}
    assert bake_button.last_bake.found["Ground"].values.shape == (64,)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bake_button.last_bake.found is None


@pytest.mark.parametrize("domain", ["FACE", "CORNER", "POINT"])
@pytest.mark.parametrize("kind", ["SKY_VIEW", "AMBIENT_OCCLUSION", "THICKNESS", "EXPOSURE"])
def test_each_kind_and_domain_is_shown(kind: str, domain: str, yard: Any) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, 0.0, 20.0)
    bpy.context.collection.objects.link(camera)
    assert bake(kind=kind, domain=domain, rays=16, viewers=camera) == {"FINISHED"}
    meaning = baked_colors.meaning_of(yard.data)
    assert yard.data.attributes[meaning.attribute].domain == domain
    assert baked_colors.value_at(yard.data, meaning.attribute, 0) <= meaning.most + 1e-6


def test_a_second_bake_replaces_the_first_one(yard: Any) -> None:
    assert bake() == {"FINISHED"}
    first = baked_colors.read_values(yard.data, NAME).sum()
    before = attributes()
    assert bake(month=6) == {"FINISHED"}
    assert attributes() == before and baked_colors.read_values(yard.data, NAME).sum() > 1.2 * first


def test_twins_in_one_place_keep_their_own_values(yard: Any) -> None:
    twin = yard.copy()
    twin.data = yard.data.copy()
    bpy.context.collection.objects.link(twin)
    twin.select_set(True)
    for _ in range(2):  # the second time the values of the first are kept
        assert bake() == {"FINISHED"}
        assert NAME in twin.data.attributes and NAME in yard.data.attributes


def test_the_chart_adds_up_to_the_value(yard: Any) -> None:
    def read(face: int) -> float:
        return float(baked_colors.read_values(yard.data, NAME)[face])

    assert bake(period="YEAR", step=0) == {"FINISHED"}
    values, sun = baked_colors.read_values(yard.data, NAME), baked_view.last_sun.found
    for face in (0, 30, 63):
        names, shares, sums = sun.chart(yard.data.session_uid, face, values[face])
        assert names == list(baked_view.MONTHS) and shares.shape == (12, 24)
        assert sums.sum() == pytest.approx(values[face], rel=1e-5)
        assert shares.max() <= 1.0 + 1e-9
    assert sun.chart(yard.data.session_uid, 64, values[0]) is None and sun.chart(-1, 0, values[0]) is None
    assert sun.chart(yard.data.session_uid, 0, values[0] + 1.0) is None  # the mesh was edited
    assert bake(period="RANGE", step=61, month_end=3) == {"FINISHED"}
    assert baked_view.last_sun.found.chart(yard.data.session_uid, 0, read(0)) is None  # too coarse
    assert bake(period="DAY", step=0) == {"FINISHED"}
    names, shares, sums = baked_view.last_sun.found.chart(yard.data.session_uid, 63, read(63))
    assert names == ["Mar"] and sums[0] == pytest.approx(read(63), rel=1e-5)
    assert shares[0, 12] == pytest.approx(1.0)  # noon
    assert bake(kind="SKY_VIEW", rays=4) == {"FINISHED"} and baked_view.last_sun.found is None


def test_a_legend_is_shown_where_the_colours_are(yard: Any) -> None:
    assert baked_view.sections(viewport(yard)) == []
    assert bake() == {"FINISHED"}
    (section,) = baked_view.sections(viewport(yard))
    assert section.scale.caption == "Sun Hours, h"
    most = baked_colors.meaning_of(yard.data).most
    assert section.scale.labels[0] == (0.0, "0") and section.scale.labels[-1] == (1.0, f"{most:.3g}")
    assert baked_view.sections(viewport(yard, type="RENDERED")) == []
    assert baked_view.sections(viewport(yard, color_type="MATERIAL")) == []
    told = panel_texts(viewport(yard)), panel_texts(viewport(yard, type="RENDERED"))
    assert [panels.output.POINT_AT_FACES in " ".join(texts) for texts in told] == [True, False]
    # After all were selected the active object may be a light, or none.
    assert baked_view.sections(viewport(bpy.data.objects["Sphere"])) == [section] == baked_view.sections(viewport(None))
    bpy.ops.object.select_all(action="DESELECT")
    assert baked_view.sections(viewport(bpy.data.objects["Sphere"])) == [] == baked_view.sections(viewport(None))
    yard.data[baked_colors.MEANING] = "[not"
    assert baked_view.sections(viewport(yard)) == []
    yard.data[baked_colors.MEANING] = json.dumps({NAME + baked_colors.SUFFIX: {"attribute": "gone"}})
    assert baked_view.sections(viewport(yard)) == []


def test_the_value_under_the_mouse_is_told(yard: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert bake() == {"FINISHED"}
    context = viewport(yard)
    ray = {"region_2d_to_origin_3d": (0.5, 3.5, 9.0), "region_2d_to_vector_3d": (0.0, 0.0, -1.0)}
    monkeypatch.setattr(baked_view, "view3d_utils", SimpleNamespace(**{n: lambda *_, v=v: v for n, v in ray.items()}))
    assert baked_view._pointing.wants_pointer(context)
    baked_view._pointing.on_pointer(context, (3, 4))
    place, lines = baked_view.tip(context)
    value = baked_colors.read_values(yard.data, NAME)[60]
    assert place == (3, 4) and lines == [f"Sun Hours: {value:.4g} h", "Face 60 of Ground"]
    ray["region_2d_to_vector_3d"] = (0.0, 0.0, 1.0)
    monkeypatch.setattr(baked_view, "view3d_utils", SimpleNamespace(**{n: lambda *_, v=v: v for n, v in ray.items()}))
    baked_view._pointing.on_pointer(context, (3, 4))
    assert baked_view.tip(context) is None
    assert baked_view._face == (yard.data.session_uid, 60, value)  # the chart stays
    baked_view._pointing.on_pointer_left()


def test_escape_writes_nothing(yard: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(piece_jobs, "STEP_SECONDS", 0.0)
    before = attributes()
    operator, window = FakeOperator(PERFECT_BVH_OT_bake_rays), FakeWindow()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    operator.modal(window, TIMER)
    assert window.status.startswith("Baking") and window.status.endswith("| Esc: Cancel")
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert operator.reports == [("INFO", "Bake canceled: nothing was written")]
    assert attributes() == before and window.timers == 0


def test_steps_of_a_timer_do_the_same_as_one_call(yard: Any) -> None:
    assert bake() == {"FINISHED"}
    expected = baked_colors.read_values(yard.data, NAME)
    yard.data.attributes.remove(yard.data.attributes[NAME])
    operator, window = FakeOperator(PERFECT_BVH_OT_bake_rays), FakeWindow()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    for _ in patiently("the bake does not end"):
        if operator.modal(window, TIMER) == {"FINISHED"}:
            break
    np.testing.assert_array_equal(baked_colors.read_values(yard.data, NAME), expected)
    ((kind, told),) = operator.reports
    assert kind == "INFO" and told.startswith("Sun Hours: 70 values from 0 to ") and "also in" not in told


def test_the_report_names_the_table(yard: Any, tmp_path: Path) -> None:
    bpy.context.scene.perfect_bvh.bake.table = str(tmp_path / "hours.csv")
    operator = FakeOperator(PERFECT_BVH_OT_bake_rays)
    assert operator.execute(FakeWindow()) == {"FINISHED"}
    ((_, told),) = operator.reports
    assert f" h, also in {tmp_path / 'hours.csv'}, " in told


def test_a_table_has_a_row_a_face(yard: Any, tmp_path: Path) -> None:
    assert bake(table=str(tmp_path / "hours.csv")) == {"FINISHED"}
    lines = (tmp_path / "hours.csv").read_text().splitlines()
    assert len(lines) == 1 + 64 + 6 and "area" in lines[0] and NAME in lines[0]


@pytest.fixture
def sun_position(yard: Any) -> Iterator[Any]:
    """Settings as the add-on Sun Position registers them."""
    number, angle = bpy.props.IntProperty(), bpy.props.FloatProperty()
    names = {"latitude": angle, "longitude": angle, "UTC_zone": angle, "north_offset": angle, "time": angle}
    names |= {"day": number, "month": number, "year": number, "use_daylight_savings": bpy.props.BoolProperty()}
    group = type("SunPosTrial", (bpy.types.PropertyGroup,), {"__annotations__": names})
    bpy.utils.register_class(group)
    bpy.types.Scene.sun_pos_properties = bpy.props.PointerProperty(type=group)
    yield bpy.context.scene.sun_pos_properties
    del bpy.types.Scene.sun_pos_properties
    bpy.utils.unregister_class(group)


def test_the_place_and_north_of_sun_position_are_read(sun_position: Any) -> None:
    for name, value in {"latitude": -33.9, "longitude": 151.2, "UTC_zone": 10.0, "north_offset": 0.5}.items():
        setattr(sun_position, name, value)
    sun_position.year, sun_position.month, sun_position.day = 2025, 12, 21
    sun_position.use_daylight_savings = True
    found = table_of(bpy.context.scene)
    expected = sun_table(Place(-33.9, 151.2, "+11", np.degrees(0.5)), date(2025, 12, 21), step=30)
    np.testing.assert_allclose(found.directions, expected.directions, atol=1e-6)
    np.testing.assert_array_equal(found.times, expected.times)
    bpy.context.scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    texts = drawn(panels.output.PERFECT_BVH_PT_bake_rays)
    assert "use_daylight_savings" in texts and "zone" not in texts


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"month": 2, "day": 30}, "There is no day 30 in month 2 of 2026"),
        ({"zone": "Mars/Base"}, "Zone must be a name such as"),
        ({"period": "RANGE", "month_end": 1}, "Dates must be in order"),
        ({"light": "WEATHER", "weather": " "}, "No weather file: choose one"),
        ({"light": "WEATHER", "weather": "/nowhere/town.epw"}, "No such file"),
        ({"table": "/nowhere/hours.csv"}, "Table: there is no folder /nowhere"),
    ],
)
def test_bad_settings_are_named_and_change_nothing(values: dict[str, Any], message: str, yard: Any) -> None:
    before = attributes()
    with pytest.raises(RuntimeError, match=message):
        bake(**values)
    assert attributes() == before


def test_polar_night_is_told_and_dark(yard: Any) -> None:
    operator, window = FakeOperator(PERFECT_BVH_OT_bake_rays), FakeWindow()
    settings = bpy.context.scene.perfect_bvh.bake
    settings.latitude, settings.month, settings.day = 80.0, 12, 21
    assert operator.execute(window) == {"FINISHED"}
    assert ("WARNING", "The sun does not rise at latitude 80, longitude 13.4 on 2026-12-21") in operator.reports
    assert not baked_colors.read_values(yard.data, NAME).any()
