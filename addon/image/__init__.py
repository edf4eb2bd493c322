"""From a scene that is in step to an image: in one go or step by step, and into a file."""
