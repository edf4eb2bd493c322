"""Chunks of a command's work on many processors and machines, by Dask (`pip install 'perfect-bvh[farm]'`).

run      assigns chunks to workers, those first whose neighbours took longest, and counts the outcomes
cluster  a cluster of this machine's, or the user's; whether its workers can do the work
nanny    watches a worker of this machine's, and restarts it
worker   the work of a Dask worker for a chunk: it sends a request to a Blender in a separate process, `piece_child`
"""
