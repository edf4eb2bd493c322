"""The panels' rows: every panel can be drawn of a scene that was rendered, and says what was done."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from perfect_bvh_addon import panels  # noqa: E402
from perfect_bvh_addon.bench.results import Results, forget, remember  # noqa: E402
from perfect_bvh_addon.bench.table import Row  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.panels import common, render, reports  # noqa: E402
from perfect_bvh_addon.settings import preferences  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import ENGINE_NAME, read_settings  # noqa: E402
from perfect_bvh_addon.statistics import last_result, not_shown, update_list  # noqa: E402
from perfect_bvh_addon.statistics.updates import STATES  # noqa: E402
from perfect_bvh_addon.sync.not_shown import Kind, NotShown  # noqa: E402


class RecordingLayout:
    """Takes what `UILayout` takes, knows no names but those of the add-on and of Blender, and keeps the texts."""

    def __init__(self, texts: list[str] | None = None) -> None:
        self.texts: list[str] = [] if texts is None else texts

    def _inner(self, **_: Any) -> RecordingLayout:
        return RecordingLayout(self.texts)

    box = column = row = split = grid_flow = column_flow = _inner

    def label(self, text: str = "", icon: str = "NONE") -> None:
        self.texts.append(text)

    def prop(self, owner: Any, name: str, **_: Any) -> None:
        assert name in owner.bl_rna.properties, name
        self.texts.append(name)

    def operator(self, name: str, text: str = "", **_: Any) -> SimpleNamespace:
        module, _, function = name.partition(".")
        assert function in dir(getattr(bpy.ops, module)), name
        self.texts.append(text or name)
        return SimpleNamespace()

    def template_list(self, kind: str, _: str, data: Any, name: str, active_data: Any, active: str, **__: Any) -> None:
        """Draws each row that the list's filter leaves."""
        assert active in active_data.bl_rna.properties
        (made,) = (one for one in panels.LISTS if one.__name__ == kind)
        stand = SimpleNamespace(filter_name="", bitflag_filter_item=1)
        region, system = SimpleNamespace(width=280), SimpleNamespace(ui_scale=1.0)  # 0 without a window
        preferences = SimpleNamespace(system=system)
        context = SimpleNamespace(scene=bpy.context.scene, region=region, preferences=preferences)
        flags, order = made.filter_items(stand, context, data, name)
        assert order == []
        for row, flag in zip(getattr(data, name), flags, strict=True):
            if flag:
                made.draw_item(stand, context, self, data, row, 0, active_data, active)

    def separator(self, **_: Any) -> None:
        """Nothing to read."""

    def template_icon_view(self, owner: Any, name: str, **_: Any) -> None:
        self.prop(owner, name)

    def template_preview(self, block: Any) -> None:
        self.texts.append(f"preview of {block.name}")

    def template_node_view(self, tree: Any, node: Any, socket: Any) -> None:
        assert node.name in tree.nodes and socket.name in node.inputs
        self.texts.append(f"{node.name}, {socket.name}")

    def operator_menu_enum(self, name: str, choice: str, **_: Any) -> None:
        self.operator(f"{name}")
        assert choice in getattr(bpy.types, "PERFECT_BVH_OT_" + name.partition(".")[2]).__annotations__


@pytest.fixture(autouse=True)
def rendered(registered: None) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_cube_add()
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, 0.0, 8.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    bpy.data.worlds.new("Tried")
    bpy.data.materials.new("Tried")
    bpy.data.lights.new("Tried", "AREA")
    bpy.ops.render.render()


def shaded_space() -> Any:
    """A 3D viewport in Rendered shading."""
    areas = [area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    areas[0].spaces.active.shading.type = "RENDERED"
    return areas[0].spaces.active


def drawn(panel: type) -> list[str]:
    class Context:
        engine, scene, view_layer = "PERFECT_BVH", bpy.context.scene, bpy.context.view_layer
        window_manager = bpy.context.window_manager
        camera, object = bpy.context.scene.camera.data, bpy.data.objects.get("Cube")
        light, world = bpy.data.lights.get("Tried"), bpy.data.worlds.get("Tried")
        material = bpy.data.materials.get("Tried")
        space_data, screen = shaded_space(), bpy.data.screens["Layout"]
        preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))  # 0 without a window
        region = SimpleNamespace(width=280)

    stand = SimpleNamespace(layout=RecordingLayout())
    assert panel.poll(Context)
    if panel is panels.updates.PERFECT_BVH_PT_updates:  # what it shows is listed once it was asked for
        panel.draw(SimpleNamespace(layout=RecordingLayout()), Context)
        update_list.fill()
    if "draw_header" in vars(panel):
        panel.draw_header(stand, Context)
    panel.draw(stand, Context)
    return stand.layout.texts


