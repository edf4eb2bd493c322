"""The Rendered shading of a 3D viewport: its camera, its light, its image on the screen, and when it is drawn again."""
