"""The buttons of the panels.

preview       *Render View to Image*
scan_button   *Scan*
scan_request  the settings of its panel, checked
add_sensor    *Add Sensor*
label_button  *Label Images*
bake_button   *Bake Sun, Sky and Thickness*
piece_jobs    the common parts of *Scan*, *Label Images* and *Bake Sun, Sky and Thickness*
measure       *Bench*, and the comparison of two trees
select        selects objects that are not shown, or were updated
walk          keys of the walk of a ray
help_buttons  open the manual, copy a command
ticking       the common parts of all: reasons why not, steps of a timer, the status bar
"""

from __future__ import annotations

import bpy

from ..bench import results
from . import (
    add_sensor,
    bake_button,
    help_buttons,
    label_button,
    measure,
    preview,
    scan_button,
    scan_request,
    select,
    ticking,
    walk,
)

_MODULES = (preview, scan_button, scan_request, add_sensor, label_button, bake_button, measure, select, walk)
_MODULES += (help_buttons,)
_CLASSES = tuple(operator for module in _MODULES for operator in module.CLASSES)


def register() -> None:
    for operator in _CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    for operator in reversed(_CLASSES):
        bpy.utils.unregister_class(operator)
    for module in (results, scan_request, bake_button, ticking):
        module.forget()
