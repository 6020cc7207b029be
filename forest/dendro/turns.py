"""The shortest turns between directions in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

UP = np.array((0.0, 0.0, 1.0))


def unit(vectors: ArrayLike) -> NDArray[np.float64]:
    """Give vectors (..., 3) the length 1; what has no length points up."""
    v = np.asarray(vectors, np.float64)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.where(length > 0.0, v / np.where(length > 0.0, length, 1.0), UP))


def shortest_turn(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the matrices (..., 3, 3) that turn unit vectors into others the shortest way.

    Rodrigues' formula. Of the half turns between opposite directions it takes that about the
    axis across them that is nearest to x, or to y where they lie along x.
    """
    first, second = np.broadcast_arrays(first, second)
    axis = np.cross(first, second)
    cosine = np.sum(first * second, axis=-1)[..., None, None]
    cross = np.zeros((*axis.shape[:-1], 3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = (
        -axis[..., 2],
        axis[..., 1],
        -axis[..., 0],
    )
    cross -= np.swapaxes(cross, -1, -2)
    opposite = cosine < -1.0 + 1e-12
    turn = np.eye(3) + cross + cross @ cross / np.where(opposite, 1.0, 1.0 + cosine)
    along_x = np.abs(first[..., :1]) > 0.9
    near = np.where(along_x, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    across = near - np.sum(near * first, axis=-1, keepdims=True) * first
    across = across / np.linalg.norm(across, axis=-1, keepdims=True)
    half = 2.0 * across[..., :, None] * across[..., None, :] - np.eye(3)
    return np.asarray(np.where(opposite, half, turn))