@pytest.mark.parametrize("panel", panels.CLASSES, ids=lambda panel: panel.__name__)
def test_a_panel_can_be_drawn_after_a_render(panel: type) -> None:
    bpy.context.scene.camera.data.type = "PANO"
    holds_others = any(getattr(other, "bl_parent_id", "") == panel.__name__ for other in panels.CLASSES)
    assert drawn(panel) or holds_others


def test_light_paths_say_where_they_can_be_set(monkeypatch) -> None:
    """Cycles keeps them, and may be disabled."""
    paths, *others = panels.light_paths.CLASSES
    assert drawn(paths) == [] and all(drawn(panel) for panel in others)
    monkeypatch.setattr(panels.light_paths, "light_path_settings", lambda scene: None)
    assert " ".join(drawn(paths)) == panels.light_paths.CYCLES_IS_OFF
    context = SimpleNamespace(engine=ENGINE_NAME, scene=bpy.context.scene)
    assert not any(panel.poll(context) for panel in others)


def test_a_studio_light_can_be_chosen_where_the_world_is_not_shown() -> None:
    panel = panels.shading.PERFECT_BVH_PT_shading_lighting
    assert drawn(panel) == ["use_scene_lights_render", "use_scene_world_render"]
    shaded_space().shading.use_scene_world_render = False
    names = ["studio_light", "studiolight_rotate_z", "studiolight_intensity", "studiolight_background_alpha"]
    assert set(names) < set(drawn(panel))
    space = shaded_space()
    space.shading.type = "SOLID"
    assert not panel.poll(SimpleNamespace(engine=ENGINE_NAME, space_data=space))


def test_noise_thresholds_have_a_switch_a_value_and_a_least() -> None:
    for kind, panel in (
        ("", panels.sampling.PERFECT_BVH_PT_sampling_render),
        ("viewport_", panels.sampling.PERFECT_BVH_PT_sampling_viewport),
    ):
        samples = ["use_render_samples"] if kind else ["samples"]
        names = [f"use_{kind}noise_threshold", f"{kind}noise_threshold", *samples, f"{kind}min_samples"]
        assert drawn(panel)[:4] == names
        setattr(bpy.context.scene.perfect_bvh, names[0], False)
        assert drawn(panel)[:3] == names[:3] and names[3] not in drawn(panel)


def test_viewports_take_the_samples_of_renders_or_their_own() -> None:
    settings, panel = bpy.context.scene.perfect_bvh, panels.sampling.PERFECT_BVH_PT_sampling_viewport
    settings.samples = 48
    assert settings.use_render_samples and "viewport_samples" not in drawn(panel)
    settings.use_render_samples = False
    assert settings.viewport_samples == 48 and drawn(panel)[2:4] == ["use_render_samples", "viewport_samples"]
    settings.viewport_samples = 5
    settings.use_render_samples = False
    assert settings.viewport_samples == 5
    settings.use_render_samples = True
    assert settings.viewport_samples == 0 and read_settings(bpy.context.scene, is_viewport=True).samples == 48


def test_a_panorama_can_be_set_up_without_cycles() -> None:
    camera = bpy.context.scene.camera.data
    camera.type = "PANO"
    settings = panorama_settings(camera)
    settings.panorama_type = "FISHEYE_EQUISOLID"
    assert panels.camera.ONLY_EQUIRECTANGULAR in " ".join(drawn(panels.camera.PERFECT_BVH_PT_panorama))
    settings.panorama_type = "EQUIRECTANGULAR"
    names = {"panorama_type", "latitude_min", "latitude_max", "longitude_min", "longitude_max"}
    assert names == set(drawn(panels.camera.PERFECT_BVH_PT_panorama))
    camera.type = "ORTHO"
    with pytest.raises(AssertionError):
        drawn(panels.camera.PERFECT_BVH_PT_panorama)


def test_the_table_of_a_bench_shows_with_its_advice_on_its_scene_only(tmp_path: Path) -> None:
    assert "spatial" not in drawn(panels.bench.PERFECT_BVH_PT_bench)
    rows = (
        Row("Builder", "spatial", "12.3 ms", "4.56 M rays/s"),
        Row("Layout", "compact", "1.00 MiB", "1.00 M rays/s"),
    )
    results = Results(
        tmp_path / "bench.json", rows, {"builders": "Leave it.", "total_time": "Leave it."}, {}, None, False
    )
    remember(bpy.context.scene.session_uid, results)
    texts = drawn(panels.bench.PERFECT_BVH_PT_bench)
    start = texts.index("Builder")
    assert texts[start : start + 6] == ["Builder", "Build", "Rays", "spatial", "12.3 ms", "4.56 M rays/s"]
    assert texts[start + 6 :] == ["Layout", "Memory", "Rays", "compact", "1.00 MiB", "1.00 M rays/s", "Leave it."]
    forget()
    assert "spatial" not in drawn(panels.bench.PERFECT_BVH_PT_bench)


