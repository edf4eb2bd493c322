import bpy
import numpy as np

from .common import camera_rays, evaluated, find_addon, tell


def main():
    scene = bpy.context.scene
    sync = find_addon().SceneSync()
    scene.frame_set(scene.frame_start)
    sync.update(evaluated())
    origins, directions = camera_rays()
    half = len(origins) // 2
    whole = sync.scene.cast_rays(origins, directions).t_hit
    snapshot = sync.scene.snapshot()
    first = snapshot.cast_rays(origins[:half], directions[:half]).t_hit

    scene.frame_set(scene.frame_start + 8)  # the edit
    sync.update(evaluated())

    second = snapshot.cast_rays(origins[half:], directions[half:]).t_hit
    in_place = sync.scene.cast_rays(origins[half:], directions[half:]).t_hit
    mixed = int((in_place != whole[half:]).sum())
    torn = int((np.concatenate([first, second]) != whole).sum())
    tell(
        f"A tree that is edited in place answers {mixed:,} of the batch's {len(whole):,} rays from another scene.",
        f"This engine's snapshot, asked after the edit: {torn:,} rays differ from the batch that nobody edited.",
    )


main()
