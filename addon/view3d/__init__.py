"""The contents of 3D viewports: the Rendered shading of a region, and drawings over it, a folder each.

rendered      the Rendered shading of a region
tree_overlay  boxes of trees over the scene
compare       two trees of one object side by side
walk          one ray's path through the trees, step by step
drawing       text, panels, lines and colours of boxes, in pixels of a region
legend        the meaning of colours, in numbers, and a tip at the mouse
view_words    the legend and the tip of one viewport
pointer       the mouse's position, and objects and sample rays for trying trees
reading       one object as rays hit it, now or in another frame
cost_scale    the scale of the mode "cost"
baked_view    the scale, the value under the mouse and the chart of baked rays
baked_colors  baked values as colours of meshes
scan_points   points of scans in their colours
sensor_view   the lines and the range of the scan's sensor
"""
