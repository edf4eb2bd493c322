"""Who is seen: ray visibility, holdouts, and the objects that only a render or only a viewport shows.

The depsgraph leaves out what its own mode hides. What remains to be decided here is what Cycles decides
too: ray visibility and holdouts of an instance are those of the object and of its instancer together.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import bpy

from ..sync.records import (
    CATCHES_SHADOWS,
    VISIBLE_TO_CAMERA,
    VISIBLE_TO_DIFFUSE,
    VISIBLE_TO_GLOSSY,
    VISIBLE_TO_SHADOW,
    VISIBLE_TO_TRANSMISSION,
    VISIBLE_TO_VOLUME,
)

_TYPE_SWITCHES = {
    "MESH": "show_object_viewport_mesh",
    "CURVE": "show_object_viewport_curve",
    "SURFACE": "show_object_viewport_surf",
    "META": "show_object_viewport_meta",
    "FONT": "show_object_viewport_font",
    "CURVES": "show_object_viewport_curves",
    "POINTCLOUD": "show_object_viewport_pointcloud",
}

# A render shows the children of such an object only as its instances, not the children themselves.
_INSTANCES_CHILDREN = {"VERTS", "FACES"}


def _ray_mask(obj: Any) -> int:
    """Written out because it is asked for every object at every sync."""
    mask = VISIBLE_TO_CAMERA if obj.visible_camera else 0
    if obj.visible_diffuse:
        mask |= VISIBLE_TO_DIFFUSE
    if obj.visible_glossy:
        mask |= VISIBLE_TO_GLOSSY
    if obj.visible_transmission:
        mask |= VISIBLE_TO_TRANSMISSION
    if obj.visible_volume_scatter:
        mask |= VISIBLE_TO_VOLUME
    if obj.visible_shadow:
        mask |= VISIBLE_TO_SHADOW
    return mask


def _placed(obj: Any, parent: Any) -> Any:
    """Return the object whose collections' settings in the view layer count: for an instance, the instancer.

    Cycles asks the duplicate, which is not in the view layer, and then the instancer. Python may get the
    original in place of the duplicate, if any reference to it exists, and would get its answer.
    """
    return obj if parent is None else parent


def outside_viewports() -> AbstractContextManager[Any]:
    """While this is active, `visible_get` answers for no 3D viewport.

    Otherwise it answers for the context's viewport, which may be any, even in local view: Blender updates all viewports
    while scripts and operators run, and keeps their context.
    """
    return nullcontext() if bpy.context.area is None else bpy.context.temp_override(area=None, region=None)


class VisibilityReader:
    """Answers for one evaluated depsgraph who is visible, and to which rays.

    for_viewport: whether viewport or render visibility counts.
    space: the 3D viewport whose local view and type filters count, or None.
    """

    def __init__(self, depsgraph: Any, for_viewport: bool, space: Any = None) -> None:
        self._view_layer = depsgraph.view_layer_eval
        self._for_viewport = for_viewport
        self._space = space
        self._original_view_layer = depsgraph.view_layer
        self._layer_uids: set[int] | None = None
        self._render_filter = None
        if not for_viewport and depsgraph.mode == "VIEWPORT":
            self._render_filter = RenderFilter(depsgraph)

    @property
    def look(self) -> tuple[Any, ...] | None:
        """Return everything that decides visibility, except objects' own settings; None if each must be asked again."""
        if self._view_layer.material_override is not None or self._render_filter is not None:
            return None
        space = self._space
        if space is None:
            return (self._for_viewport,)
        if space.local_view is not None or space.use_local_collections:
            return None
        return (self._for_viewport, *(getattr(space, switch) for switch in _TYPE_SWITCHES.values()))

    def mask(self, obj: Any, parent: Any) -> int:
        """VISIBLE_TO_* bits of an evaluated object seen as itself (parent None) or as an instance of parent's."""
        mask = _ray_mask(obj) if parent is None else _ray_mask(obj) & _ray_mask(parent)
        if _placed(obj, parent).indirect_only_get(view_layer=self._view_layer):
            mask &= ~VISIBLE_TO_CAMERA
        # As in Cycles, the instancer's setting counts for its instances, too.
        if mask and (obj.is_shadow_catcher or (parent is not None and parent.is_shadow_catcher)):
            mask |= CATCHES_SHADOWS
        return mask

    def is_holdout(self, obj: Any, parent: Any) -> bool:
        """Whether the object, or for an instance its instancer, cuts a transparent hole into the image."""
        return bool(_placed(obj, parent).holdout_get(view_layer=self._view_layer))

    def is_hidden(self, obj: Any, parent: Any) -> bool:
        """Whether an object that the depsgraph lists must not be shown all the same."""
        if not self._for_viewport:
            return self._render_filter is not None and self._render_filter.is_hidden(obj, parent)
        if self._space is None:
            return self._is_hidden_by_layer(_placed(obj, parent))
        if parent is None:
            return not obj.visible_in_viewport_get(self._space)
        return self._is_instance_hidden_in_space(obj, parent)

    def _is_instance_hidden_in_space(self, obj: Any, parent: Any) -> bool:
        """An instance is shown where its instancer is, but belongs to the type of object that it shows."""
        if not getattr(self._space, _TYPE_SWITCHES.get(obj.type, ""), True):
            return True
        if self._space.local_view is not None and not parent.local_view_get(self._space):
            return True
        if self._space.use_local_collections and not parent.visible_in_viewport_get(self._space):
            return True
        return self._is_hidden_by_layer(parent)

    def _is_hidden_by_layer(self, obj: Any) -> bool:
        """Whether the eye icon of a collection hides the object, which is still evaluated and listed."""
        if obj.visible_get(view_layer=self._view_layer):
            return False
        if self._layer_uids is None:
            self._layer_uids = {member.session_uid for member in self._original_view_layer.objects}
        # Objects of a background scene are in no view layer of this one, and are shown.
        return obj.original.session_uid in self._layer_uids


