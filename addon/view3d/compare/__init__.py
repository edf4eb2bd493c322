"""Two trees of one object side by side."""
