"""The boxes of the trees over 3D viewports: the drawn boxes, their description, and the one under the mouse.

overlay        the overlay of a viewport: begins, ends, draws
scene_overlay  the drawn boxes of a scene, and their description
tree_lines     lines of one tree's boxes on the graphics card
hovered_box    the box under the mouse
"""
