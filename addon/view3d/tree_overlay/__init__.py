"""The boxes of the trees over 3D viewports: which are drawn, what is told of them, and the one under the mouse."""
