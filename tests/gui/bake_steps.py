"""A bake on the example of a town: colours, the legend, the value and the chart under the mouse."""

from __future__ import annotations

import bpy
from addon_state import forget_reports, module, settings, space, wait_for_report
from driver import Step, check, redrawn, screenshot, wait_until
from example_steps import open_example
from hands import hover
from places import area_of, context_of, middle_of
from tree_steps import open_sidebar


def bake_a_town() -> Step:
    yield from open_example("town")
    bpy.ops.object.select_by_type(type="MESH")
    bpy.context.view_layer.objects.active = bpy.data.objects["Courtyard houses"]
    settings().bake.period, settings().bake.step = "YEAR", 120
    yield from open_sidebar(area_of("VIEW_3D"))
    forget_reports()
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.perfect_bvh.bake_rays("INVOKE_DEFAULT")
    yield from wait_for_report("Sun Hours: ")
    check((space().shading.type, space().shading.color_type) == ("SOLID", "VERTEX"), "the colors are not shown")
    yield from redrawn()
    view = module("view3d.baked_view")
    hover(*middle_of(area_of("VIEW_3D")))
    yield from wait_until(lambda: view._lines, "no value is shown under the mouse")
    screenshot("bake_a_town")
    bpy.ops.ed.undo()
    check("sun_hours" not in bpy.data.objects["Court"].data.attributes, "undo leaves the values")
    yield from redrawn()
