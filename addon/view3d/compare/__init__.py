"""Two trees of one object side by side.

compare_view   the two halves over a viewport, and when they are drawn again
compare_trees  both trees: built, measured with the same rays. Needs no Blender.
half_picture   one half: the object, shaded, and its boxes
"""
