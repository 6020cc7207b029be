"""Which axes a scene draws, one by one."""

from __future__ import annotations

from collections.abc import Sequence

from forest.trees.skeleton import Skeleton


def kept_axes(tree: Skeleton, shares: Sequence[float]) -> set[int]:
    """List the axes that are drawn: of each level the thickest, and only borne ones."""
    first: dict[int, int] = {}
    size: dict[int, int] = {}
    for i, axis in enumerate(tree.axis.tolist()):
        first.setdefault(axis, i)
        size[axis] = size.get(axis, 0) + 1
    kept: set[int] = set()
    for level in range(3):
        here = [a for a in sorted(first) if min(int(tree.order[first[a]]), 2) == level]
        here.sort(key=lambda a: -tree.radius[first[a]])
        left = shares[level] * sum(size[a] for a in here) + 0.5
        for axis in here:
            left -= size[axis]
            if left < 0.0:
                break
            kept.add(axis)
    for axis in sorted(first, key=lambda a: first[a]):
        base = int(tree.parent[first[axis]])
        if base >= 0 and int(tree.axis[base]) not in kept:
            kept.discard(axis)
    return kept
