"""What Blender has done since: changes as they happen, and the log of what was evaluated.

changes  listeners to depsgraph updates, frame changes, undo, loading
asking   the log of what Blender evaluated, and requests for more
"""