def test_an_audit_is_for_scripts_and_shows_in_no_panel() -> None:
    scene = bpy.context.scene
    bpy.ops.render.render()
    assert last_result.last_statistics(scene).audit is None
    rows = drawn(reports.PERFECT_BVH_PT_statistics)
    scene.perfect_bvh.audit, scene.perfect_bvh.samples = 0.5, 4
    bpy.ops.render.render()
    audit = last_result.last_statistics(scene).audit
    assert 0.4 * 4 * 32 * 18 < audit.checked_count < 0.6 * 4 * 32 * 18
    assert len(audit.wrong_rows) == 0
    assert not {"Audit", "Wrong"} & {*rows, *drawn(reports.PERFECT_BVH_PT_statistics)}
    scene.camera.data.type = "PANO"  # so that each panel is shown
    assert not any("audit" in name.lower() for panel in panels.CLASSES for name in drawn(panel))


def test_all_that_could_not_be_read_stays_in_the_list_and_the_statistics_tell_of_it() -> None:
    for number in range(5):
        mesh = bpy.data.meshes.new(f"broken {number}")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (float("nan"), 1, 0)], [], [(0, 1, 2)])
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Broken {number}", mesh))
    assert "simplified" not in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))
    bpy.ops.render.render()
    not_shown.list_rows()
    (panel,) = panels.not_shown.CLASSES
    texts = drawn(panel)
    assert [text for text in texts if text.startswith("Broken ") and "not finite" in text][:5] == [
        f"Broken {number}: left out 1 triangle with a vertex that is not finite or beyond 1e18" for number in range(5)
    ]
    assert "5 objects simplified: see Not Shown" in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))


def broken_scene() -> Any:
    """Of each kind something; the material that is not shown."""
    scene = bpy.context.scene
    material = bpy.data.materials.new("Wall")
    if not material.node_tree:
        material.use_nodes = True
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.data.objects["Cube"].data.materials.append(material)
    bpy.ops.object.volume_add()
    bpy.context.object.name = "Smoke"
    bpy.ops.object.light_add()
    bpy.context.object.visible_glossy = False
    scene.render.use_motion_blur = True
    bpy.ops.render.render()
    return material


def test_what_is_not_shown_is_listed_and_can_be_selected() -> None:
    material = broken_scene()
    (panel,) = panels.not_shown.CLASSES
    line = "1 material simplified, 1 object not shown, 1 light simplified, 1 setting ignored"
    assert not_shown.line_of(bpy.context.scene) == line
    assert not_shown.list_rows()
    assert not not_shown.list_rows(), "nothing is new"
    listed = bpy.context.window_manager.perfect_bvh_not_shown
    rows = {row.kind: row for row in listed.rows}
    assert set(rows) == {"material", "object", "light", "setting"}
    texts = drawn(panel)
    assert " ".join(texts).startswith(line)
    assert "Wall: Noise Texture is not shown; its flat colour is" in texts
    assert "Motion Blur: it is not shown; one moment is" in texts
    for kind, name in (("material", "Cube"), ("object", "Smoke"), ("light", "Point"), ("setting", None)):
        listed.active = [row.kind for row in listed.rows].index(kind)
        assert (drawn(panel)[-1] == "perfect_bvh.select_not_shown") == (name is not None)
        if name is not None:
            uid = listed.rows[listed.active].session_uid
            assert bpy.ops.perfect_bvh.select_not_shown(kind=kind, session_uid=uid) == {"FINISHED"}
            assert [obj.name for obj in bpy.context.selected_objects] == [name]
    bpy.data.objects["Cube"].data.materials.clear()
    assert bpy.ops.perfect_bvh.select_not_shown(kind="material", session_uid=material.session_uid) == {"CANCELLED"}
    bpy.ops.render.render()
    assert not_shown.list_rows()


