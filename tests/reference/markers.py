"""Space colonization in plain Python, straight from Palubicki et al. 2009, section 4.1."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

STREAM_MARKER = 9
MASK = 0xFFFFFFFF
Point = tuple[float, float, float]


def philox(counter: Sequence[int], key: Sequence[int]) -> list[int]:
    """Ten rounds of Philox4x32 (Salmon et al. 2011) in plain integers."""
    x = [c & MASK for c in counter]
    k = [v & MASK for v in key]
    for _ in range(10):
        p0, p1 = 0xD2511F53 * x[0], 0xCD9E8D57 * x[2]
        x = [(p1 >> 32) ^ x[1] ^ k[0], p1 & MASK, (p0 >> 32) ^ x[3] ^ k[1], p0 & MASK]
        k = [(k[0] + 0x9E3779B9) & MASK, (k[1] + 0xBB67AE85) & MASK]
    return x


def marker_of_cell(seed: int, i: int, j: int, k: int, cell: Sequence[float]) -> Point:
    """The marker of one cell: four cells along x share a draw, 11 + 11 + 10 bits each."""
    word = philox((i // 4, j, k, STREAM_MARKER), (seed, seed >> 32))[i % 4]
    u = (word % 2048 + 0.5) / 2048
    v = (word // 2048 % 2048 + 0.5) / 2048
    w = (word // 2048**2 + 0.5) / 1024
    return ((i + u) * cell[0], (j + v) * cell[1], (k + w) * cell[2])


def inside(point: Point, shape: str, centre: Point, size: Point) -> bool:
    """Tell whether an envelope holds a point."""
    x, y, z = (2 * (p - c) / s for p, c, s in zip(point, centre, size, strict=True))
    if shape == "ellipsoid":
        return x * x + y * y + z * z <= 1
    if shape == "cylinder":
        return x * x + y * y <= 1 and abs(z) <= 1
    return max(abs(x), abs(y), abs(z)) <= 1


def living_buds(metamers, trees) -> list[dict]:
    """All buds, ordered by tree, metamer and kind, with absolute place and heading."""
    buds = []
    for row in range(len(trees.size)):
        for index in range(trees.size[row]):
            k = trees.start[row] + index
            tip = metamers.tip[k].astype(float)
            place = np.array([trees.x[row], trees.y[row], 0.0]) + tip
            base = np.zeros(3)
            if metamers.parent[k] >= 0:
                base = metamers.tip[trees.start[row] + metamers.parent[k]].astype(float)
            axis = tip - base
            along = (axis / math.sqrt(sum(axis**2))).astype(np.float32)
            for kind, bit, heading in ((0, 2, along), (1, 4, metamers.bud[k])):
                if metamers.state[k] & bit:
                    buds.append(
                        {
                            "row": row,
                            "metamer": index,
                            "kind": kind,
                            "rank": (row, metamers.serial[k], kind),
                            "species": trees.species[row],
                            "place": tuple(place),
                            "heading": tuple(heading.astype(float)),
                        }
                    )
    return buds


def images(place: Point, size: Sequence[float] | None, reach: float) -> list[Point]:
    """The places at which a bud is seen from inside a periodic plot."""
    if size is None:
        return [place]
    shifted = [
        [
            place[axis] + turn * size[axis]
            for turn in range(-20, 21)
            if -reach <= place[axis] + turn * size[axis] <= size[axis] + reach
        ]
        for axis in range(2)
    ]
    return [(x, y, place[2]) for y in shifted[1] for x in shifted[0]]


def claim(buds, markers: Sequence[Point], species, size: Sequence[float] | None):
    """Share the markers out.

    `species` is a list of (occupancy radius, perception distance, cosine of half the angle).

    Returns
    -------
    taken : set of int
        Markers in the occupancy zone of any bud.
    won : list of lists of int
        Markers of each bud.
    direction : list of 3-vectors
        The normalized sum of normalized vectors to them.
    """
    reach = max(max(s[0], s[1]) for s in species)
    taken = set()
    won: list[list[int]] = [[] for _ in buds]
    total = [np.zeros(3) for _ in buds]
    seen = [(b, p) for b, bud in enumerate(buds) for p in images(bud["place"], size, reach)]
    for m, marker in enumerate(markers):
        candidates = []
        for b, place in seen:
            rho, r, cosine = species[buds[b]["species"]]
            d = [q - p for p, q in zip(place, marker, strict=True)]
            distance = math.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
            if distance > reach:
                continue
            if distance <= rho:
                taken.add(m)
            h = buds[b]["heading"]
            along = d[0] * h[0] + d[1] * h[1] + d[2] * h[2]
            if distance <= r and along >= cosine * distance:
                candidates.append((distance, buds[b]["rank"], b, d))
        if candidates and m not in taken:
            distance, _, b, d = min(candidates, key=lambda c: c[:2])
            won[b].append(m)
            total[b] += np.array(d) / distance
    direction = [t / np.linalg.norm(t) if w else t for t, w in zip(total, won, strict=True)]
    return taken, won, direction
