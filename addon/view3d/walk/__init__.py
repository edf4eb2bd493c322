"""The walk of one ray through the trees, step by step.

walk_steps    what the ray does, as steps with a sentence and counters. Needs no Blender.
walk_picture  lines and triangles of one step. Needs no Blender.
walk_legend   the words over the viewport
walk_view     which step is shown, and its picture
"""
