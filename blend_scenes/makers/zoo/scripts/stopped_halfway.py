import bpy
import perfect_bvh

from .common import camera_rays, evaluated, find_addon, tell


def main():
    scene = bpy.context.scene
    sync = find_addon().SceneSync()
    scene.frame_set(scene.frame_start)
    sync.update(evaluated())
    rays = camera_rays()
    before = sync.scene.cast_rays(*rays).t_hit
    snapshot = sync.scene.snapshot()

    scene.frame_set(scene.frame_end)
    heaps = [item for item in scene.objects if item.type == "MESH"]
    for item in heaps:  # their trees take long meanwhile
        item.modifiers.new("Long", "SUBSURF").subdivision_type = "SIMPLE"
        item.modifiers["Long"].levels = 2
    try:
        sync.update(evaluated(), progress=lambda done: False)  # as Esc does
    except perfect_bvh.Cancelled:
        stopped = "The build of the heaps was stopped."
    else:
        raise RuntimeError("The build was over before it could be stopped: raise Levels in this script")
    finally:
        for item in heaps:
            item.modifiers.remove(item.modifiers["Long"])
    kept = int((snapshot.cast_rays(*rays).t_hit != before).sum())
    try:
        sync.scene.cast_rays(*rays)
    except perfect_bvh.StaleSceneError as error:
        refusal = str(error)
    else:
        raise RuntimeError("a query was answered although a build was stopped")
    sync.update(evaluated())
    after = int((sync.scene.cast_rays(*rays).t_hit != before).sum())
    tell(
        stopped,
        f"The snapshot of before: {kept:,} of {len(before):,} rays differ; no new tree has come among the old ones.",
        f"The scene itself, before update(): StaleSceneError: {refusal}",
        f"After update(): {after:,} rays meet something else than before, all of it new.",
    )


main()
