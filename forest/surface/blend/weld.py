"""Twigs welded into the surface they grow from.

A patch of triangles that is a disk is taken out of the host where the twig leaves it, and the rim
of the hole is joined to the twig's first ring by a strip of triangles. Every edge then still has
two faces, and neither a handle nor a part is added.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest._jit import njit
from forest.surface.blend.twigs import BLENDED, GROUND, Twigs

_Floats = NDArray[np.float64]

_CANDIDATES = 24  # triangles near a twig's exit that may be taken out
_PATCH = 64  # most triangles of a hole
_INNER = 0.15  # least weight of a corner in the middle of a triangle's hole
_FOOT = 0.9  # a hole's triangles have their corners within so many radii of the twig's axis


class Body(NamedTuple):
    """A surface that is being welded together; `used` counts points and triangles."""

    point: _Floats  # (room, 3)
    triangle: NDArray[np.int32]  # (room, 3)
    uv: _Floats  # (room, 3, 2) of the twigs' triangles
    ring: NDArray[np.int64]  # (room,) ring that a point belongs to; -1 on the blended surface
    dead: NDArray[np.bool_]  # (room,) triangles taken out
    owner: NDArray[np.int64]  # (room,) twig of a triangle; BLENDED
    link: NDArray[np.int64]  # (room,) next triangle left around holes of the same host; -1
    used: NDArray[np.int64]  # (2,)


def neighbours(triangles: NDArray[np.int32], points: int) -> NDArray[np.int32]:
    """Give the triangle beyond each edge (0-1, 1-2, 2-0) of each triangle, (m, 3)."""
    a = triangles.ravel().astype(np.int64)
    b = np.roll(triangles, -1, axis=1).ravel().astype(np.int64)
    order = np.argsort(np.minimum(a, b) * points + np.maximum(a, b), kind="stable")
    other = np.empty(len(order), np.int32)
    other[order[0::2]] = order[1::2] // 3
    other[order[1::2]] = order[0::2] // 3
    return other.reshape(-1, 3)


@njit
def _holds(triangle: Any, v: Any) -> Any:
    return triangle[0] == v or triangle[1] == v or triangle[2] == v


@njit
def _grow_patch(body: Any, beyond: Any, seed: Any, axis: Any, at: Any, radius: Any, patch: Any
                ) -> Any:  # fmt: skip
    """Grow a disk of triangles around a twig's exit; gives how many are in it."""
    patch[0] = seed
    n = np.int64(1)
    k = np.int64(0)
    while k < n and n < len(patch):
        for e in range(3):
            t = beyond[patch[k], e]
            if body.dead[t] or body.owner[t] != BLENDED:
                continue
            known = False
            shared = np.int64(0)
            for i in range(n):
                known = known or patch[i] == t
            if known:
                continue
            near = True
            for c in range(3):
                d = body.point[body.triangle[t, c]] - at
                h = np.sum(d * axis)
                near = near and np.sum(d * d) - h * h <= radius * radius and abs(h) < 3.0 * radius
                for i in range(n):
                    shared += np.int64(patch[i] == beyond[t, c])
            if not near:
                continue
            if shared == 1:  # its far corner must be new
                tip = np.int64(-1)
                for c in range(3):
                    v = body.triangle[t, c]
                    if not _holds(body.triangle[patch[k]], v):
                        tip = v
                fresh = True
                for i in range(n):
                    fresh = fresh and not _holds(body.triangle[patch[i]], tip)
                if not fresh:
                    continue
            patch[n] = t
            n += 1
            if n == len(patch):
                break
        k += 1
    return n


@njit
def _rim(body: Any, patch: Any, n: Any, start: Any, end: Any, loop: Any) -> Any:
    """Walk around a patch, anticlockwise seen from outside; gives the number of its edges."""
    m = 0
    for i in range(n):
        for e in range(3):
            a, b = body.triangle[patch[i], e], body.triangle[patch[i], (e + 1) % 3]
            inner = False
            for j in range(n):
                for g in range(3):
                    inner = inner or (
                        body.triangle[patch[j], g] == b
                        and body.triangle[patch[j], (g + 1) % 3] == a
                    )
            if not inner:
                start[m], end[m] = a, b
                m += 1
    loop[0] = start[0]
    here = end[0]
    for k in range(1, m):
        loop[k] = here
        for i in range(m):
            if start[i] == here:
                here = end[i]
                break
    return m


@njit
def _put(body: Any, a: Any, b: Any, c: Any, owner: Any) -> Any:
    t = body.used[1]
    body.triangle[t, 0], body.triangle[t, 1], body.triangle[t, 2] = a, b, c
    body.owner[t] = owner
    body.used[1] += 1
    return t