@pytest.mark.parametrize("kind", ["shape", "light"])
def test_objects_whose_shape_or_light_is_simplified_can_be_selected(kind: Kind) -> None:
    cube = bpy.data.objects["Cube"]
    row = NotShown(kind, cube.name, cube.session_uid, "something is not shown; something else is")
    not_shown.tell(bpy.context.scene, (row,))
    assert not_shown.list_rows()
    (panel,) = panels.not_shown.CLASSES
    assert drawn(panel)[-1] == "perfect_bvh.select_not_shown"
    assert bpy.ops.perfect_bvh.select_not_shown(kind=kind, session_uid=cube.session_uid) == {"FINISHED"}
    assert [obj.name for obj in bpy.context.selected_objects] == ["Cube"]
    assert "Wall" not in " ".join(drawn(panel))


def test_a_scene_lists_what_is_not_shown_of_it_alone() -> None:
    broken_scene()
    not_shown.list_rows()
    other = bpy.data.scenes.new("Other")
    shown = SimpleNamespace(filter_name="", bitflag_filter_item=1)
    listed = bpy.context.window_manager.perfect_bvh_not_shown
    flags = {}
    for scene in (bpy.context.scene, other):
        made = panels.not_shown.PERFECT_BVH_UL_not_shown
        flags[scene.name], _ = made.filter_items(shown, SimpleNamespace(scene=scene), listed, "rows")
    assert flags == {"Scene": [1] * 4, "Other": [0] * 4}
    shown.filter_name = "NOISE"
    made = panels.not_shown.PERFECT_BVH_UL_not_shown
    assert sum(made.filter_items(shown, bpy.context, listed, "rows")[0]) == 1
    (panel,) = panels.not_shown.CLASSES
    assert not panel.poll(SimpleNamespace(engine=ENGINE_NAME, scene=other))


def test_a_file_that_is_opened_lists_nothing_of_the_last_one(tmp_path: Path) -> None:
    broken_scene()
    not_shown.list_rows()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert not_shown.told(bpy.context.scene) == ()
    assert not_shown.list_rows()
    assert len(bpy.context.window_manager.perfect_bvh_not_shown.rows) == 0


def test_every_kind_has_an_icon_that_blender_has() -> None:
    icons = bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys()
    assert set(panels.not_shown.ICONS.values()) <= set(icons)
    assert set(get_args(Kind)) == set(panels.not_shown.ICONS)
    assert set(panels.updates.ICONS.values()) <= set(icons)
    assert set(STATES) == set(panels.updates.ICONS)


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
    reason = "The native engine could not be loaded: this add-on is for Linux, and this is Windows: install the other"
    monkeypatch.setattr(preferences, "native_error", lambda: reason)
    texts = drawn_preferences()
    assert " ".join(texts) == reason and len(texts) == 2


def drawn_preferences() -> list[str]:
    layout = RecordingLayout()
    drawn_one = SimpleNamespace(layout=layout, bl_rna=preferences.PERFECT_BVH_AP_preferences.bl_rna)
    preferences.PERFECT_BVH_AP_preferences.draw(drawn_one, bpy.context)
    return layout.texts


@pytest.mark.parametrize(("width", "scale", "count"), [(1000, 1.0, 1), (280, 1.0, 2), (280, 2.0, 3), (20, 1.0, 3)])
def test_long_texts_are_broken_where_the_panel_ends(width: int, scale: float, count: int) -> None:
    text = "The native engine could not be loaded: a file"
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=scale))
    lines = common.wrapped(SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences), text)
    assert len(lines) == count
    assert " ".join(lines) == text


def test_the_scan_panel_shows_what_belongs_to_the_pattern() -> None:
    settings = bpy.context.scene.perfect_bvh.scan
    (panel,) = panels.scan.CLASSES
    assert {"width", "height"} <= set(drawn(panel)) and "rate" not in drawn(panel)
    settings.pattern, settings.use_frame_range = "LIDAR", True
    assert {"elevations", "columns", "rate", "steps_per_frame"} <= set(drawn(panel)) and "width" not in drawn(panel)


def test_panels_for_materials_lights_and_the_world_stay_usable() -> None:
    names = {
        panel.__name__
        for panel in panels.borrowed.shared_panels()
        if "PERFECT_BVH" in panel.COMPAT_ENGINES and panel.__name__ in dir(bpy.types)
    }
    assert names >= {
        "EEVEE_MATERIAL_PT_context_material",
        "DATA_PT_EEVEE_light",
        "DATA_PT_lens",
        "DATA_PT_preview",
        "MATERIAL_PT_preview",
        "RENDER_PT_color_management",
        "WORLD_PT_context_world",
    }
    assert not names & {"RENDER_PT_simplify", "DATA_PT_light", "NODE_DATA_PT_light"}
