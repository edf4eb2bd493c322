"""Measurements of the user's own scene: a table, advice and, where matplotlib is installed, charts.

`measurements` finds the figures; `results`, `advice` and `charts` say what is in them, without Blender or the engine.
"""
