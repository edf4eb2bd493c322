"""The number that Blender gives each instance for the node Object Info's output Random, from names and persistent ids.

It is Bob Jenkins' hash "lookup3" (2006) of two words, over the object's name, the levels of the persistent id, and the
instancer's name. Both Blender and Cycles take it for the random number of an instance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ...sync.records import InstanceRecords, ObjectRecord

Uint32Array = npt.NDArray[np.uint32]

_UNUSED_LEVEL = 2**31 - 1  # Blender's filler in a persistent id
_NO_PARENT = -1
# How far lookup3's last mixing turns its words.
_TURNS = (14, 11, 25, 16, 4, 14, 24)


def random_ids(instances: InstanceRecords, objects: Sequence[ObjectRecord]) -> Uint32Array:
    """(I,): of each instance that its instancer makes itself; nested instancers have names that records lack."""
    shown, parents = instances.object_indices, instances.parent_indices
    is_made = parents != _NO_PARENT
    names = np.array([hash_name(obj.name) for obj in objects], np.uint32)
    own = hash_pair(names[shown], np.uint32(0))
    if not is_made.any():
        return own
    uids = np.array([obj.session_uid for obj in objects], np.int64)
    levels = instances.persistent_ids
    hashes = np.where(levels[:, 0] == _UNUSED_LEVEL, own, names[shown])
    for column in levels.T[: int((levels != _UNUSED_LEVEL).sum(axis=1).max())]:
        hashes = np.where(column != _UNUSED_LEVEL, hash_pair(hashes, column.astype(np.uint32)), hashes)
    by_others = uids[shown] != uids[parents]
    hashes = np.where(by_others, hashes ^ hash_pair(names[parents], np.uint32(0)), hashes)
    return np.where(is_made, hashes, own)


def hash_name(name: str) -> int:
    """Of its bytes in UTF-8."""
    number = 0
    for byte in name.encode():
        number = (number * 37 + byte) & 0xFFFFFFFF
    return number


def hash_pair(first: Uint32Array, second: Uint32Array | np.uint32) -> Uint32Array:
    """Of two words, element by element."""
    start = np.uint32(0xDEADBEEF + (2 << 2) + 13)
    words = [first + start, np.broadcast_to(second, first.shape) + start, np.full(first.shape, start, np.uint32)]
    for step, turn in enumerate(_TURNS):
        changed, other = (2 + step) % 3, (1 + step) % 3
        words[changed] = (words[changed] ^ words[other]) - _turned(words[other], turn)
    return words[2]


def _turned(words: Uint32Array, bits: int) -> Uint32Array:
    return (words << np.uint32(bits)) | (words >> np.uint32(32 - bits))
