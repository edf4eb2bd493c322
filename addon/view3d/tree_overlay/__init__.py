"""The boxes of trees as lines over 3D viewports, and the box under the mouse."""