@njit
def _angle(twigs: Any, ring: Any, p: Any) -> Any:
    d = p - twigs.centre[ring]
    return np.arctan2(np.sum(d * twigs.across[ring, 1]), np.sum(d * twigs.across[ring, 0]))


@njit
def _uv(body: Any, twigs: Any, t: Any, c: Any, ring: Any, turn: Any, lift: Any) -> None:
    body.uv[t, c, 0] = turn * twigs.radius[ring]
    body.uv[t, c, 1] = twigs.along[ring] + lift


@njit
def _strip(body: Any, twigs: Any, q: Any, loop: Any, m: Any, base: Any) -> None:
    """Join the rim of a hole to a twig's first ring."""
    n = twigs.sides[q]
    ring = twigs.first[q]
    step = 2.0 * np.pi / n
    heading = np.empty(3)
    a, b = twigs.across[ring, 0], twigs.across[ring, 1]
    heading[0] = a[1] * b[2] - a[2] * b[1]
    heading[1] = a[2] * b[0] - a[0] * b[2]
    heading[2] = a[0] * b[1] - a[1] * b[0]
    turn = np.empty(m + 1)  # of the rim around the twig's axis, without jumps
    lift = np.empty(m + 1)
    turn[0] = _angle(twigs, ring, body.point[loop[0]])
    for k in range(m + 1):
        p = body.point[loop[k % m]]
        lift[k] = np.sum((p - twigs.centre[ring]) * heading)
        if k > 0:
            change = _angle(twigs, ring, p) - turn[k - 1]
            turn[k] = turn[k - 1] + change - 2.0 * np.pi * np.round(change / (2.0 * np.pi))
    first = np.int64(np.round(turn[0] / step))
    i: Any = np.int64(0)
    j: Any = np.int64(0)
    run: Any = np.int64(0)
    while i < m or j < n:
        on_rim: Any = j == n
        if i < m and j < n:
            p, r = body.point[loop[i]], body.point[base + (first + j) % n]
            ahead = body.point[loop[(i + 1) % m]] - r
            other = body.point[base + (first + j + 1) % n] - p
            on_rim = np.sum(ahead * ahead) <= np.sum(other * other)
            if run >= m - 1:  # a whole turn about one point would use an edge twice
                on_rim = False
            elif run <= 1 - n:
                on_rim = True
        here, there = loop[i % m], base + (first + j) % n
        if on_rim:
            t = _put(body, here, loop[(i + 1) % m], there, q)
            _uv(body, twigs, t, 1, ring, turn[i + 1], lift[i + 1])
            _uv(body, twigs, t, 0, ring, turn[i], lift[i])
            _uv(body, twigs, t, 2, ring, step * (first + j), 0.0)
            i += 1
            run = max(run, 0) + 1
        else:
            t = _put(body, base + (first + j + 1) % n, there, here, q)
            _uv(body, twigs, t, 0, ring, step * (first + j + 1), 0.0)
            _uv(body, twigs, t, 1, ring, step * (first + j), 0.0)
            _uv(body, twigs, t, 2, ring, turn[i], lift[i])
            j += 1
            run = min(run, 0) - 1


@njit
def _tube(body: Any, twigs: Any, q: Any, base: Any, closed: Any) -> None:
    """Add a twig's points, its sides, its tip, and its bottom where it stands alone."""
    n = twigs.sides[q]
    step = 2.0 * np.pi / n
    wide = np.sqrt(step / np.sin(step))  # so that the section has the circle's area
    low, high = twigs.first[q], twigs.first[q + 1]
    for ring in range(low, high):
        for j in range(n):
            c, s = np.cos(step * j), np.sin(step * j)
            k = body.used[0]
            around = c * twigs.across[ring, 0] + s * twigs.across[ring, 1]
            body.point[k] = twigs.centre[ring] + wide * twigs.radius[ring] * around
            body.ring[k] = ring
            body.used[0] += 1
    for ring in range(low, high - 1):
        a = base + (ring - low) * n
        for j in range(n):
            k = (j + 1) % n
            t = _put(body, a + j, a + k, a + n + k, q)
            _uv(body, twigs, t, 0, ring, step * j, 0.0)
            _uv(body, twigs, t, 1, ring, step * (j + 1), 0.0)
            _uv(body, twigs, t, 2, ring + 1, step * (j + 1), 0.0)
            t = _put(body, a + j, a + n + k, a + n + j, q)
            _uv(body, twigs, t, 0, ring, step * j, 0.0)
            _uv(body, twigs, t, 1, ring + 1, step * (j + 1), 0.0)
            _uv(body, twigs, t, 2, ring + 1, step * j, 0.0)
    for end in range(2 if closed else 1):
        ring = low if end else high - 1
        tip = body.used[0]
        body.point[tip] = twigs.centre[ring]
        body.ring[tip] = ring
        body.used[0] += 1
        a = base + (ring - low) * n
        for j in range(n):
            k = (j + 1) % n
            t = _put(body, a + k, a + j, tip, q) if end else _put(body, a + j, a + k, tip, q)
            _uv(body, twigs, t, 0, ring, step * (j + end), 0.0)
            _uv(body, twigs, t, 1, ring, step * (j + 1 - end), 0.0)
            _uv(body, twigs, t, 2, ring, step * (j + 0.5), 0.0)
            lift = -twigs.radius[ring] if end else twigs.radius[ring]
            body.uv[t, 2, 1] += lift


