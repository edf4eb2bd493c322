"""Edits of the particle hair in a soak's scene: systems that come and go, settings, children, combing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
from blender.particle_hair import CHILDREN, add_hair
from blender.soak_look_edits import NothingToEditError

if TYPE_CHECKING:
    from blender.soak import Soak

MOST_SYSTEMS = 4
MOST_STRANDS = 12


def _systems() -> list[tuple[Any, Any]]:
    """Return the objects, each with the modifier of one particle system."""
    modifiers = [(obj, modifier) for obj in bpy.data.objects for modifier in obj.modifiers]
    return [(obj, modifier) for obj, modifier in modifiers if modifier.type == "PARTICLE_SYSTEM"]


def _a_system(soak: Soak) -> Any:
    return soak.pick(modifier.particle_system for _, modifier in _systems() if modifier.particle_system is not None)


def _some_settings(soak: Soak) -> Any:
    return soak.pick(each for each in bpy.data.particles if each.users)


def sprout(soak: Soak) -> None:
    """Grow hair on a mesh, with children of some kind or none."""
    obj = soak.an_object("MESH")
    if len(_systems()) >= MOST_SYSTEMS or not len(obj.data.polygons):
        raise NothingToEditError
    kind = soak.pick(CHILDREN)
    few = dict.fromkeys(CHILDREN[kind], 2)
    count = int(soak.number(1, MOST_STRANDS))
    add_hair(obj, count=count, child_type=kind, child_percent=2, hair_length=soak.number(0.5, 2.0), **few)


def shave(soak: Soak) -> None:
    """Remove one particle system."""
    obj, modifier = soak.pick(_systems())
    obj.modifiers.remove(modifier)


def share_settings(soak: Soak) -> None:
    """Let two systems share the same settings, or give one system a copy."""
    settings = _some_settings(soak)
    _a_system(soak).settings = soak.pick((settings, settings.copy()))


def comb_particles(soak: Soak) -> None:
    """Change a setting that bends strands, so that each strand is evaluated again."""
    settings = _some_settings(soak)
    name = soak.pick(
        ("brownian_factor", "normal_factor", "hair_length", "clump_factor", "kink_amplitude", "roughness_1")
    )
    setattr(settings, name, soak.number(0.05, 1.0))
    settings.kink = soak.pick(("NO", "CURL", "WAVE"))
    if soak.number() > 0.0:
        _a_system(soak).seed = int(soak.number(0, 9))


def comb_by_hand(soak: Soak) -> None:
    """Enter and leave the particle mode, which makes strands edited ones; perhaps clear the edits."""
    layer = bpy.context.view_layer
    obj, modifier = soak.pick((obj, one) for obj, one in _systems() if obj.name in layer.objects and obj.visible_get())
    layer.objects.active = obj
    obj.particle_systems.active_index = list(obj.particle_systems).index(modifier.particle_system)
    if modifier.particle_system.is_edited and soak.number() > 0.0:
        bpy.ops.particle.edited_clear()
        return
    bpy.ops.particle.particle_edit_toggle()
    soak._check(soak.sync, bpy.context.evaluated_depsgraph_get())
    bpy.ops.particle.particle_edit_toggle()


def count_strands(soak: Soak) -> None:
    """Change the type of children, and one of the counts of strands, children and steps."""
    settings = _some_settings(soak)
    settings.child_type = soak.pick(CHILDREN)
    name, most = soak.pick(
        (
            ("count", MOST_STRANDS),
            ("child_percent", 3),
            ("rendered_child_count", 3),
            ("hair_step", 6),
            ("display_step", 4),
            ("render_step", 4),
            ("display_percentage", 100),
        )
    )
    setattr(settings, name, max(int(soak.number(0, most + 1)), 2 if name == "hair_step" else 0))


def thicken_particles(soak: Soak) -> None:
    """Change radii, which Blender does not evaluate, the material, or the way in which strands are shown."""
    settings = _some_settings(soak)
    settings.root_radius, settings.tip_radius = soak.number(0.0, 1.0), soak.number(0.0, 1.0)
    settings.radius_scale, settings.shape = soak.number(0.05, 0.3), soak.number(-0.9, 0.9)
    settings.use_close_tip, settings.material = bool(soak.number() > 0.0), int(soak.number(1, 4))
    settings.render_type = soak.pick(("PATH", "PATH", "PATH", "NONE"))


def switch_system(soak: Soak) -> None:
    """Switch a system off in viewports, or in renders."""
    _, modifier = soak.pick(_systems())
    switch = soak.pick(("show_viewport", "show_render"))
    setattr(modifier, switch, not getattr(modifier, switch))


PARTICLE_EDITS: tuple[Any, ...] = (
    sprout,
    shave,
    share_settings,
    comb_particles,
    comb_by_hand,
    count_strands,
    thicken_particles,
    switch_system,
)
