"""What the last image of each scene cost, in one place, and as rows that panels show.

last_result  what was done last for a scene, and whether the scene still is as it was
messages     what went wrong last
not_shown    what the last image lacks, as rows of a list
updates      what was updated for it, object by object
update_list  the same as a list that Blender draws
words        numbers and errors in words
"""
