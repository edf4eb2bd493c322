"""Which settings the add-on reads, and which of them some panel shows with its engine; runs in any Blender.

python shown_settings.py, or blender --background --python shown_settings.py; in the environment EXTENSION and
BLENDER_USER_RESOURCES as for render_scene.py. Prints each fault, and fails if there is any.

There is no list of settings to maintain: every name in the code that reads Blender counts if it is a property of
Blender's.
"""

from __future__ import annotations

import ast
import os
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from drawn_panels import contexts, drawn_by, is_ours, panels_in
from unshown_settings import EXCUSED, MAY_STAND_TWICE

READING = (
    "extract",
    "settings",
    "view3d/rendered/awaited_view.py",
    "view3d/rendered/region_camera.py",
    "view3d/rendered/view_lighting.py",
)


# Settings that are read
# --------------------------------------------------------------------------------------------------------


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
    """The properties that a user can change, of all types that panels show, as (type, name)."""
    scene, layer, area = bpy.context.scene, bpy.context.view_layer, bpy.data.lights.new("Read", "AREA")
    camera = bpy.data.cameras.new("Read")
    owners = [bpy.types.Object, bpy.types.Material, bpy.types.World, bpy.types.Camera, bpy.types.CameraDOFSettings]
    owners += [bpy.types.RenderSettings, bpy.types.ViewLayer, bpy.types.Scene, bpy.types.View3DShading]
    owners += [bpy.types.PointLight, bpy.types.SunLight, bpy.types.SpotLight, bpy.types.AreaLight]
    owners += [type(scene.perfect_bvh), bpy.types.ColorManagedViewSettings]
    owners += [type(scene.cycles_curves)] if hasattr(scene, "cycles_curves") else []
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
    """A sentence for each setting that no panel shows, and for each panel or setting that is twice in a tab."""
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
