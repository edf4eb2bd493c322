"""What 3D viewports show: the Rendered shading of a region, and what is drawn over it, a folder each.

Beside the folders stands what several of them use (text and panels, boxes as lines, the mouse, objects and the rays
that try trees), and what is a single file.
"""
