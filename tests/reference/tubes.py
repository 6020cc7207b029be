"""Tubes, slowly: nodes, which of them stand, and cross sections, from lists of points."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from forest.trees.skeleton import Skeleton

Vector = np.ndarray


class Node(NamedTuple):
    """A place on an axis, its radius, and the internode it belongs to."""

    place: Vector
    radius: float
    internode: int


def axes_of(skeleton: Skeleton, near: float) -> list[list[Node]]:
    """Give the nodes of each axis that has a length."""
    n = len(skeleton)
    followers: dict[int, int] = {}
    for i in range(n):
        p = int(skeleton.parent[i])
        if p >= 0 and skeleton.axis[p] == skeleton.axis[i]:
            followers.setdefault(p, i)
    found = []
    for head in sorted(set(range(n)) - set(followers.values())):
        chain = [head]
        while chain[-1] in followers:
            chain.append(followers[chain[-1]])
        radii = [float(skeleton.radius[i]) for i in chain]
        shared = [0.5 * (a + b) for a, b in pairwise(radii)]
        nodes = [Node(skeleton.start[head], radii[0], head)]
        p = int(skeleton.parent[head])
        if p >= 0:
            way = skeleton.end[p] - skeleton.start[p]
            square = way @ way
            t = (nodes[0].place - skeleton.start[p]) @ way / square if square else 0.0
            foot = skeleton.start[p] + min(max(t, 0.0), 1.0) * way
            if np.linalg.norm(foot - nodes[0].place) > near:
                nodes.insert(0, Node(foot, radii[0], head))
        for i, radius in zip(chain, [*shared, radii[-1]], strict=True):
            if np.linalg.norm(skeleton.end[i] - nodes[-1].place) > 1e-9:
                nodes.append(Node(skeleton.end[i], radius, i))
            else:
                nodes[-1] = nodes[-1]._replace(radius=radius)
        if len(nodes) > 1:
            found.append(nodes)
    return found


def thinned(nodes: list[Node], tolerance: float) -> list[Node]:
    """Leave out what lies near a cone between two others."""
    kept, a = [nodes[0]], 0
    while a < len(nodes) - 1:
        b = a + 1
        while b < len(nodes) - 1 and _near(nodes[a : b + 2], tolerance):
            b += 1
        kept.append(nodes[b])
        a = b
    return kept


def _near(run: list[Node], tolerance: float) -> bool:
    first, last = run[0], run[-1]
    way = last.place - first.place
    if np.linalg.norm(way) <= 1e-9:
        return False
    for node in run[1:-1]:
        t = min(max((node.place - first.place) @ way / (way @ way), 0.0), 1.0)
        off = float(np.linalg.norm(node.place - first.place - t * way))
        if off + abs(node.radius - (1 - t) * first.radius - t * last.radius) > tolerance:
            return False
    return True


def unfolded(nodes: list[Node]) -> list[Node]:
    """Leave out nodes whose cross sections cut their neighbours', from the base up."""
    nodes = list(nodes)
    k = 0
    while k < len(nodes) - 1:
        low, high = _reach(nodes, k, k), _reach(nodes, k + 1, k)
        here = _unit(nodes[k + 1].place - nodes[k].place)
        both = low + high
        both = both - (both @ here) * here
        clear = np.linalg.norm(both) < np.linalg.norm(nodes[k + 1].place - nodes[k].place)
        at_top = k + 1 == len(nodes) - 1
        out = k if at_top or (k > 0 and low @ low > high @ high) else k + 1
        if clear or out in (0, len(nodes) - 1) or _same(nodes[out - 1], nodes[out + 1]):
            k += 1
            continue
        del nodes[out]
        k = max(k - 1, 0)  # what is below may now fold
    return nodes


def _same(one: Node, other: Node) -> bool:
    return float(np.linalg.norm(one.place - other.place)) <= 1e-9


def _reach(nodes: list[Node], k: int, piece: int) -> Vector:
    """How far the inner edge of a mitre lies up its piece, as a vector to the inner side."""
    if k in (0, len(nodes) - 1):
        return np.zeros(3)
    before = _unit(nodes[k].place - nodes[k - 1].place)
    after = _unit(nodes[k + 1].place - nodes[k].place)
    cosine = min(max(float(before @ after), 1e-9 - 1.0), 1.0)  # one that turns back has no bend
    half = 0.5 * math.acos(cosine)
    bend = after - before
    across = bend - (bend @ _unit(before + after)) * _unit(before + after)
    return nodes[k].radius * math.tan(half) * _unit(across) / math.cos(half)


def _unit(v: Vector) -> Vector:
    length = float(np.linalg.norm(v))
    return v / length if length > 1e-12 else np.zeros(3)
