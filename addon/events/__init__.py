"""What Blender has done since: changes as they happen, and the log of what was evaluated."""
