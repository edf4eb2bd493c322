"""What 3D viewports show: the Rendered shading of a region, and boxes of trees drawn over it."""
