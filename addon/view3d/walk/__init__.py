"""The walk of one ray through the trees, step by step.

walk_steps    the actions of the ray, as steps with a sentence and counters. Needs no Blender.
walk_picture  lines and triangles of one step. Needs no Blender.
walk_legend   the words over the viewport
walk_view     the shown step, and its picture
"""