class RenderFilter:
    """Removes from a viewport depsgraph the objects that a render would not show.

    It cannot restore objects that the viewport hides, nor give modifiers their render settings. It shows members of
    collections that nodes or particles instance even if they are hidden in renders: a viewport depsgraph does not tell
    how such an instance was made. A render's own depsgraph needs none of this.
    """

    def __init__(self, depsgraph: Any) -> None:
        self._in_scene: set[int] = set()
        self._in_collection: dict[int, set[int]] = {}
        _collect_layer(depsgraph.view_layer.layer_collection, self._in_scene)
        scene = depsgraph.scene.background_set
        while scene is not None:
            _collect_layer(scene.view_layers[0].layer_collection, self._in_scene)
            scene = scene.background_set

    def is_hidden(self, obj: Any, parent: Any) -> bool:
        if parent is None:
            is_alone = obj.parent is None or obj.parent.instance_type not in _INSTANCES_CHILDREN
            return not is_alone or self._is_absent(obj) or _is_own_surface_hidden(obj)
        if self._is_absent(parent):
            return True
        if parent.instance_type == "COLLECTION" and parent.instance_collection is not None:
            is_member = obj.original.session_uid in self._members(parent.original.instance_collection)
            return not is_member or _is_own_surface_hidden(obj)
        return parent.instance_type in _INSTANCES_CHILDREN and obj.original != parent.original and self._is_absent(obj)

    def _is_absent(self, obj: Any) -> bool:
        return obj.original.session_uid not in self._in_scene

    def _members(self, collection: Any) -> set[int]:
        members = self._in_collection.get(collection.session_uid)
        if members is None:
            members = self._in_collection[collection.session_uid] = set()
            _collect_instanced(collection, members, set())
        return members


def _is_own_surface_hidden(obj: Any) -> bool:
    """Whether a render shows an instancer's instances, but not the instancer itself."""
    return bool(obj.is_instancer and not obj.show_instancer_for_render)


def _collect_layer(layer: Any, found: set[int]) -> None:
    """Session uids of the objects that a layer collection and those below it show in a render."""
    if layer.collection.hide_render:
        return
    if not layer.exclude:
        found.update(obj.session_uid for obj in layer.collection.objects if not obj.hide_render)
    for child in layer.children:
        _collect_layer(child, found)


def _collect_instanced(collection: Any, found: set[int], entered: set[int]) -> None:
    """Collect session uids of objects that an instanced collection shows in a render, through instancers inside it."""
    if collection.hide_render or collection.session_uid in entered:
        return
    entered.add(collection.session_uid)
    for obj in collection.objects:
        if obj.hide_render:
            continue
        found.add(obj.session_uid)
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            _collect_instanced(obj.instance_collection, found, entered)
    for child in collection.children:
        _collect_instanced(child, found, entered)
