"""The physics of a sensor's beams: from the rays of a beam to the reported echoes. Needs no Blender.

model           light, optics, detection and noise as numbers; the rays that sample a beam. `README.md` states the rules
beams           casts the beams of a sensor and returns its measurements: echoes, merged, detected, chosen
paths           their paths through glass and alpha and by mirrors
surface_reader  the surfaces that rays hit, and their images
reflectance     how much light they return; light as a sensor's file writes it
"""
