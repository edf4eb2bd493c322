"""From a synced scene to an image: in one go or step by step, and into a file.

plan           the needs of an image, worked out once: size, border, passes, attributes, rays
still          one frame, at once
progressive    the order of resolutions, rows and samples. Traces nothing.
refinement     traces a view in that order, on a separate thread
denoising      the choice of the denoiser, its input, and messages about failures
saving         view transforms, and image files
data_previews  Blender's small images of materials, lights and worlds
"""
