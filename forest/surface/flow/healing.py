"""Wounds that heal: a pruned stub is overgrown over the years (Hart & Baker 2003, section 6.2).

The paper only names the wish; the law is our own and simple. Where cambium lives, the surface
moves outward by the year's ring. The cut face has none: a roll of woundwood closes over it from
its rim, `closing` times as fast as the wood at the rim grows (callus at a wound's rim grows faster
than the stem: Neely 1988). That wood is the stem's after a flush cut, so that a face of radius r
closes once the stem has grown by r / closing, and the dent above it is gone after twice that. A
stub feeds on its stem alone and grows slower than it, and so does its woundwood until the stem
has reached the face: protruding stubs stay open for longer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.surface.blend.field import Blend
from forest.surface.blend.limbs import limbs_of
from forest.surface.flow.cover import Cover, Near, around_limbs, cover, settle_cover
from forest.surface.flow.pruning import Wound
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]

#: Width of the rounding between stub and stem, times the stub's radius.
_COLLAR = 0.5
#: Step of differences, times the radius of the wound.
_STEP = 1e-5
_PROJECTIONS = 40
#: Points at which the face is looked at, per radius.
_FACE_ROWS = 24
_ROUNDS_A_YEAR = 12
#: Least rise of the stem's surface along the limb, per metre.
_FLATTEST = 0.1


@dataclass(frozen=True)
class WoundRules:
    """How a wound closes.

    Attributes
    ----------
    closing : float
        How far the woundwood closes in from the rim, times the growth of the wood at the rim.
    stub_growth : float
        Growth of the wood of the stub, times that of the stem, 0 to below 1; at 0 a stub does
        not close before the stem has swallowed it.
    """

    closing: float = 3.0
    stub_growth: float = 0.25


@dataclass(frozen=True)
class HealedYear:
    """A wounded stem after some years.

    Attributes
    ----------
    year : int
        Years since the cut.
    grown_m : float
        By how much the stem's radius has grown since.
    open_m2 : float
        Area of the face that is still open.
    roughness_deg : float
        Greatest angle, over the wound, between the surface and that of a stem without one.
    surface : WoundedStem
        The surface.
    cover : Cover
        Particles all over it.
    open : bool (n,)
        Which of them lie on the open face.
    """

    year: int
    grown_m: float
    open_m2: float
    roughness_deg: float
    surface: WoundedStem
    cover: Cover
    open: NDArray[np.bool_]


@dataclass(frozen=True)
class WoundedStem:
    """A stem with a wound, when its radius has grown by `grown_m` since the cut.

    Attributes
    ----------
    stem : Blend
        The tree without the limb, at the cut.
    wound : Wound
        The cut.
    rules : WoundRules
        How it closes.
    grown_m : float
        Growth of the stem's radius since, m.
    """

    stem: Blend
    wound: Wound
    rules: WoundRules
    grown_m: float = 0.0

    def _cut_frame(self, points: _Floats) -> tuple[_Floats, _Floats]:
        """Height of points above the face, and distance from its middle line."""
        away = points - self.wound.middle
        height = away @ self.wound.heading
        return height, np.linalg.norm(away - height[:, None] * self.wound.heading, axis=1)

    @property
    def closed_m(self) -> float:
        """How far the woundwood has come from the rim; farther than the radius fills the dent."""
        as_stub = min(self.grown_m, self.wound.protrusion_m)
        fed = self.rules.stub_growth * as_stub + (self.grown_m - as_stub)
        return self.rules.closing * fed

    def growth(self, points: _Floats) -> _Floats:
        """Give how far the stem's surface has moved outward at points (n,), m."""
        height, aside = self._cut_frame(points)
        radius, closed = self.wound.radius_m, self.closed_m
        rounded = np.hypot(aside, max(0.0, closed - radius))  # once closed, the dent fills
        behind = np.where(height > -0.5 * self.wound.stub_m, np.maximum(radius - rounded, 0.0), 0.0)
        share = np.minimum(behind / max(closed, _STEP * radius), 1.0)
        return np.asarray(self.grown_m * np.sqrt(1.0 - share**2))

    def _from_wood(self, points: _Floats, growth: _Floats) -> _Floats:
        """Distance from stem and stub of the year of the cut, less their growth."""
        if self.wound.flush:
            return np.asarray(self.stem.value(points) - growth)
        height, aside = self._cut_frame(points)
        radius = self.wound.radius_m
        out, up = aside - radius, height
        low = -self.wound.stub_m - height
        stub = np.where(
            (out > 0.0) & (up > 0.0), np.hypot(out, up), np.maximum(np.maximum(out, up), low)
        )
        stub -= self.rules.stub_growth * growth
        stem = self.stem.value(points) - growth
        width = _COLLAR * radius * np.clip(out / (0.5 * radius), 0.0, 1.0)
        near = np.maximum(1.0 - np.abs(stem - stub) / np.maximum(width, 1e-12), 0.0)
        return np.asarray(np.minimum(stem, stub) - 0.25 * width * near * near)

    def value(self, points: ArrayLike) -> _Floats:
        """Give about the distance from the surface (n,), m, negative inside."""
        points = np.asarray(points, np.float64).reshape(-1, 3)
        return self._from_wood(points, self.growth(points))

    def gradient(self, points: ArrayLike) -> _Floats:
        """Give the slope of `value` (n, 3)."""
        points = np.asarray(points, np.float64).reshape(-1, 3)
        return self._slope(points, None)

    def _slope(self, points: _Floats, growth: _Floats | None) -> _Floats:
        step = _STEP * self.wound.radius_m
        slope = np.empty_like(points)
        for k in range(3):
            ahead, back = points.copy(), points.copy()
            ahead[:, k] += step
            back[:, k] -= step
            if growth is None:
                slope[:, k] = self.value(ahead) - self.value(back)
            else:
                slope[:, k] = self._from_wood(ahead, growth) - self._from_wood(back, growth)
        return slope / (2.0 * step)

    def project(self, points: ArrayLike) -> _Floats:
        """Move points onto the surface, out of the wood of the year of the cut.

        The growth, which rises steeply at the rim of the woundwood, is held during each step.
        """
        points = np.array(points, np.float64).reshape(-1, 3)
        for k in range(_PROJECTIONS):
            growth = self.growth(points)
            off = self._from_wood(points, growth)
            if np.abs(off).max(initial=0.0) < 1e-7 * self.wound.radius_m:
                break
            slope = self._slope(points, growth)
            share = 1.0 if k < _PROJECTIONS // 2 else 0.5  # at a rim whole steps may swing
            points -= (share * off / np.maximum(np.sum(slope**2, axis=1), 0.25))[:, None] * slope
        return points

    def on_open_face(self, points: _Floats) -> NDArray[np.bool_]:
        """Tell which points of the surface lie on the face, with no wood grown over them."""
        height, aside = self._cut_frame(points)
        near = 0.01 * self.wound.radius_m
        bare = (aside < self.wound.radius_m) & (self.growth(points) <= 0.0)
        on_stem = np.abs(self.stem.value(points)) < near
        if self.wound.flush:
            return np.asarray(bare & on_stem & (height > -0.5 * self.wound.stub_m), np.bool_)
        on_face = (np.abs(height) < near) | (on_stem & (height > 0.0))
        return np.asarray(bare & on_face, np.bool_)

    def open_area(self) -> float:
        """Measure the part of the face above which no wood has grown, m2."""
        rows = np.arange(-_FACE_ROWS, _FACE_ROWS + 1) / _FACE_ROWS * self.wound.radius_m
        side, other = _across(self.wound.heading)
        u, v = (grid.ravel() for grid in np.meshgrid(rows, rows))
        within = np.hypot(u, v) < self.wound.radius_m
        face = self.wound.middle + u[within, None] * side + v[within, None] * other
        face, slant = self._down_to_wood(face)
        above = self.value(face + 1e-6 * self.wound.radius_m * self.wound.heading) > 0.0
        return float(np.pi * self.wound.radius_m**2 * slant[above].sum() / len(face))

    def _down_to_wood(self, points: _Floats) -> tuple[_Floats, _Floats]:
        """Move points of the cut's plane along the limb to where the stem's surface was.

        Of a stub only those that lay within the stem. Also gives the area (n,) of the surface
        there per area of the plane.
        """
        heading = self.wound.heading
        height = np.zeros(len(points))
        for _ in range(_PROJECTIONS):
            place = points + height[:, None] * heading
            rise = np.maximum(self.stem.gradient(place) @ heading, _FLATTEST)
            off = self.stem.value(place)
            height -= off / rise
            if np.abs(off).max() < 1e-9 * self.wound.radius_m:
                break
        on_stem = (height > 0.0) | self.wound.flush
        place = points + np.where(on_stem, height, 0.0)[:, None] * heading
        rise = np.maximum(_unit(self.stem.gradient(place)) @ heading, _FLATTEST)
        return place, np.where(on_stem, 1.0 / rise, 1.0)

    def roughness(self, points: _Floats, normals: _Floats) -> float:
        """Greatest angle between the surface over the wound and the bare stem, degrees."""
        _, aside = self._cut_frame(points)
        height = (points - self.wound.middle) @ self.wound.heading
        near = (aside < 1.5 * self.wound.radius_m) & (height > -0.5 * self.wound.stub_m)
        if not near.any():
            return 0.0
        bare = self.stem.gradient(points[near])
        bare /= np.linalg.norm(bare, axis=1, keepdims=True)
        cosine = np.clip(np.sum(bare * normals[near], axis=1), -1.0, 1.0)
        return float(np.degrees(np.arccos(cosine.min())))


