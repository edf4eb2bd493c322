"""What light does to a sensor's beams: from the rays of a beam to the echoes that are reported. Needs no Blender.

model          light, optics, detection and noise as numbers; `README.md` states the rules
tables         the same in a sensor's file
beams          casts the beams of a sensor and returns what it measures
beam_rays      the rays that sample a beam
paths          their paths through glass and alpha and by mirrors
surface_reader, image_lookup, reflectance  the surfaces that rays meet, and how much light they return
echoes         echoes of a beam: merged, detected, chosen
measuring, ray_noise  noise that belongs to each ray
"""
