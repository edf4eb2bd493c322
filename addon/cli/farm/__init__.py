"""Pieces of a command's work on many processors and machines, by Dask (`pip install 'perfect-bvh[farm]'`).

run      hands pieces to workers, and counts what came of each
cluster  a cluster of this machine's, or the user's; whether its workers can do the work
nanny    what watches a worker of this machine's, and starts it again
costs    which piece comes next, by what those beside it took
worker   what a worker of Dask does for a piece: it asks a Blender in a process of its own, `piece_child` beside this
"""
