"""Space colonization without buds: Runions, Lane and Prusinkiewicz 2007.

Every node of the tree may bear a new branch in any direction. It is what the bud-based trees of
Palubicki et al. 2009 are compared with in their Fig. 21a.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def colonize(
    markers: NDArray[np.float64],
    base: tuple[float, float, float],
    step_m: float,
    influence_m: float,
    kill_m: float,
    max_iterations: int = 1000,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Grow a branching structure into a cloud of attraction points.

    In each iteration every marker attracts the nearest node within `influence_m`; a node that is
    attracted gets a child one step towards the mean of the unit vectors to its markers; markers
    that have a node within `kill_m` are removed. Growth ends when no node attracts any marker,
    or when nodes would only be added where one stands already.

    Parameters
    ----------
    markers : float64 (n, 3)
        Attraction points, m.
    base : 3 floats
        The first node, m. While no marker is within reach, the trunk grows straight towards
        their centre.
    step_m, influence_m, kill_m : float
        Distance D between nodes, radius of influence d_i, kill distance d_k, m.

    Returns
    -------
    position : float64 (m, 3)
        Nodes, each parent before its children.
    parent : int64 (m,)
        Index of the parent; -1 for the base.
    """
    nodes = [np.array(base, float)]
    parents = [-1]
    free = np.array(markers, float)
    for _ in range(max_iterations):
        if len(free) == 0:
            break
        distance, nearest = cKDTree(np.array(nodes)).query(free)
        near = distance <= influence_m
        if not near.any():
            if len(nodes) > 1 and parents[-1] != len(nodes) - 2:
                break  # not a bare trunk any more: what is left is out of reach
            pull = {len(nodes) - 1: free.mean(axis=0) - nodes[-1]}
        else:
            pull = {}
            for m in np.flatnonzero(near & (distance > 0)):
                unit = (free[m] - nodes[nearest[m]]) / distance[m]
                pull[int(nearest[m])] = pull.get(int(nearest[m]), np.zeros(3)) + unit
        grown = 0
        for node in sorted(pull):
            length = np.linalg.norm(pull[node])
            if length < 1e-9:
                continue
            place = nodes[node] + step_m * pull[node] / length
            if np.min(np.linalg.norm(np.array(nodes) - place, axis=1)) < 1e-6 * step_m:
                continue  # two markers that hold a node in balance would add it for ever
            nodes.append(place)
            parents.append(node)
            grown += 1
        if grown == 0:
            break
        free = free[cKDTree(np.array(nodes)).query(free)[0] > kill_m]
    return np.array(nodes), np.array(parents, np.int64)