@njit
def _foot(body: Any, t: Any, p: Any, weight: Any) -> Any:
    """Squared distance of a point from a triangle, about, and the weights of its corners there."""
    a = body.point[body.triangle[t, 0]]
    u = body.point[body.triangle[t, 1]] - a
    v = body.point[body.triangle[t, 2]] - a
    w = p - a
    uu, vv, uv = np.sum(u * u), np.sum(v * v), np.sum(u * v)
    bottom = uu * vv - uv * uv
    if bottom <= 0.0:
        weight[:] = 1.0 / 3.0
    else:
        weight[1] = max((vv * np.sum(w * u) - uv * np.sum(w * v)) / bottom, 0.0)
        weight[2] = max((uu * np.sum(w * v) - uv * np.sum(w * u)) / bottom, 0.0)
        weight[0] = max(1.0 - weight[1] - weight[2], 0.0)
        weight /= np.sum(weight)
    away = weight[1] * u + weight[2] * v - w
    return np.sum(away * away)


@njit
def _pierce(body: Any, t: Any, p: Any, radius: Any, head: Any, loop: Any, weight: Any) -> None:
    """Cut a small triangle out of one, as wide as a twig; what is left can be pierced again."""
    _foot(body, t, p, weight)
    weight[:] = np.maximum(weight, _INNER)
    weight /= np.sum(weight)
    middle = np.zeros(3)
    uv = np.zeros(2)
    for c in range(3):
        middle += weight[c] * body.point[body.triangle[t, c]]
        uv += weight[c] * body.uv[t, c]
    size = 0.0
    for c in range(3):
        size = max(size, np.sqrt(np.sum((body.point[body.triangle[t, c]] - middle) ** 2)))
    share = min(max(1.5 * radius / max(size, 1e-12), 0.1), 0.6)
    body.dead[t] = True
    for c in range(3):
        k = body.used[0]
        body.point[k] = middle + share * (body.point[body.triangle[t, c]] - middle)
        body.ring[k] = body.ring[body.triangle[t, c]]
        body.used[0] += 1
        loop[c] = k
    for c in range(3):
        d = (c + 1) % 3
        outer, ahead = body.triangle[t, c], body.triangle[t, d]
        outer_uv, ahead_uv = body.uv[t, c], body.uv[t, d]
        near_uv, far_uv = uv + share * (outer_uv - uv), uv + share * (ahead_uv - uv)
        for half in range(2):
            if half == 0:
                k = _put(body, outer, ahead, loop[d], body.owner[t])
                body.uv[k, 0], body.uv[k, 1], body.uv[k, 2] = outer_uv, ahead_uv, far_uv
            else:
                k = _put(body, outer, loop[d], loop[c], body.owner[t])
                body.uv[k, 0], body.uv[k, 1], body.uv[k, 2] = outer_uv, far_uv, near_uv
            body.link[k] = head[body.owner[t]]
            head[body.owner[t]] = k


@njit
def _nearest_left(body: Any, first: Any, last: Any, left: Any, p: Any, weight: Any) -> Any:
    """Find the triangle of a host nearest to a point; -1 where it has none."""
    best: Any = np.inf
    seed: Any = np.int64(-1)
    for t in range(first, last):
        if not body.dead[t]:
            away = _foot(body, t, p, weight)
            if away < best:
                best, seed = away, np.int64(t)
    while left >= 0:
        if not body.dead[left]:
            away = _foot(body, left, p, weight)
            if away < best:
                best, seed = away, np.int64(left)
        left = body.link[left]
    return seed


