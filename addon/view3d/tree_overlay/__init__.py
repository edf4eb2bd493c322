"""The boxes of the trees over 3D viewports: which are drawn, what is told of them, and the one under the mouse.

overlay        the overlay of a viewport: begins, ends, draws
scene_overlay  which boxes of a scene are drawn, and what is said of them
tree_lines     lines of one tree's boxes on the graphics card
hovered_box    the box under the mouse
"""
