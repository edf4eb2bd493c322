"""A Blender scene and the engine's copy of it, in step for as long as both live.

scene_sync      `SceneSync`, for scripts
synced_scene    the result of a sync; from ids back to Blender
sync_cache      the add-on's own syncs, and which are dropped when they take too much memory
scene_view      whose scene is read: that of a render, or that of viewports
drop_in         `BVHTree` and `ray_cast`, which answer as those of Blender do
pending_commit  trees that are built while Blender continues
"""
