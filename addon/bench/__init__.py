"""Measurements of the user's own scene: a table, advice and, where matplotlib is installed, charts.

measurements  finds the figures
results       the figures as a file, and as a table. Needs no Blender.
advice        a sentence for each part that was measured. Needs no Blender.
charts        the figures as images. Needs no Blender.
"""
