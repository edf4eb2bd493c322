"""Measurements of the user's own scene, and the charts they are shown as.

`chart` says what is shown; `layout` turns it into lines, marks and words; `picture` and the two modules beside it write
these as an image. Nothing but those two, `scene` and `measurements` needs Blender or the engine, so that the project's
own charts (tests/charts) are drawn by the same code from what benchmarks wrote.
"""
