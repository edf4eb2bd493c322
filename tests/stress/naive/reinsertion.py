"""Moves nodes in a tree without checking their subtrees."""

from __future__ import annotations

from .tree import Node


def rings_per_million(root: Node) -> float:
    """Of a million moves of any node to any place, those that put it below itself, where it is unreachable."""
    sizes: list[int] = []
    total = _count(root, sizes)
    return 1e6 * sum(size - 1 for size in sizes[:-1]) / ((total - 1) * (total - 1))


def _count(node: Node, sizes: list[int]) -> int:
    """Nodes of the subtree; `sizes` gets that of each node in it, the root's last."""
    size = 1 + sum(_count(child, sizes) for child in node.children)
    sizes.append(size)
    return size
