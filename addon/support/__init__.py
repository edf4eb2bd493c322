"""The base of all other modules: files that are whole or missing, memory, long calls on separate threads, colors.

files            files that are whole or missing; paths of each system
memory           free memory, and refusals of requests that need more
background_work  a long call on a separate thread
id_colors        the color of an id
"""
