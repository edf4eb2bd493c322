"""What trees cost from frame to frame of an animation, as curves."""
