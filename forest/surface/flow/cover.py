"""A surface covered by particles that repel each other, split and die (Witkin & Heckbert 1994).

Hart & Baker (2003, section 6.2) would heal wounds by such a cover instead of the chain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest.errors import InputError
from forest.random import STREAM_BARK_FLOW, normals
from forest.surface.blend.field import Blend
from forest.surface.flow.surface import Surface

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

# Constants of Witkin & Heckbert 1994, section 4.
_AMPLITUDE = 6.0
_WANTED_ENERGY = 0.8 * _AMPLITUDE
_FEEDBACK = 15.0
_SOFTENING = 10.0
_STILL = 4.0
_TOUCHED = 0.2
_WIDEST = 1.2
_SPLITTING = 1.05  # a little above 1, lest even covers split for ever
_DYING = 0.7
_STEP = 0.03
_NEIGHBOURS = 3.0  # radii within which particles feel each other
#: Distance of neighbours in an even cover, times the radius of repulsion.
SPACING = 1.75
_ROUNDS = 100
#: A cover has settled when no particle moves by more than this share of the spacing.
_SETTLED = 0.02


@dataclass(frozen=True)
class Cover:
    """Particles all over a surface.

    Attributes
    ----------
    place : float64 (n, 3)
        m.
    normal : float64 (n, 3)
        Unit normals.
    radius_m : float64 (n,)
        Radius of repulsion of each; `SPACING` times it is about the distance of neighbours.
    number : int64 (n,)
        Lasting numbers; a split leaves the old one to one half.
    spacing_m : float
        The distance that was asked for.
    """

    place: _Floats
    normal: _Floats
    radius_m: _Floats
    number: _Ints
    spacing_m: float

    def __len__(self) -> int:
        """Count the particles."""
        return len(self.place)

    def only(self, which: NDArray[np.bool_]) -> Cover:
        """Keep some of the particles."""
        return replace(
            self,
            place=self.place[which],
            normal=self.normal[which],
            radius_m=self.radius_m[which],
            number=self.number[which],
        )

    def gaps(self, points: _Floats) -> _Floats:
        """Give the distance from points to the nearest particle, m."""
        return np.asarray(cKDTree(self.place).query(points)[0], np.float64)


def _normals(surface: Surface, points: _Floats) -> _Floats:
    slope = surface.gradient(points)
    return np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12))


def _repel(place: _Floats, radius: _Floats) -> tuple[_Floats, _Floats, _Floats]:
    """Sum over neighbours: velocity (n, 3), energy (n,), and how energy rises with radius (n,)."""
    n = len(place)
    reach = _NEIGHBOURS * float(radius.max())
    i, j = cKDTree(place).query_pairs(reach, output_type="ndarray").T
    order = np.lexsort((j, i))
    i, j = i[order], j[order]
    apart = place[i] - place[j]
    square = np.sum(apart**2, axis=1)
    of_i = _AMPLITUDE * np.exp(-square / (2.0 * radius[i] ** 2))
    of_j = _AMPLITUDE * np.exp(-square / (2.0 * radius[j] ** 2))
    pull = (of_i / radius[i] ** 2 + of_j / radius[j] ** 2)[:, None] * apart
    velocity = np.empty((n, 3))
    for k in range(3):
        velocity[:, k] = np.bincount(i, pull[:, k], n) - np.bincount(j, pull[:, k], n)
    velocity *= radius[:, None] ** 2
    energy = np.bincount(i, of_i, n) + np.bincount(j, of_j, n)
    rise = np.bincount(i, of_i * square, n) + np.bincount(j, of_j * square, n)
    return velocity, np.asarray(energy, np.float64), rise / radius**3


def _round(surface: Surface, cover: Cover, seed: int, serial: int) -> tuple[Cover, float]:
    """Move all particles once, split the lonely and take out the crowded; and how far they went."""
    wanted = cover.spacing_m / SPACING
    place, radius = cover.place, cover.radius_m
    velocity, energy, rise = _repel(place, radius)
    velocity -= np.sum(velocity * cover.normal, axis=1, keepdims=True) * cover.normal
    speed = np.linalg.norm(velocity, axis=1)
    step = _STEP * velocity
    size = _STEP * speed
    step *= np.minimum(1.0, 0.5 * radius / np.maximum(size, 1e-300))[:, None]
    moved = float(np.max(np.minimum(size, 0.5 * radius)) / wanted)
    place = surface.project(place + step)
    change = -_FEEDBACK * (energy - _WANTED_ENERGY) / (rise * wanted + _SOFTENING) * wanted
    radius = np.clip(radius + _STEP * change, 0.2 * wanted, 1.5 * wanted)
    still = speed < _STILL * radius
    settled = (energy > _TOUCHED * _WANTED_ENERGY) | (radius > _WIDEST * wanted)
    split = still & settled & (radius > _SPLITTING * wanted)
    chance = _uniform(seed, cover.number, serial)
    dies = still & (radius < _DYING * wanted) & (chance > radius / (_DYING * wanted))
    stays = ~dies
    fresh = np.flatnonzero(split & stays)
    away = _tangent_steps(seed, cover.number[fresh], serial, cover.normal[fresh])
    away *= 0.5 * radius[fresh][:, None]
    radius[fresh] /= math.sqrt(2.0)
    born = surface.project(place[fresh] + away)
    top = int(cover.number.max(initial=-1)) + 1
    place = np.concatenate((place[stays], born))
    result = replace(
        cover,
        place=place,
        normal=_normals(surface, place),
        radius_m=np.concatenate((radius[stays], radius[fresh])),
        number=np.concatenate((cover.number[stays], top + np.arange(len(fresh)))),
    )
    return result, moved if not (len(fresh) or dies.any()) else 1.0


def _uniform(seed: int, number: _Ints, serial: int) -> _Floats:
    draws = [normals(seed, STREAM_BARK_FLOW, 0, int(k), serial)[0] for k in number]
    return np.asarray([0.5 * math.erfc(-d / math.sqrt(2.0)) for d in draws], np.float64)


def _tangent_steps(seed: int, number: _Ints, serial: int, normal: _Floats) -> _Floats:
    """Draw unit steps along the surface."""
    draws = [
        (
            *normals(seed, STREAM_BARK_FLOW, 1, int(k), serial),
            normals(seed, STREAM_BARK_FLOW, 2, int(k), serial)[0],
        )
        for k in number
    ]
    step = np.array(draws, np.float64).reshape(-1, 3)
    step -= np.sum(step * normal, axis=1, keepdims=True) * normal
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9))


class Near(NamedTuple):
    """A ball: only what lies in it is covered."""

    middle: _Floats  # (3,)
    reach_m: float

    def holds(self, points: _Floats) -> NDArray[np.bool_]:
        """Tell which points lie in it."""
        away = np.linalg.norm(points - self.middle, axis=1)
        return np.asarray(away <= self.reach_m, np.bool_)


def around_limbs(blend: Blend, spacing: float, near: Near | None = None) -> _Floats:
    """Scatter points around the limbs, about as far apart as they shall be, on the surface."""
    cones = blend.limbs.cones
    points = [np.zeros((0, 3))]
    for k in range(len(cones.start)):
        if near is not None and not _may_hold(near, cones.start[k], cones.end[k], cones.low[k]):
            continue
        line = cones.end[k] - cones.start[k]
        length = float(np.linalg.norm(line))
        heading = line / length
        side = np.cross(heading, np.eye(3)[int(np.argmin(np.abs(heading)))])
        side /= np.linalg.norm(side)
        other = np.cross(heading, side)
        rows = max(1, round(length / spacing))
        for row in range(rows):
            t = (row + 0.5) / rows
            r = float(cones.low[k] + t * (cones.high[k] - cones.low[k]))
            around = max(3, round(2.0 * math.pi * r / spacing))
            turn = 2.0 * math.pi * (np.arange(around) + 0.5 * (row % 2)) / around
            ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
            points.append(cones.start[k] + t * line + r * ring)
    everywhere = np.concatenate(points)
    everywhere = everywhere[np.abs(blend.value(everywhere)) < spacing]  # not within other limbs
    if near is not None:
        everywhere = everywhere[near.holds(everywhere)]
    return blend.project(everywhere)


def _may_hold(near: Near, start: _Floats, end: _Floats, radius: float) -> bool:
    line = end - start
    t = float(np.clip(np.dot(near.middle - start, line) / np.dot(line, line), 0.0, 1.0))
    return float(np.linalg.norm(near.middle - start - t * line)) <= near.reach_m + 2.0 * radius


def settle_cover(
    surface: Surface,
    cover: Cover,
    *,
    seed: int = 0,
    rounds: int = _ROUNDS,
    start: int = 0,
    near: Near | None = None,
) -> Cover:
    """Let particles repel, split and die until they hardly move, at most `rounds` times.

    `start` numbers the rounds, so that later ones draw other numbers; what leaves `near` is lost.
    """
    for k in range(rounds):
        cover, moved = _round(surface, cover, seed, start + k)
        if near is not None:
            cover = cover.only(near.holds(cover.place))
        if moved < _SETTLED:
            break
    return cover


def cover(
    blend: Blend,
    spacing_m: float,
    *,
    seed: int = 0,
    rounds: int = _ROUNDS,
    surface: Surface | None = None,
    start: _Floats | None = None,
    near: Near | None = None,
) -> Cover:
    """Cover a whole surface with particles.

    Parameters
    ----------
    blend : Blend
        The tree, on whose limbs the first particles are put.
    spacing_m : float
        Wanted distance between neighbours, m.
    seed : int
        Of the random numbers of splits.
    rounds : int
        Most rounds of moving.
    surface : Surface, optional
        The surface to be covered, if it is not the tree's own (a wounded stem).
    start : float64 (n, 3), optional
        Where the first particles are, instead of all over the limbs; they split until the
        surface is covered if there are enough rounds.
    near : Near, optional
        A ball outside which nothing is covered.

    Returns
    -------
    Cover
        The particles.

    Raises
    ------
    InputError
        If the spacing is not above 0.
    """
    if not spacing_m > 0.0:
        raise InputError(f"{spacing_m:g} m", where="spacing_m", expected="a length above 0")
    surface = surface or blend
    if start is None:
        start = around_limbs(blend, spacing_m, near)
    place = surface.project(np.atleast_2d(start))
    first = Cover(
        place=place,
        normal=_normals(surface, place),
        radius_m=np.full(len(place), spacing_m / SPACING),
        number=np.arange(len(place)),
        spacing_m=spacing_m,
    )
    return settle_cover(surface, first, seed=seed, rounds=rounds, near=near)
