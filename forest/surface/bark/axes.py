"""A tree's axes as curves with a direction across them, and the strips laid along them (5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.bark.branchings import passages
from forest.surface.bark.strips import StripGeometry
from forest.surface.frames import carry_frames
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]

#: Thinner wood has no fractures unless told: radius, m. "We only need to account for the main
#: branches since the epidermis of small branches is not fractured" (5.2).
LEAST_RADIUS_M = 0.03
#: Sectors around the girth in which strips differ in width.
SECTORS = 16
#: Strips that memory and patience bear.
MOST_STRIPS = 200_000
_NARROWEST = 0.2  # of a strip's width, on the concave side of a sharp bend
_FEWEST = 4  # strips of an axis
_SHORTEST = 1e-6  # m; internodes that have no direction


@dataclass(frozen=True, eq=False)
class AxisPath:
    """One axis, from the middle of its parent to its tip.

    Attributes
    ----------
    axis : int
        Its number in the skeleton.
    parent : int
        The axis that bears it; -1 for none.
    rows : int64 (n,)
        Its internodes in the skeleton, from the base.
    v : float64 (n + 1)
        Where they end, m along the axis; the first begins at 0.
    place : float64 (n + 1, 3)
        The same in space, m.
    heading, side : float64 (n, 3)
        Along each internode, and where its seam is; unit vectors.
    radius : float64 (n,)
        Of the wood, m.
    low, high : float
        What of it has strips, m.
    """

    axis: int
    parent: int
    rows: NDArray[np.int64]
    v: _Floats
    place: _Floats
    heading: _Floats
    side: _Floats
    radius: _Floats
    low: float
    high: float

    @property
    def middle(self) -> _Floats:
        """Where the middles of its internodes are, m along the axis, (n,)."""
        return 0.5 * (self.v[1:] + self.v[:-1])

    def internode(self, v: _Floats) -> NDArray[np.int64]:
        """Find the internode at some places along the axis."""
        found = np.searchsorted(self.v[1:-1], v, side="right")
        return np.asarray(found, np.int64)

    def radius_at(self, v: _Floats) -> _Floats:
        """Radius of the wood, m: straight from the middle of one internode to the next."""
        return np.asarray(np.interp(v, self.middle, self.radius), np.float64)

    def frame(self, v: _Floats) -> tuple[_Floats, _Floats, _Floats, _Floats]:
        """Give place, heading, the direction of the seam and that a quarter turn on, (k, 3)."""
        i = self.internode(v)
        place = self.place[i] + (v - self.v[i])[:, None] * self.heading[i]
        return place, self.heading[i], self.side[i], np.cross(self.heading[i], self.side[i])

    def points(self, v: _Floats, turn: _Floats, radius: _Floats) -> _Floats:
        """Give points at some distance from the axis, m; `turn` is counted from the seam."""
        place, _, side, across = self.frame(v)
        angle = 2.0 * np.pi * turn
        out = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * across
        return np.asarray(place + radius[:, None] * out, np.float64)

    def locate(self, points: _Floats) -> tuple[_Floats, _Floats, _Floats]:
        """Give v, turn and distance from the axis of points in space: of its nearest piece."""
        if not len(points):
            return np.empty(0), np.empty(0), np.empty(0)
        near = self._near(points)
        nearest = np.zeros(len(points), np.int64)
        least = np.full(len(points), np.inf)
        length = np.diff(self.v)
        for i in near:
            away = points - self.place[i]
            inside = np.clip(away @ self.heading[i], 0.0, length[i])
            foot = away - inside[:, None] * self.heading[i]
            square = np.einsum("pk,pk->p", foot, foot)
            nearest[square < least] = i
            np.minimum(least, square, out=least)
        away = points - self.place[nearest]
        along = np.einsum("pk,pk->p", away, self.heading[nearest])
        out = away - along[:, None] * self.heading[nearest]
        x = np.einsum("pk,pk->p", out, self.side[nearest])
        y = np.einsum("pk,pk->p", out, np.cross(self.heading[nearest], self.side[nearest]))
        v = self.v[nearest] + np.clip(along, 0.0, length[nearest])
        return v, np.mod(np.arctan2(y, x) / (2.0 * np.pi), 1.0), np.sqrt(least)

    def _near(self, points: _Floats) -> NDArray[np.int64]:
        """Find the internodes that one of some points may be nearest to."""
        centre = points.mean(axis=0)
        spread = float(np.linalg.norm(points - centre, axis=1).max())
        away = np.linalg.norm(self.place[:-1] - centre, axis=1)
        return np.flatnonzero(away - np.diff(self.v) <= away.min() + 2.0 * spread)


@dataclass(frozen=True, eq=False)
class BarkedTree:
    """A tree's main axes, and the strips on them.

    Attributes
    ----------
    skeleton : Skeleton
    paths : tuple of AxisPath
        The axes that have strips, the parent before the child.
    geometry : StripGeometry
    """

    skeleton: Skeleton
    paths: tuple[AxisPath, ...]
    geometry: StripGeometry

    def path(self, axis: int) -> AxisPath:
        """Give an axis by its number.

        Raises
        ------
        InputError
            It has no strips.
        """
        for path in self.paths:
            if path.axis == axis:
                return path
        known = ", ".join(str(path.axis) for path in self.paths[:8])
        raise InputError(f"axis {axis} has no bark strips", expected=f"one of {known}")

    def strips_of(self, axis: int) -> NDArray[np.int64]:
        """Rows of the strips of an axis, from its base."""
        return np.flatnonzero(self.geometry.axis == axis)


def lay_strips(
    skeleton: Skeleton,
    strip_m: float = 0.01,
    *,
    least_radius_m: float = LEAST_RADIUS_M,
    most_axes: int = 200,
) -> BarkedTree:
    """Lay strips along all axes that are thick enough.

    A branch's strips begin where its lower side comes out of its parent, and an axis' strips end
    where it gets thinner than `least_radius_m`. Where an axis bends, strips are narrower on the
    concave side (5.2).

    Parameters
    ----------
    skeleton : Skeleton
        Any tree.
    strip_m : float
        Width of strips, m; that of an axis is the nearest which divides it.
    least_radius_m : float
        Of the wood.
    most_axes : int
        If more are so thick, these many of the thickest.

    Returns
    -------
    BarkedTree

    Raises
    ------
    InputError
        No axis is so thick over four strips, a radius or place is no number, or there would be
        more than `MOST_STRIPS`.
    """
    if not strip_m > 0.0 or not least_radius_m > 0.0:
        raise InputError("strips of no width or radius", where="bark", expected="metres, above 0")
    if not len(skeleton):
        raise InputError(f"tree {skeleton.tree_id} has no internodes", expected="a tree with wood")
    for name, column in (
        ("radius", skeleton.radius),
        ("start", skeleton.start),
        ("end", skeleton.end),
    ):
        bad = np.flatnonzero(~np.isfinite(column).reshape(len(skeleton), -1).all(axis=1))
        if len(bad):
            raise InputError(
                f"internode {bad[0]} of tree {skeleton.tree_id} has a {name} that is no number",
                where="bark",
                expected="metres",
            )
    paths = _paths(skeleton, least_radius_m, strip_m)
    if not paths:
        raise _no_axis(skeleton, least_radius_m, strip_m)
    thickest = sorted(paths, key=lambda path: (path.axis != 0, -path.radius[0]))[:most_axes]
    kept = {path.axis for path in thickest}
    paths = [path for path in paths if path.axis in kept]
    counts = [max(round((path.high - path.low) / strip_m), _FEWEST) for path in paths]
    if sum(counts) > MOST_STRIPS:
        raise InputError(
            f"{sum(counts):,} strips", where="bark", expected=f"{MOST_STRIPS:,}: wider strips"
        )
    return BarkedTree(skeleton, tuple(paths), _geometry(paths, counts))


def _no_axis(skeleton: Skeleton, least: float, strip_m: float) -> InputError:
    """Say why no axis has strips: all wood is too thin, or what is thick enough too short."""
    thickest = float(skeleton.radius.max())
    if thickest < least:
        what = f"no wood thicker than a radius of {least:g} m"
        expected = f"a least radius below {thickest:.3g} m"
    else:
        what = f"no axis of a radius of {least:g} m over {_FEWEST} strips of {strip_m:g} m"
        expected = "narrower strips, or a smaller least radius"
    return InputError(f"tree {skeleton.tree_id} has {what}", where="bark", expected=expected)


def _paths(skeleton: Skeleton, least: float, strip_m: float) -> list[AxisPath]:
    heading, side = carry_frames(skeleton)
    order = np.argsort(skeleton.axis, kind="stable")
    numbers, first = np.unique(skeleton.axis[order], return_index=True)
    found: dict[int, AxisPath] = {}
    for axis, rows in zip(numbers, np.split(order, first[1:]), strict=True):
        if skeleton.radius[rows[0]] < least:
            continue
        rows = rows[skeleton.length[rows] > _SHORTEST]
        if not len(rows):
            continue
        base = int(skeleton.parent[rows[0]])
        bearer = int(skeleton.axis[base]) if base >= 0 else -1
        if base >= 0 and bearer not in found:
            continue  # a thick branch on a thin one
        v = np.concatenate(([0.0], np.cumsum(skeleton.length[rows])))
        place = np.vstack((skeleton.start[rows[:1]], skeleton.end[rows]))
        thin = np.flatnonzero(skeleton.radius[rows] < least)
        high = float(v[thin[0]]) if len(thin) else float(v[-1])
        path = AxisPath(
            axis=int(axis),
            parent=bearer,
            rows=rows.astype(np.int64),
            v=v,
            place=place,
            heading=heading[rows],
            side=side[rows],
            radius=skeleton.radius[rows].astype(np.float64),
            low=0.0,
            high=high,
        )
        low = 0.0 if base < 0 else _emerges(path, found[bearer])
        if high - low >= _FEWEST * strip_m:
            found[int(axis)] = AxisPath(**{**path.__dict__, "low": low})
    return list(found.values())


def _emerges(path: AxisPath, parent: AxisPath) -> float:
    """Where the first of a branch's surface comes out of its parent's, m along the branch.

    A fork's side shoot may start on the tip of its parent: it is out at once.
    """
    v = np.linspace(0.0, path.high, 200)
    turns = np.arange(SECTORS) / SECTORS
    for at in v:
        reach = np.full(SECTORS, float(path.radius_at(np.array([at]))[0]))
        points = path.points(np.full(SECTORS, at), turns, reach)
        along, _, distance = parent.locate(points)
        if np.any(distance > parent.radius_at(along)):
            return float(at)
    return path.high


def _geometry(paths: list[AxisPath], counts: list[int]) -> StripGeometry:
    axis, along, width, factor = [], [], [], []
    for path, count in zip(paths, counts, strict=True):
        step = (path.high - path.low) / count
        v = np.asarray(path.low + (np.arange(count) + 0.5) * step, np.float64)
        axis.append(np.full(count, path.axis, np.int32))
        along.append(v)
        width.append(np.full(count, step))
        factor.append(_factors(path, v, step))
    total = int(np.sum(counts))
    first = np.cumsum([0, *counts[:-1]])
    up = np.arange(1, total + 1, dtype=np.int32)
    up[first + np.array(counts) - 1] = -1
    down = np.arange(-1, total - 1, dtype=np.int32)
    down[first] = -1
    return StripGeometry(
        axis=np.concatenate(axis),
        along=np.concatenate(along),
        width=np.concatenate(width),
        neighbour_up=up,
        neighbour_down=down,
        width_around=np.concatenate(factor),
        crossings=passages(paths, [int(k) for k in first], counts),
    )


def _factors(path: AxisPath, v: _Floats, step: float) -> _Floats:
    """Width of strips around the girth, against that on the axis: 1 - r (curvature . outward).

    The curvature is that over the radius or a strip to both sides, whichever is more, so that the
    corners of a chain of internodes do not count as sharp bends.
    """
    radius = path.radius_at(v)
    span = np.maximum(2.0 * radius, step)
    low, high = np.clip(v - span, 0.0, path.v[-1]), np.clip(v + span, 0.0, path.v[-1])
    before, _, _, _ = path.frame(low)
    here, heading, side, across = path.frame(v)
    after, _, _, _ = path.frame(high)
    first, second = here - before, after - here
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    second /= np.maximum(np.linalg.norm(second, axis=1, keepdims=True), 1e-12)
    curvature = (second - first) / np.maximum(0.5 * (high - low), 1e-12)[:, None]
    curvature -= np.sum(curvature * heading, axis=1)[:, None] * heading
    angle = 2.0 * np.pi * (np.arange(SECTORS) + 0.5) / SECTORS
    x = np.sum(curvature * side, axis=1)[:, None] * np.cos(angle)
    y = np.sum(curvature * across, axis=1)[:, None] * np.sin(angle)
    factor = np.maximum(1.0 - radius[:, None] * (x + y), _NARROWEST)
    return np.asarray(factor / factor.mean(axis=1, keepdims=True), np.float64)
