"""Runs a user's actions with the add-on in a Blender with windows, step by step; blender -P steps.py, see windows.sh.

The extension is installed but not enabled, and tree_in_wind.blend is open.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

import bad_use_steps
import bake_steps
import comb_steps
import data_preview_steps
import example_steps
import file_steps
import label_steps
import motion_steps
import overlay_steps
import panel_steps
import preferences_steps
import redraw_steps
import render_steps
import scan_steps
import split_view_steps
import tooltip_steps
import tree_steps
import two_window_steps
import update_steps
import viewport_steps
import walk_steps
from driver import Step, run

STEPS = (
    panel_steps.enable,
    panel_steps.press_the_main_panels_buttons,
    panel_steps.press_sampling_film_and_performance,
    panel_steps.press_light_paths,
    panel_steps.press_curves,
    motion_steps.press_motion_blur,
    panel_steps.fill_in_the_scan_panel,
    panel_steps.find_the_manual,
    panel_steps.press_simplify,
    panel_steps.press_the_panorama,
    panel_steps.bench,
    panel_steps.follow_the_benchmarks_advice,
    panel_steps.choose_passes,
    data_preview_steps.show_previews,
    preferences_steps.press_the_preferences,
    tooltip_steps.show_tooltips,
    tooltip_steps.show_why_scan_is_grey,
    bad_use_steps.type_zeros,
    bad_use_steps.render_what_does_not_fit,
    bad_use_steps.render_what_is_broken,
    bad_use_steps.render_into_nowhere,
    motion_steps.render_what_moves,
    panel_steps.show_the_viewport,
    scan_steps.stop_a_scan,
    scan_steps.stop_a_scan_while_it_builds,
    scan_steps.scan,
    scan_steps.scan_to_ply,
    scan_steps.add_a_sensor,
    label_steps.label_images,
    bad_use_steps.scan_onto_bad_disks,
    bad_use_steps.delete_and_undo_while_scanning,
    overlay_steps.show_the_top_level,
    overlay_steps.point_at_a_box,
    overlay_steps.show_the_active_object,
    overlay_steps.follow_an_animation,
    overlay_steps.draw_100000_boxes,
    tree_steps.compare_two_trees,
    walk_steps.walk_a_ray,
    walk_steps.leave_the_workspace_while_walking,
    walk_steps.undo_while_walking,
    render_steps.press_preview,
    render_steps.follow_a_preview_without_the_mouse,
    render_steps.stop_a_preview_while_it_builds,
    render_steps.render_without_a_camera,
    render_steps.render,
    render_steps.let_statistics_come_by_themselves,
    update_steps.choose_rows_of_what_was_updated,
    update_steps.list_a_viewports_first_image,
    panel_steps.every_button_was_pressed,
    render_steps.cancel_a_render,
    viewport_steps.switch_to_rendered,
    bad_use_steps.copy_nothing,
    viewport_steps.show_each_mode,
    viewport_steps.trace_while_nobody_redraws,
    viewport_steps.orbit,
    viewport_steps.look_orthographically,
    viewport_steps.look_through_the_camera,
    viewport_steps.restrict_to_a_border,
    viewport_steps.play,
    redraw_steps.draw_crisp_pixels,
    redraw_steps.play_beside_cycles,
    redraw_steps.sculpt,
    redraw_steps.switch_with_100000_instances,
    viewport_steps.edit_and_undo,
    viewport_steps.edit_lights_and_materials,
    viewport_steps.build_beside_the_viewport,
    viewport_steps.show_four_views,
    split_view_steps.show_two_viewports,
    split_view_steps.edit_beside_two_viewports,
    split_view_steps.hide_in_one_of_two_viewports,
    split_view_steps.show_boxes_in_one_of_two_viewports,
    split_view_steps.join_viewports,
    two_window_steps.show_two_scenes_in_two_windows,
    two_window_steps.edit_in_two_scenes,
    two_window_steps.close_a_window_while_it_renders,
    two_window_steps.delete_a_scene_while_it_renders,
    viewport_steps.show_another_panorama,
    file_steps.open_another_file,
    file_steps.first_image_after_an_edit,
    file_steps.lose_the_engine,
    file_steps.disable_and_enable,
    example_steps.press_f12_in_an_example,
    example_steps.keep_the_interface,
    example_steps.scan_an_example,
    example_steps.play_a_failure_case,
    bake_steps.bake_a_town,
    comb_steps.comb,
    file_steps.report,
)

# The actions of most users, for the check of each change.
MAIN_STEPS = (
    panel_steps.enable,
    panel_steps.press_the_main_panels_buttons,
    panel_steps.show_the_viewport,
    scan_steps.scan,
    label_steps.label_images,
    render_steps.press_preview,
    render_steps.render,
    render_steps.cancel_a_render,
    viewport_steps.switch_to_rendered,
    viewport_steps.show_each_mode,
    viewport_steps.orbit,
    viewport_steps.play,
    viewport_steps.edit_and_undo,
    file_steps.open_another_file,
    file_steps.disable_and_enable,
    file_steps.report,
)


def chosen_steps(names: str) -> list[Callable[[], Step]]:
    """Return the steps named, with commas between them: all for an empty text, those of most users for "main"."""
    if names in ("", "main"):
        return list(MAIN_STEPS if names else STEPS)
    steps = {step.__name__: step for step in STEPS}
    unknown = [name for name in names.split(",") if name not in steps]
    if unknown:
        raise SystemExit(f"WINDOWS_STEPS names no step: {', '.join(unknown)}. Steps: {', '.join(steps)}")
    return [step for name, step in steps.items() if name in names.split(",")]


if __name__ == "__main__":
    run(chosen_steps(os.environ.get("WINDOWS_STEPS", "")), bpy.ops.wm.quit_blender)
