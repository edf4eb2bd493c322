"""Tables of reference for the site, read from registered classes: properties, operators, sensor files."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from typing import Any

Row = tuple[str, ...]

# Where scripts find the add-on's properties. Those on the window manager are lists for panels.
ROOTS = {
    "Scene": "scene",
    "View3DShading": "space.shading",
    "Screen": "screen",
}
PREFERENCES = "preferences.addons[...].preferences"
LARGEST = 2**31 - 128  # from here on a limit is that of the type
ATTRIBUTE = re.compile(r"^ {4}(\w+(?:, \w+)*): (.*(?:\n {8}.*)*)", re.MULTILINE)


def table(heads: Row, rows: list[Row]) -> str:
    """Return a table of Markdown; each text of `rows` is in one line."""
    lines = [heads, tuple("---" for _ in heads), *rows]
    cells = [[" ".join(cell.replace("|", r"\|").replace("<", "&lt;").split()) for cell in line] for line in lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)


def values_of(found: Any) -> tuple[str, str]:
    """Return a property's default, and its values: a range, the items of a list, or its kind."""
    if found.type == "ENUM":
        chosen = sorted(found.default_flag) if found.is_enum_flag else [found.default]
        items = ", ".join(f"`{item.identifier}` {item.name}" for item in found.enum_items)
        items = f"any of {items}" if found.is_enum_flag else items
        return ", ".join(f"`{item}`" for item in chosen if item), items or "from a list that depends on the scene"
    if found.type == "BOOLEAN":
        return "on" if found.default else "off", "on, off"
    if found.type in ("INT", "FLOAT"):
        values = list(found.default_array) if found.is_array else [found.default]
        least, most = (_number(limit) for limit in (found.hard_min, found.hard_max))
        unit = f", {found.unit.partition('_')[0].lower()}" if found.unit != "NONE" else ""
        return ", ".join(_number(value) for value in values), f"{least} to {most}".strip() + unit
    default = f"`{found.default}`" if found.type == "STRING" and found.default else ""
    if found.type == "POINTER":
        return default, found.fixed_type.name.lower()
    return default, {"FILE_PATH": "file", "DIR_PATH": "folder"}.get(found.subtype, "text")


def _number(value: float) -> str:
    if abs(value) >= LARGEST:
        return "any"
    return f"{value:,}" if isinstance(value, int) else f"{value:.6g}"


def own_properties(rna: Any) -> Iterator[Any]:
    """Yield the properties that an add-on gave a class, without hidden ones."""
    for found in rna.properties:
        if found.is_runtime and found.name and not found.is_hidden:
            yield found


def property_rows(rna: Any, path: str) -> Iterator[Row]:
    """Yield a row for each property of a class, those of its groups included."""
    for found in own_properties(rna):
        here = f"{path}.{found.identifier}"
        if found.type == "POINTER" and found.fixed_type.base and found.fixed_type.base.identifier == "PropertyGroup":
            yield from property_rows(found.fixed_type, here)
        elif found.type != "COLLECTION":
            yield (here, found.name, *values_of(found), found.description)


def list_properties() -> list[Row]:
    """Return a row for each property that scripts may set: path, label, default, values, description."""
    import bpy

    rows: list[Row] = []
    for name, path in ROOTS.items():
        rna = getattr(bpy.types, name).bl_rna
        for found in own_properties(rna):
            if not found.identifier.startswith("perfect_bvh"):
                continue
            here = f"{path}.{found.identifier}"
            is_group = found.type == "POINTER"
            rows += (
                property_rows(found.fixed_type, here)
                if is_group
                else [(here, found.name, *values_of(found), found.description)]
            )
    from perfect_bvh_addon.settings.preferences import PERFECT_BVH_AP_preferences

    return [*rows, *property_rows(PERFECT_BVH_AP_preferences.bl_rna, PREFERENCES)]


def property_tables(rows: list[Row]) -> str:
    """Return a table for each group of properties, under the path of the group."""
    groups: dict[str, list[Row]] = {}
    for path, *others in rows:
        group, _, name = path.rpartition(".")
        groups.setdefault(group, []).append((f"`{name}`", *others))
    heads = ("Property", "Label", "Default", "Values", "Description")
    return "\n".join(f"### `{group}`\n\n{table(heads, groups[group])}" for group in sorted(groups))


def list_operators() -> list[Row]:
    """Return a row for each operator: how it is called, label, arguments with their defaults, description."""
    import bpy

    rows = []
    for name in sorted(dir(bpy.ops.perfect_bvh)):
        rna = getattr(bpy.ops.perfect_bvh, name).get_rna_type()
        arguments = (f"`{found.identifier}` ({values_of(found)[0]})" for found in own_properties(rna))
        rows.append((f"`{name}`", rna.name, ", ".join(arguments), rna.description))
    return rows


def attribute_texts(owner: type[Any]) -> dict[str, str]:
    """Return the description of each attribute in a class's docstring."""
    _, _, section = (inspect.getdoc(owner) or "").partition("Attributes:\n")
    found = {name: text for names, text in ATTRIBUTE.findall(section) for name in names.split(", ")}
    return {name: " ".join(text.split()) for name, text in found.items()}


def list_sensor_settings() -> list[Row]:
    """Return a row for each setting of a sensor file: kind or table, name, default, meaning."""
    from perfect_bvh_addon.scanning.light.reflectance import TABLES
    from perfect_bvh_addon.scanning.sensor_files import KINDS

    owners = {f'kind = "{kind}"': made for kind, made in KINDS.items()}
    owners |= {f"[{name}]": made for name, made in TABLES.items()}
    rows = []
    for where, made in owners.items():
        texts = attribute_texts(made)
        for field in dataclasses.fields(made):
            rows.append((f"`{where}`", f"`{field.name}`", _default(field.default), texts[field.name]))
    return rows


def _default(value: Any) -> str:
    if isinstance(value, tuple):
        shown = [_default(each) for each in value]
        return ", ".join(shown if len(shown) < 6 else [*shown[:2], "...", shown[-1]])
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def pages() -> dict[str, str]:
    """Return the text of each page of tables, by the name of its file. Registers the add-on."""
    import perfect_bvh_addon

    perfect_bvh_addon.register()
    try:
        properties = property_tables(list_properties())
        operators = table(("Operator", "Label", "Arguments (default)", "Description"), list_operators())
    finally:
        perfect_bvh_addon.unregister()
    settings = table(("Where", "Setting", "Default", "Meaning"), list_sensor_settings())
    in_blender = (
        "# Properties and operators\n\nWhat scripts set and call in Blender. `scene`, `space`, `screen` and "
        "`preferences` are those of `bpy.context`. `space` is a 3D viewport.\n\n"
        f"## Properties\n\n{properties}\n## Operators\n\nOf `bpy.ops.perfect_bvh`.\n\n{operators}"
    )
    sensor_files = (
        "# Sensor files\n\nAll settings of a sensor's TOML file: those of its `kind`, and four tables. `title` and "
        "`source` are for readers. [How to write one](../docs/how_to/own_sensor.md); "
        f"[what the tables do](../addon/scanning/light/README.md).\n\n{settings}"
    )
    return {"in_blender.md": in_blender, "sensor_files.md": sensor_files}
