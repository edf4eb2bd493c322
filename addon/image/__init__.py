"""From a scene that is in step to an image: in one go or step by step, and into a file.

plan           what an image takes, worked out once: size, border, passes, attributes, rays
still          one frame, at once
progressive    the order of resolutions, rows and samples. Traces nothing.
refinement     traces a view in that order, on a thread of its own
denoising      which denoiser, what it is given, and what is said if it fails
saving         view transforms, and image files
data_previews  Blender's small images of materials, lights and worlds
"""
