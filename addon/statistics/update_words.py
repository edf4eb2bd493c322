"""What a row of the list of updates says: what was done and why, and what users can do about it."""

from __future__ import annotations

from .updates import State, UpdateRow
from .words import count_of, duration, memory, primitives, sentence, share

NOTHING = "nothing is to be done"
# What was done to a mesh's tree, or to the objects.
DONE: dict[State, str] = {
    "kept": "Nothing was done",
    "unseen": "Left out",
    "masked": "The Ray Visibility was updated",
    "moved": "Placed anew",
    "recounted": "Instances came or went",
    "replaced": "Shows another mesh",
    "added": "Added",
    "removed": "Removed",
    "refitted": "The tree was refitted",
    "rotated": "The tree was refitted and improved by rotations",
    "partly_rebuilt": "The tree was refitted, and parts of it were rebuilt",
    "rebuilt": "The tree was rebuilt",
    "built": "A tree was built",
}
_WHY: dict[State, str] = {
    "kept": "nothing of it has changed",
    "masked": "other kinds of rays see it than before",
    "moved": "its transform changed; the tree of its mesh is kept",
    "recounted": "there are more or fewer of them than before; the tree of the mesh is kept",
    "replaced": "the tree of that mesh was there already",
    "added": "the tree of its mesh was there already",
    "removed": "deleted, unlinked or hidden",
}
_ADVICE: dict[State, str] = {
    "kept": sentence(NOTHING),
    "masked": f"{sentence(NOTHING)}: that costs next to no time",
    "moved": f"{sentence(NOTHING)}: what moves as a whole costs next to no time",
    "recounted": f"{sentence(NOTHING)}: instances share one tree",
    "replaced": f"{sentence(NOTHING)}: objects share the tree of one mesh",
    "added": f"{sentence(NOTHING)}: objects share the tree of one mesh",
    "removed": sentence(NOTHING),
    "unseen": "To have it in the image, show it and let its Ray Visibility have some kind of ray see it",
}


def what_was_done(row: UpdateRow) -> str:
    """A sentence: what, in which time, and why."""
    took = f" in {duration(row.milliseconds)}" if row.milliseconds else ""
    reason = row.reason or _WHY.get(row.state) or ("" if row.tree is None else row.tree.reason)
    return f"{DONE[row.state]}{took}: {reason}" if reason else f"{DONE[row.state]}{took}"


def what_to_do(row: UpdateRow) -> str:
    """A sentence: what makes the next update quicker, or that nothing is to be done."""
    if row.state in _ADVICE:
        return _ADVICE[row.state]
    mesh = row.mesh
    if mesh is None:
        return sentence(NOTHING)
    if mesh.usage == "changing":
        return _about_changing(mesh.remade_by, mesh.usage_reason)
    if row.state == "built":
        return f"{sentence(NOTHING)}: the tree is kept until the mesh changes"
    if mesh.action == "replaced":
        culprit = mesh.remade_by or "An edit or a script"
        return f"{culprit} has changed the mesh: {NOTHING}, unless that happens in every frame"
    if row.state == "rebuilt":
        return f"{sentence(NOTHING)}: a new tree pays for itself here"
    return f"{sentence(mesh.usage_reason)}: refitting follows that quickly, {NOTHING}"


def _about_changing(remade_by: str, reason: str) -> str:
    if remade_by:
        return f"{remade_by} changes the mesh in every frame: apply or bake it to get quick updates"
    if reason.startswith("metaballs"):
        return f"{sentence(reason)}: convert them to a mesh to get quick updates"
    return (
        f"{sentence(reason)}, and no modifier does that: if a script or handler makes the mesh anew, let it move "
        "vertices instead to get quick updates"
    )


def facts_of(row: UpdateRow) -> str:
    """How large the mesh is, and what it costs rays."""
    found = []
    if row.mesh is not None:
        found.append(count_of(row.mesh.triangle_count, row.mesh.kind.removesuffix("s")))
        if row.mesh.kind == "curves" and row.tree is not None:
            found.append(primitives(row.tree.triangle_count, "curves"))
    if row.tree is not None and row.tree.byte_count:
        found.append(memory(row.tree.byte_count))
    if row.share > 0.0:
        found.append(f"{share(row.share)} of the camera rays' work")
    return ", ".join(found)
