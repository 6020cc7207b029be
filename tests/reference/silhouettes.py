"""What lies at one point of bark: the slow twin of `forest.surface.bark.outlines`."""

from __future__ import annotations

import math

from forest.random import STREAM_DRESSING, uniforms
from forest.surface.bark.outlines import Relief
from forest.surface.bark.silhouettes import Silhouettes


def _cubic(ends: list[float], s: float) -> float:
    a, b, p, q = ends
    return (
        a * (1 + 2 * s) * (1 - s) ** 2 + p * s * (1 - s) ** 2
        + b * s * s * (3 - 2 * s) + q * s * s * (s - 1)
    )  # fmt: skip


def _steep(ends: list[float], s: float) -> float:
    h = 1e-6
    return (_cubic(ends, s + h) - _cubic(ends, s - h)) / (2 * h)


def _wave(
    relief: Relief, fracture: int, side: int, v: float, spacing: float, periods: int
) -> float:
    total = 0.0
    for octave in range(3):
        at = v / spacing * 2**octave
        k = math.floor(at)
        around = periods * 2**octave
        low, high = (k % around, (k + 1) % around) if around else (k, k + 1)
        a, b = (
            uniforms(relief.seed, STREAM_DRESSING, fracture, one + 1000000, 2 * octave + side)[0]
            for one in (low, high)
        )
        t = at - k
        total += 0.5 ** (octave + 1) * (2 * (a + (b - a) * (3 * t * t - 2 * t**3)) - 1)
    return total


def field_at(
    outlines: Silhouettes, relief: Relief, turn: float, v: float
) -> tuple[float, float, bool]:
    """Depth (m), turn on the epidermis, and whether a point lies in a fracture (first row)."""
    k = max(i for i in range(len(outlines.knots) - 1) if outlines.knots[i] <= v)
    height = outlines.knots[k + 1] - outlines.knots[k]
    s = (v - outlines.knots[k]) / height
    girth = outlines.girth[k] * (1 - s) + outlines.girth[k + 1] * s
    periods, spacing = 0, relief.fray_length
    if outlines.cyclic:
        periods = max(1, round(outlines.length / spacing))
        spacing = outlines.length / periods
    openings = []
    for i in range(outlines.offsets[k], outlines.offsets[k + 1]):
        centre, half = list(outlines.centre[i]), list(outlines.half[i])
        middle, wide = _cubic(centre, s), _cubic(half, s)
        if wide <= 0:
            continue
        low, high = outlines.epidermis[i]
        most = min(relief.fray[0] / girth, 0.8 * wide) if relief.fray[0] > 0 else 0.0
        fracture, at = int(outlines.fracture[i]), v - outlines.low
        left = middle - wide + most * _wave(relief, fracture, 0, at, spacing, periods)
        right = middle + wide + most * _wave(relief, fracture, 1, at, spacing, periods)
        lean, swell = _steep(centre, s), _steep(half, s)
        slants = [(lean + sign * swell) * girth / height for sign in (-1, 1)]
        cosines = [1 / math.sqrt(1 + slant**2) for slant in slants]
        full = relief.depth[0] * (
            1 - math.exp(-(right - left) * girth * relief.per_width[0] / relief.depth[0])
        )
        torn = low * (1 - s) + high * s
        # Moved by whole turns so that the left border lies in the turn up to the point.
        move = math.floor(turn - left)
        openings.append((left + move, right + move, cosines, torn + move, full))
    if not openings:
        shift = outlines.shift[k] * (1 - s) + outlines.shift[k + 1] * s
        return 0.0, turn + shift, False
    shoulder = relief.shoulder[0]
    hit = [one for one in openings if one[1] > turn]
    if hit:

        def sunk(one: tuple[float, float, list[float], float, float]) -> float:
            left, right, _, _, full = one
            way = min(min(turn - left, right - turn) / (0.5 * (right - left)), 1.0)
            return shoulder * full + (1 - shoulder) * full * way

        deepest = max(hit, key=sunk)
        return sunk(deepest), deepest[3], True
    before = max(openings, key=lambda one: one[1])
    following = min(openings, key=lambda one: one[0])
    right_border, next_left = before[1], following[0] + 1
    share = (turn - right_border) / (next_left - right_border)
    near = [
        before[4] * math.exp(-(turn - right_border) * girth * before[2][1] / relief.reach[0]),
        following[4] * math.exp(-(next_left - turn) * girth * following[2][0] / relief.reach[0]),
    ]
    torn = before[3] + share * (following[3] + 1 - before[3])
    return shoulder * max(near), torn, False