def _across(heading: _Floats) -> tuple[_Floats, _Floats]:
    """Give two unit vectors at right angles to a direction and each other."""
    side = np.cross(heading, np.eye(3)[int(np.argmin(np.abs(heading)))])
    side = side / np.linalg.norm(side)
    return side, np.cross(heading, side)


def _on_stub(wound: Wound, spacing: float) -> _Floats:
    """Scatter points on the face and around the stub."""
    side, other = _across(wound.heading)
    points = [wound.middle]
    for radius in np.arange(0.5 * spacing, wound.radius_m, spacing):
        turn = np.arange(max(3, round(2.0 * np.pi * radius / spacing))) * (spacing / radius)
        points += [
            wound.middle + radius * (np.cos(a) * side + np.sin(a) * other)
            for a in turn[turn < 2.0 * np.pi]
        ]
    around = max(6, round(2.0 * np.pi * wound.radius_m / spacing))
    for back in np.arange(0.5 * spacing, wound.stub_m, spacing):
        points += [
            wound.middle
            - back * wound.heading
            + wound.radius_m * (np.cos(a) * side + np.sin(a) * other)
            for a in 2.0 * np.pi * np.arange(around) / around
        ]
    return np.array(points)


def heal(
    skeleton: Skeleton,
    wound: Wound,
    ring_widths_m: ArrayLike,
    *,
    rules: WoundRules | None = None,
    spacing_m: float | None = None,
    reach_m: float | None = None,
    seed: int = 0,
) -> list[HealedYear]:
    """Let a wound be overgrown, year by year, on a stem that is covered with particles.

    Parameters
    ----------
    skeleton : Skeleton
        The tree without the limb (see `prune`).
    wound : Wound
        The cut.
    ring_widths_m : float64 (years,)
        Width of each year's ring of the stem, m (from the table of rings, or assumed).
    rules : WoundRules, optional
        How it closes.
    spacing_m : float, optional
        Distance of particles, m; by default a fifth of the wound's radius.
    reach_m : float, optional
        How far around the wound, or what has grown over it, the surface is covered, m; by
        default three of its radii and as far as the stub stands out.
    seed : int
        Of the random numbers of splits.

    Returns
    -------
    list of HealedYear
        The cut itself, then each year.

    Raises
    ------
    InputError
        If a ring is negative, or a rule out of its range.
    """
    rules = rules or WoundRules()
    rings = np.asarray(ring_widths_m, np.float64).reshape(-1)
    if not (np.isfinite(rings).all() and (rings >= 0.0).all()):
        raise InputError("a ring's width is negative or not a number", where="ring_widths_m")
    if not (rules.closing > 0.0 and 0.0 <= rules.stub_growth < 1.0):
        raise InputError(
            f"closing {rules.closing:g}, stub_growth {rules.stub_growth:g}",
            where="rules",
            expected="closing above 0, stub_growth from 0 to below 1",
        )
    spacing = 0.2 * wound.radius_m if spacing_m is None else spacing_m
    stem = Blend.of(limbs_of(skeleton))
    out = max(float(stem.value(wound.middle)[0]), 0.0)
    reach = 3.0 * wound.radius_m + out if reach_m is None else reach_m
    near = Near(wound.middle, reach)
    surface = WoundedStem(stem, wound, rules)
    start = np.concatenate((around_limbs(stem, spacing, near), _on_stub(wound, spacing)))
    start = start[surface.value(start) > -0.5 * spacing]  # not within the wood
    particles = cover(stem, spacing, seed=seed, surface=surface, start=start, near=near)
    years = [_year(0, surface, particles)]
    for year, ring in enumerate(rings, start=1):
        surface = replace(surface, grown_m=surface.grown_m + float(ring))
        buried = max(surface.grown_m - wound.protrusion_m, 0.0)
        near = Near(wound.middle + buried * wound.heading, reach)
        moved = surface.project(particles.place)
        particles = settle_cover(
            surface,
            replace(particles, place=moved, normal=_unit(surface.gradient(moved))),
            seed=seed,
            rounds=_ROUNDS_A_YEAR,
            start=1000 * year,
            near=near,
        )
        years.append(_year(year, surface, particles))
    return years


def _unit(vectors: _Floats) -> _Floats:
    size = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return np.asarray(vectors / size)


def _year(year: int, surface: WoundedStem, particles: Cover) -> HealedYear:
    return HealedYear(
        year=year,
        grown_m=surface.grown_m,
        open_m2=surface.open_area(),
        roughness_deg=surface.roughness(particles.place, particles.normal),
        surface=surface,
        cover=particles,
        open=surface.on_open_face(particles.place),
    )
