"""The walk of one ray through the trees, step by step."""
