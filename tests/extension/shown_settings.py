"""Which settings the add-on reads, and which of them some panel shows with its engine; runs in any Blender.

python shown_settings.py, or blender --background --python shown_settings.py; in the environment EXTENSION and
BLENDER_USER_RESOURCES as for render_scene.py. Prints what is wrong, and fails if anything is.

Nobody keeps the list of settings: it is every name in the code that reads Blender that is a property of Blender's, too.
"""

from __future__ import annotations

import ast
import os
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy

ENGINE = "PERFECT_BVH"
READING = (
    "extract",
    "settings",
    "view3d/awaited_view.py",
    "view3d/region_camera.py",
    "view3d/view_lighting.py",
)
# What needs no panel, and why.
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
    ("View3DShading", "type"): BLENDERS_OWN,
    ("PERFECT_BVH_PG_settings", "audit"): "for scripts and the command line",
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
            ("RenderSettings", "use_motion_blur"),
            ("ViewLayer", "use_freestyle"),
            ("ViewLayer", "use_motion_blur"),
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
            ("Scene", "frame_preview_end"),
            ("Scene", "frame_preview_start"),
            ("Scene", "grease_pencil"),
            ("Scene", "use_nodes"),
            ("Scene", "use_preview_range"),
            ("View3DShading", "light"),
            ("View3DShading", "use_dof"),
            ("ViewLayer", "samples"),
        ),
        NAMESAKE,
    ),
}
# As with Blender's own engines: without nodes the viewport's color is the surface's.
MAY_STAND_TWICE = {("Material", "diffuse_color")}


POPOVERS_AND_SIDEBAR = ("shading", "overlay", "sidebar")


class Recorder:
    """Takes whatever `UILayout` takes, and keeps what settings are drawn, as (type, name)."""

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
    """Takes the place of a panel that is drawn: what its class has, and a layout."""

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
    """A tab of the Properties editor, or a 3D viewport. Blender's own, but for what is given."""

    def __init__(self, **given: Any) -> None:
        self.__dict__.update(given)
        self.engine = ENGINE

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context, name, None)


# What there is to look at --------------------------------------------------------------------------------------------


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
    """What changes which settings a data-block has."""
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


# What is shown -------------------------------------------------------------------------------------------------------


def _all_panels(base: type = bpy.types.Panel) -> Iterator[type]:
    for panel in base.__subclasses__():
        if getattr(panel, "bl_space_type", "") in {"PROPERTIES", "VIEW_3D"} and panel.is_registered:
            yield panel
        yield from _all_panels(panel)


def _is_in(panel: type, tab: str) -> bool:
    """Of the sidebar it is the add-on's own tab."""
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
    except (AttributeError, TypeError):  # asks for what is not there
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


# What is read --------------------------------------------------------------------------------------------------------


def names_read(package: Path) -> set[str]:
    """Attributes and words in the code that reads Blender."""
    files = [file for place in READING for file in _files(package / place)]
    assert len(files) > 30, f"{package} has only {len(files)} files that read"
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
    names = {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)}
    return names | {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def _files(place: Path) -> list[Path]:
    return [place] if place.is_file() else sorted(place.rglob("*.py"))


def settings_read(names: set[str]) -> set[tuple[str, str]]:
    """Of all that panels are about: what a user could change, as (type, name)."""
    scene, layer, area = bpy.context.scene, bpy.context.view_layer, bpy.data.lights.new("Read", "AREA")
    camera = bpy.data.cameras.new("Read")
    owners = [bpy.types.Object, bpy.types.Material, bpy.types.World, bpy.types.Camera, bpy.types.CameraDOFSettings]
    owners += [bpy.types.RenderSettings, bpy.types.ViewLayer, bpy.types.Scene, bpy.types.View3DShading]
    owners += [bpy.types.PointLight, bpy.types.SunLight, bpy.types.SpotLight, bpy.types.AreaLight]
    owners += [type(scene.perfect_bvh), bpy.types.ColorManagedViewSettings]
    owners += [type(block.cycles) for block in (scene, layer, area, camera) if hasattr(block, "cycles")]
    found = {(owner.bl_rna.identifier, name) for owner in owners for name in names if _is_setting(owner, name)}
    bpy.data.lights.remove(area)
    bpy.data.cameras.remove(camera)
    return found


def _is_setting(owner: Any, name: str) -> bool:
    rna = owner.bl_rna.properties.get(name)
    return rna is not None and not rna.is_readonly and rna.type != "COLLECTION" and name != "name"


# The verdict ---------------------------------------------------------------------------------------------------------


def what_is_wrong(package: Path) -> list[str]:
    """A sentence for each setting that no panel shows, and for each panel or setting that stands twice in a tab."""
    shown: set[tuple[str, str]] = set()
    wrong: dict[str, None] = {}
    for tab, context in contexts():
        panels = panels_in(tab, context)
        labels = Counter((getattr(panel, "bl_parent_id", ""), panel.bl_label) for panel in panels if panel.bl_label)
        wrong |= {f"{tab}: the panel {label[1]} stands twice": None for label, count in labels.items() if count > 1}
        drawn = {panel: drawn_by(panel, context) for panel in panels}
        shown |= {setting for settings in drawn.values() for setting in settings}
        counts = Counter(setting for settings in drawn.values() for setting in dict.fromkeys(settings))
        ours = {setting for panel, settings in drawn.items() if is_ours(panel) for setting in settings}
        ours -= MAY_STAND_TWICE
        wrong |= {f"{tab}: {'.'.join(one)} stands twice": None for one in sorted(ours) if counts[one] > 1}
    missing = settings_read(names_read(package)) - shown - set(EXCUSED)
    return [*wrong, *(f"{'.'.join(one)} is read, but no panel shows it" for one in sorted(missing))]


def main() -> None:
    sys.path.insert(0, str(Path(__file__).parent))
    from render_scene import install, use_package

    extension = os.environ.get("EXTENSION", "")
    package = install(extension) if extension else use_package()
    wrong = what_is_wrong(Path(sys.modules[package].__file__).parent)
    sys.stdout.write("\n".join(wrong or [f"ALL SETTINGS SHOWN in {bpy.app.version_string}"]) + "\n")
    sys.stdout.flush()
    sys.modules[package].unregister()
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
