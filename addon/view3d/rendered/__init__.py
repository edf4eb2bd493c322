"""The Rendered shading of a 3D viewport: its camera, its light, its image on the screen, and when it is drawn again.

viewport       one region: its scene in step, its view refined
screen         the region's camera, where the image goes, its statistics
redraws        when viewports are drawn again
view_lighting  the switches of the Shading popover
opening        files that open with Rendered viewports
"""
