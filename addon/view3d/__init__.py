"""What 3D viewports show: the Rendered shading of a region, and what is drawn over it, a folder each.

rendered      the Rendered shading of a region
tree_overlay  boxes of trees over the scene
compare       two trees of one object side by side
walk          one ray's way through the trees, step by step
drawing       text, panels, lines and colours of boxes, in pixels of a region
legend        what colours mean, in numbers, and what is under the mouse
view_words    the legend and the tip of one viewport
pointer       where the mouse is, and objects and rays that trees are tried with
reading       one object as rays meet it, now or in another frame
cost_scale    the scale of the mode "cost"
scan_points   points of scans in their colours
sensor_view   the lines and the range of the scan's sensor
"""
