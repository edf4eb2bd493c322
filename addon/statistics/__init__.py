"""The cost of the last image of each scene, in one place, and as rows that panels show.

last_result  the last result of a scene, and whether the scene has changed since
messages     the last errors
not_shown    what the last image lacks, as rows of a list
updates      the updates for it, object by object
update_list  the same as a list that Blender draws
words        numbers and errors in words
"""
