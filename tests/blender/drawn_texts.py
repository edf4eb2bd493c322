"""The texts of panels, without a window: panels draw into a layout that checks and keeps their texts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
from perfect_bvh_addon import panels
from perfect_bvh_addon.settings.shading_settings import overlay_settings
from perfect_bvh_addon.statistics import update_list


class RecordingLayout:
    """Accepts the arguments of `UILayout`, rejects names unknown to the add-on and Blender, and keeps the texts."""

    def __init__(self, texts: list[str] | None = None) -> None:
        self.texts: list[str] = [] if texts is None else texts

    def _inner(self, **_: Any) -> RecordingLayout:
        return RecordingLayout(self.texts)

    box = column = row = split = grid_flow = column_flow = _inner

    def label(self, text: str = "", icon: str = "NONE") -> None:
        self.texts.append(text)

    def progress(self, text: str, factor: float) -> None:
        assert 0.0 <= factor <= 1.0
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
        """Draw each row that passes the list's filter."""
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
        """Separators have no text."""

    def template_icon_view(self, owner: Any, name: str, **_: Any) -> None:
        self.prop(owner, name)

    template_curve_mapping = template_icon_view

    def template_preview(self, block: Any) -> None:
        self.texts.append(f"preview of {block.name}")

    def template_node_view(self, tree: Any, node: Any, socket: Any) -> None:
        assert node.name in tree.nodes and socket.name in node.inputs
        self.texts.append(f"{node.name}, {socket.name}")

    def operator_menu_enum(self, name: str, choice: str, **_: Any) -> None:
        self.operator(name)
        assert choice in getattr(bpy.types, "PERFECT_BVH_OT_" + name.partition(".")[2]).__annotations__


def render_a_cube() -> None:
    """Render a new scene that has one data-block of each kind that panels show."""
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


def viewport_overlay() -> Any:
    """Return the viewport's settings of the tree overlay."""
    return overlay_settings(shaded_space())


def shaded_space() -> Any:
    """Return a 3D viewport in Rendered shading."""
    areas = [area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    areas[0].spaces.active.shading.type = "RENDERED"
    return areas[0].spaces.active


def drawn(panel: type) -> list[str]:
    """Return the texts of a shown panel and of its header, with the names of settings and operators."""

    class Context:
        engine, scene, view_layer = "PERFECT_BVH", bpy.context.scene, bpy.context.view_layer
        window_manager = bpy.context.window_manager
        camera, object = bpy.context.scene.camera.data, bpy.data.objects.get("Cube")
        mode, window, selected_objects = bpy.context.mode, bpy.context.window, bpy.context.selected_objects
        light, world = bpy.data.lights.get("Tried"), bpy.data.worlds.get("Tried")
        material = bpy.data.materials.get("Tried")
        space_data, screen = shaded_space(), bpy.data.screens["Layout"]
        preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))  # 0 without a window
        region = SimpleNamespace(width=280)

    stand = SimpleNamespace(layout=RecordingLayout(), bl_label=panel.bl_label)
    assert panel.poll(Context)
    if panel is panels.reports.PERFECT_BVH_PT_updates:  # its rows are listed only after a first request
        panel.draw(SimpleNamespace(layout=RecordingLayout()), Context)
        update_list.fill()
    if "draw_header" in vars(panel):
        panel.draw_header(stand, Context)
    panel.draw(stand, Context)
    return stand.layout.texts
