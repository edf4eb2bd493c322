import bpy
import perfect_bvh

from .common import camera_rays, evaluated, find_addon, tell


def main():
    scene = bpy.context.scene
    sync = find_addon().SceneSync()
    scene.frame_set(scene.frame_end - 8)
    sync.update(evaluated())
    rays = camera_rays()
    late = sync.scene.cast_rays(*rays)
    scene.frame_set(scene.frame_end)
    try:
        sync.scene.cast_rays(*rays)
    except perfect_bvh.StaleSceneError as error:
        refusal = str(error)
    else:
        raise RuntimeError("a query was answered from the frame before")
    sync.update(evaluated())
    right = sync.scene.cast_rays(*rays)
    wrong = int((late.t_hit != right.t_hit).sum())
    tell(
        f"The ball has rolled on. Trees of the frame before answer {wrong:,} of {len(right.t_hit):,} rays wrongly.",
        f"This engine, asked before update(): StaleSceneError: {refusal}",
        f"After update(): {int(right.is_hit.sum()):,} rays meet the ball where it is now.",
    )


main()
