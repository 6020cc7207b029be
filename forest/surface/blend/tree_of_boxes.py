"""A tree of boxes over cones or joints, walked without a stack.

Boxes are sorted along a Morton curve and put, four by four, into the leaves of a complete binary
tree: node n has children 2n and 2n + 1, the root is 1, leaf k is node `leaves + k`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import inlined

PER_LEAF = 4


class Boxes(NamedTuple):
    """A tree of boxes."""

    low: NDArray[np.float64]  # (nodes, 3); inf where there is nothing
    high: NDArray[np.float64]  # (nodes, 3)
    item: NDArray[np.int64]  # items, sorted
    leaves: NDArray[np.int64]  # (1,) how many leaves, a power of two


def _spread(number: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Put two zeros between the bits of numbers below 2^21."""
    x = number
    masks = (0x1F00000000FFFF, 0x1F0000FF0000FF, 0x100F00F00F00F00F, 0x10C30C30C30C30C3)
    for shift, mask in zip((32, 16, 8, 4), masks, strict=True):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return (x | (x << np.uint64(2))) & np.uint64(0x1249249249249249)


def morton(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Give each point's place on a Morton curve through the points' bounding box."""
    low = points.min(0)
    size = float(np.max(points.max(0) - low)) or 1.0
    cell = ((points - low) / size * (2**20)).astype(np.uint64)
    x, y, z = (_spread(cell[:, k]) for k in range(3))
    return np.asarray(x | (y << np.uint64(1)) | (z << np.uint64(2)), np.uint64)


def boxes_of(low: NDArray[np.float64], high: NDArray[np.float64]) -> Boxes:
    """Build the tree over boxes given by their corners, float64 (n, 3) each."""
    n = len(low)
    item = np.argsort(morton(0.5 * (low + high)), kind="stable") if n else np.zeros(0, np.int64)
    leaves = 1
    while leaves * PER_LEAF < n:
        leaves *= 2
    lower = np.full((2 * leaves, 3), np.inf)
    upper = np.full((2 * leaves, 3), -np.inf)
    for k in range(PER_LEAF):
        part = item[k::PER_LEAF]
        at = leaves + np.arange(len(part))
        lower[at] = np.minimum(lower[at], low[part])
        upper[at] = np.maximum(upper[at], high[part])
    for k in range(leaves - 1, 0, -1):
        lower[k] = np.minimum(lower[2 * k], lower[2 * k + 1])
        upper[k] = np.maximum(upper[2 * k], upper[2 * k + 1])
    return Boxes(lower, upper, item.astype(np.int64), np.array([leaves], np.int64))


@inlined
def _distance(boxes: Any, node: Any, x: Any, y: Any, z: Any) -> Any:
    """Distance of a point from a node's box; 0 within, inf where the box is empty."""
    dx = max(boxes.low[node, 0] - x, 0.0, x - boxes.high[node, 0])
    dy = max(boxes.low[node, 1] - y, 0.0, y - boxes.high[node, 1])
    dz = max(boxes.low[node, 2] - z, 0.0, z - boxes.high[node, 2])
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@inlined
def visit(boxes: Any, node: Any, x: Any, y: Any, z: Any, reach: Any) -> Any:
    """Take one step of a walk over what comes within reach of a point; it starts at node 1.

    Returns
    -------
    tuple
        First and one past the last of `boxes.item` to look at now, often none; and the node to
        visit next, 0 at the end. The reach may change on the way.
    """
    none = np.int64(0)
    leaves = boxes.leaves[0]
    near = _distance(boxes, node, x, y, z) <= reach
    if near and node < leaves:
        return none, none, 2 * node
    first = (node - leaves) * PER_LEAF if near else none
    last = min(first + PER_LEAF, len(boxes.item)) if near else none
    while node & 1:
        node >>= 1
    return first, last, node + 1 if node > 0 else node
