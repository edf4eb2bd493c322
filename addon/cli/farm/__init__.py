"""Pieces of a command's work on many processors and machines, by Dask (`pip install 'perfect-bvh[farm]'`).

run      hands pieces to workers, the one next whose neighbours took longest, and counts what came of each
cluster  a cluster of this machine's, or the user's; whether its workers can do the work
nanny    what watches a worker of this machine's, and starts it again
worker   what a worker of Dask does for a piece: it asks a Blender in a process of its own, `piece_child` beside this
"""
