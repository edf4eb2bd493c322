"""Finds the settings that each tab's panels draw, without a window: panels draw into a layout that records them."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import bpy

ENGINE = "PERFECT_BVH"
POPOVERS_AND_SIDEBAR = ("shading", "overlay", "sidebar")


class Recorder:
    """Accepts any call of `UILayout`, and records the drawn settings as (type, name)."""

    def __init__(self) -> None:
        self.drawn: list[tuple[str, str]] = []

    def prop(self, owner: Any, name: str, *_: Any, **__: Any) -> None:
        self.drawn.append((owner.bl_rna.identifier, name))

    prop_search = prop_menu_enum = prop_enum = prop_with_popover = prop_tabs_enum = template_icon_view = prop

    def template_node_view(self, tree: Any, node: Any, socket: Any) -> None:
        self.drawn.append((node.bl_rna.identifier, socket.name))

    def operator(self, *_: Any, **__: Any) -> SimpleNamespace:
        return SimpleNamespace()

    def panel(self, *_: Any, **__: Any) -> tuple[Recorder, Recorder]:
        return self, self

    panel_prop = panel

    def __getattr__(self, name: str) -> Callable[..., Recorder]:
        if name.startswith("__"):
            raise AttributeError(name)
        return self.prop if name.startswith("template_ID") else lambda *_, **__: self


class Stand:
    """Replaces a panel instance: it has the attributes of the panel's class, and a layout."""

    def __init__(self, panel: type, layout: Recorder) -> None:
        self.layout = layout
        self.is_popover = False
        self._panel = panel

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._panel, name)
        is_own = isinstance(found, types.FunctionType) and not isinstance(
            next(vars(base)[name] for base in self._panel.__mro__ if name in vars(base)), staticmethod
        )
        return types.MethodType(found, self) if is_own else found


class Context:
    """A tab of the Properties editor, or a 3D viewport. Blender's own context, except for the given members."""

    def __init__(self, **given: Any) -> None:
        self.__dict__.update(given)
        self.engine = ENGINE

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context, name, None)


# Contexts --------------------------------------------------------------------------------------------


def contexts() -> Iterator[tuple[str, Context]]:
    """Every tab with everything that may be shown in it."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.render.engine = ENGINE
    world = scene.world or bpy.data.worlds.new("World")
    scene.world = world
    base: dict[str, Any] = {"scene": scene, "view_layer": layer, "world": world}
    base["region"] = SimpleNamespace(width=300, height=600)
    # The scale is 0 without a window.
    base["preferences"] = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0), view=bpy.context.preferences.view)
    for name in ("output", "view_layer", "world", "scene"):
        yield name, Context(**base, space_data=SimpleNamespace(type="PROPERTIES"))
    for mode, samples in (("CLAY", 0), ("PREVIEW", 4)):
        scene.perfect_bvh.mode, scene.perfect_bvh.viewport_samples = mode, samples
        yield "render", Context(**base, space_data=SimpleNamespace(type="PROPERTIES"))
    for obj, material in _objects():
        own = base | {"object": obj, "active_object": obj, "material": material, "space_data": _properties(obj)}
        own["material_slot"] = obj.material_slots[0] if obj.material_slots else None
        yield "object", Context(**own)
        if material is not None:
            yield "material", Context(**own)
            continue
        kind = obj.type.lower()
        for change in _kinds_of(obj.data):
            change()
            yield "data", Context(**own | {kind: obj.data})
    space = next(area.spaces[0] for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D")
    space.shading.type = "RENDERED"
    for uses_world in (True, False):
        space.shading.use_scene_world_render = uses_world
        for place in POPOVERS_AND_SIDEBAR:
            yield place, Context(**base, space_data=space)


def _properties(obj: Any) -> SimpleNamespace:
    return SimpleNamespace(type="PROPERTIES", pin_id=None, use_pin_id=False, context="OBJECT")


def _objects() -> Iterator[tuple[Any, Any]]:
    mesh, material = bpy.data.meshes.new("Shown"), bpy.data.materials.new("Shown")
    mesh.materials.append(material)
    for data, shown in (
        (mesh, material),
        (bpy.data.cameras.new("Shown"), None),
        *((bpy.data.lights.new(kind, kind), None) for kind in ("POINT", "SUN", "SPOT", "AREA")),
    ):
        obj = bpy.data.objects.new("Shown", data)
        obj.instance_type = "VERTS" if shown else "NONE"
        bpy.context.scene.collection.objects.link(obj)
        yield obj, shown


def _kinds_of(data: Any) -> Iterator[Callable[[], None]]:
    """Functions that switch a data-block to each kind that has other settings."""
    if isinstance(data, bpy.types.Camera):
        for kind, unit, fit in (
            ("PERSP", "FOV", "VERTICAL"),
            ("PERSP", "MILLIMETERS", "AUTO"),
            ("ORTHO", "FOV", "AUTO"),
        ):
            yield partial(_set_all, data, type=kind, lens_unit=unit, sensor_fit=fit)
        owner = data if hasattr(data, "panorama_type") else data.cycles
        owner.panorama_type = "EQUIRECTANGULAR"
        yield partial(_set_all, data, type="PANO")
    elif isinstance(data, bpy.types.AreaLight):
        for shape in ("SQUARE", "RECTANGLE"):
            yield partial(_set_all, data, shape=shape)
    else:
        yield partial(_set_all, data)


def _set_all(owner: Any, **values: Any) -> None:
    for name, value in values.items():
        setattr(owner, name, value)


# Shown panels -------------------------------------------------------------------------------------------------------


def _all_panels(base: type = bpy.types.Panel) -> Iterator[type]:
    for panel in base.__subclasses__():
        if getattr(panel, "bl_space_type", "") in {"PROPERTIES", "VIEW_3D"} and panel.is_registered:
            yield panel
        yield from _all_panels(panel)


def _is_in(panel: type, tab: str) -> bool:
    """Whether a panel is in the tab; for the sidebar, in the add-on's own tab."""
    if tab == "sidebar":
        return bool(panel.bl_space_type == "VIEW_3D" and panel.bl_region_type == "UI" and is_ours(panel))
    if tab in POPOVERS_AND_SIDEBAR:
        return panel.bl_space_type == "VIEW_3D" and getattr(panel, "bl_parent_id", "").startswith(f"VIEW3D_PT_{tab}")
    return panel.bl_space_type == "PROPERTIES" and getattr(panel, "bl_context", "") == tab


def _is_shown(panel: type, context: Context) -> bool:
    poll = getattr(panel, "poll", None)
    try:
        if poll is not None and not poll(context):
            return False
    except (AttributeError, TypeError):  # one of Blender's own reads a missing attribute
        if is_ours(panel):
            raise
        return False
    parent = getattr(bpy.types, getattr(panel, "bl_parent_id", ""), None)
    return parent is None or _is_shown(parent, context)


def panels_in(tab: str, context: Context) -> list[type]:
    return [panel for panel in dict.fromkeys(_all_panels()) if _is_in(panel, tab) and _is_shown(panel, context)]


def drawn_by(panel: type, context: Context) -> list[tuple[str, str]]:
    """The settings of a panel with its header. Of Blender's own, as far as it can be drawn without a window."""
    layout = Recorder()
    stand = Stand(panel, layout)
    for name in ("draw_header", "draw"):
        if hasattr(panel, name):
            try:
                getattr(panel, name)(stand, context)
            except Exception:
                if is_ours(panel):
                    raise
    return layout.drawn


def is_ours(panel: type) -> bool:
    return panel.__name__.startswith("PERFECT_BVH")
