"""Events of Blender: changes as they happen, and the log of evaluations.

changes  listeners to depsgraph updates, frame changes, undo, loading
asking   the log of what Blender evaluated, and requests for more
"""