@njit
def _weld(body: Any, twigs: Any, beyond: Any, near: Any, born: Any) -> Any:
    """Add all twigs, hosts first; gives how many found no place on their host."""
    patch, loop = np.empty(_PATCH, np.int64), np.empty(3 * _PATCH, np.int64)
    start, end = np.empty(3 * _PATCH, np.int64), np.empty(3 * _PATCH, np.int64)
    weight = np.empty(3)
    head = np.full(len(twigs.host) + 1, -1, np.int64)  # the last is the blended surface's
    lost = 0
    for q in range(len(twigs.host)):
        host = twigs.host[q]
        ring = twigs.first[q]
        place, radius = twigs.exit[q], twigs.radius[ring]
        seed, m = np.int64(-1), np.int64(0)
        if host == BLENDED:
            for t in near[q]:
                if t < len(beyond) and not body.dead[t]:
                    seed = t
                    break
            n = np.int64(0)
            if seed < 0:
                seed = _nearest_left(body, 0, 0, head[host], place, weight)
            else:
                axis = twigs.centre[ring + 1] - twigs.centre[ring]
                axis = axis / max(np.sqrt(np.sum(axis * axis)), 1e-12)
                n = _grow_patch(body, beyond, seed, axis, place, _FOOT * radius, patch)
            if n > 1:
                m = _rim(body, patch, n, start, end, loop)
                for i in range(n):
                    body.dead[patch[i]] = True
        elif host >= 0:
            seed = _nearest_left(body, born[host, 0], born[host, 1], head[host], place, weight)
        if seed >= 0 and m == 0:
            m = np.int64(3)
            _pierce(body, seed, place, radius, head, loop, weight)
        born[q, 0] = body.used[1]
        born[q, 1] = body.used[1]
        if m == 0 and host != GROUND:
            lost += 1
            continue
        base = body.used[0]
        _tube(body, twigs, q, base, host == GROUND)
        born[q, 1] = body.used[1]  # what grows on it leaves its foot alone
        if m > 0:
            _strip(body, twigs, q, loop, m, base)
    return lost


class Welded(NamedTuple):
    """The whole surface."""

    point: _Floats  # (n, 3)
    triangle: NDArray[np.int32]  # (m, 3)
    uv: _Floats  # (m, 3, 2); 0 on the blended surface
    ring: NDArray[np.int64]  # (n,) -1 on the blended surface
    blended: NDArray[np.bool_]  # (m,) whether a triangle is part of the blended surface
    lost: int  # twigs that found no place


def _middles(points: _Floats, triangles: NDArray[np.int32]) -> _Floats:
    a, b, c = triangles.T
    return np.asarray((points[a] + points[b] + points[c]) / 3.0)


def weld(points: _Floats, triangles: NDArray[np.int32], twigs: Twigs) -> Welded:
    """Add twigs to a closed surface."""
    count, rings = len(twigs.host), np.diff(twigs.first)
    if count == 0:
        ring, blended = np.full(len(points), -1, np.int64), np.ones(len(triangles), np.bool_)
        return Welded(points, triangles, np.zeros((len(triangles), 3, 2)), ring, blended, 0)
    room = int(len(points) + np.sum(twigs.sides * rings + 5))
    faces = int(len(triangles) + np.sum(2 * twigs.sides * rings + 2 * twigs.sides + _PATCH + 8))
    body = Body(
        point=np.empty((room, 3)),
        triangle=np.empty((faces, 3), np.int32),
        uv=np.zeros((faces, 3, 2)),
        ring=np.full(room, -1, np.int64),
        dead=np.zeros(faces, np.bool_),
        owner=np.full(faces, BLENDED, np.int64),
        link=np.full(faces, -1, np.int64),
        used=np.array([len(points), len(triangles)], np.int64),
    )
    body.point[: len(points)] = points
    body.triangle[: len(triangles)] = triangles
    near = np.zeros((count, 1), np.int64)
    beyond = np.zeros((0, 3), np.int32)
    if len(triangles):
        tree = cKDTree(_middles(points, triangles), balanced_tree=False, compact_nodes=False)
        k = min(_CANDIDATES, len(triangles))
        near = np.asarray(tree.query(twigs.exit, k=k)[1], np.int64).reshape(count, k)
        beyond = neighbours(triangles, len(points))
    lost = int(_weld(body, twigs, beyond, near, np.zeros((count, 2), np.int64)))
    used = slice(0, int(body.used[1]))
    alive = ~body.dead[used]
    triangle = body.triangle[used][alive]
    needed = np.zeros(int(body.used[0]), np.bool_)
    needed[triangle.ravel()] = True
    index = np.cumsum(needed) - 1
    return Welded(
        body.point[: len(needed)][needed],
        index[triangle].astype(np.int32),
        body.uv[used][alive],
        body.ring[: len(needed)][needed],
        body.owner[used][alive] == BLENDED,
        lost,
    )
