"""A stem cut by any plane, and the yearly surfaces that the plane cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.dendro.disc import outlines
from forest.dendro.knots import Knot, Plane
from forest.dendro.life import StemLife
from forest.dendro.turns import unit
from forest.errors import InputError

#: Corners of a surface around the stem.
AROUND = 72

_STEEP = 0.99  # a plane whose normal is nearer to the vertical has x and y as its coordinates


@dataclass(frozen=True)
class Section:
    """What a plane shows of a stem: the outlines of its yearly surfaces, and knots.

    Attributes
    ----------
    tree_id : int
    species : str
    plane : Plane
        `up` points as steeply up as the plane allows, `across` lies level to its right; in a
        nearly level plane they point along x and y.
    years : int64 (n,)
        Calendar years of the surfaces that the plane meets, oldest first.
    outlines : tuple of tuple of float64 (k, 2)
        For each of these years the closed outlines of the stem at its end, in the plane's
        coordinates, m; the longest first.
    knots : tuple of Knot
    """

    tree_id: int
    species: str
    plane: Plane
    years: NDArray[np.int64]
    outlines: tuple[tuple[NDArray[np.float64], ...], ...]
    knots: tuple[Knot, ...]


def plane_of(origin: ArrayLike, normal: ArrayLike) -> Plane:
    """Give a plane its coordinates; see `Section`.

    Raises
    ------
    InputError
        If a number is not finite, or the normal has no length.
    """
    point, square = (np.asarray(v, np.float64) for v in (origin, normal))
    if point.shape != (3,) or square.shape != (3,) or not np.isfinite([point, square]).all():
        raise InputError("is no plane", where="section", expected="an origin and a normal in x y z")
    if not square.any():
        raise InputError("the normal has no length", where="section", expected="a direction")
    square = unit(square)
    if abs(square[2]) > _STEEP:
        across = unit(np.cross(np.array((0.0, 1.0, 0.0)), square)) * np.sign(square[2])
    else:
        across = unit(np.cross(np.array((0.0, 0.0, 1.0)), square))
    return Plane(point, across, np.cross(square, across))


def section(life: StemLife, origin: ArrayLike, normal: ArrayLike) -> Section:
    """Cut a stem by a plane.

    Parameters
    ----------
    life : StemLife
        The stem.
    origin : (3,)
        A point on the plane, m, in the plot's coordinates.
    normal : (3,)
        A vector square to it, of any length.

    Raises
    ------
    InputError
        If that is no plane, or it misses the stem.
    """
    plane = plane_of(origin, normal)
    years, found = [], []
    for k, year in enumerate(life.years):
        loops = _loops(yearly_surface(life, k), plane)
        if loops:
            years.append(int(year))
            found.append(tuple(loops))
    if not found:
        raise InputError(
            f"the plane misses the stem of tree {life.tree_id}",
            where="section",
            expected="a plane near the line from "
            + " to ".join(
                "({:.1f}, {:.1f}, {:.1f})".format(*p) for p in (life.start[0], life.end[-1])
            ),
        )
    return Section(
        tree_id=life.tree_id,
        species=life.species,
        plane=plane,
        years=np.array(years, np.int64),
        outlines=tuple(found),
        knots=life.knots_in(plane),
    )


def yearly_surface(
    life: StemLife, k: int, *, over_bark: bool = False, to: int | None = None
) -> NDArray[np.float64]:
    """Give the stem's surface at the end of its k-th year as rows of points, (rows, AROUND, 3).

    The outline of each internode stands at its middle, the lowest also on the ground. The first
    row is the pith at the base and the last that at the top, so that the surface is closed; one
    cut off at internode `to` ends flat, with the outline of that internode.
    """
    count = int(np.count_nonzero(life.radius[k])) if to is None else to + 1
    radius = life.radius[k, :count] / (1.0 - life.bark_factor if over_bark else 1.0)
    flat = outlines(radius, life.centres[k, :count], AROUND)
    flat = np.concatenate((flat, np.zeros((count, AROUND, 1))), axis=2)
    round_pith = np.einsum("mij,maj->mai", life.turn[:count], flat)
    pith = 0.5 * (life.start + life.end)[:count]
    base, top = life.start[0], life.end[count - 1]
    rows = [np.broadcast_to(base, (1, AROUND, 3)), (base + round_pith[0])[None]]
    rows.append(pith[:, None] + round_pith)
    if to is not None:
        rows.append((top + round_pith[-1])[None])
    rows.append(np.broadcast_to(top, (1, AROUND, 3)))
    return np.concatenate(rows)


def _loops(surface: NDArray[np.float64], plane: Plane) -> list[NDArray[np.float64]]:
    """Cut a closed surface by a plane: outlines in the plane's coordinates."""
    from contourpy import LineType, contour_generator

    around = np.concatenate((surface, surface[:, :1]), axis=1)
    away = (around - plane.origin) @ plane.normal
    if away.min() > 0.0 or away.max() < 0.0:
        return []
    lines = contour_generator(z=away, line_type=LineType.Separate).lines(0.0)
    flat = plane.flat(around)
    return _joined([_at(flat, line) for line in lines])


def _at(flat: NDArray[np.float64], line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Read points between the rows and columns of a surface; each lies on a line of its mesh."""
    column, row = line.T
    i = np.minimum(row.astype(np.int64), flat.shape[0] - 2)
    j = np.minimum(column.astype(np.int64), flat.shape[1] - 2)
    s, t = (row - i)[:, None], (column - j)[:, None]
    lower = (1.0 - t) * flat[i, j] + t * flat[i, j + 1]
    upper = (1.0 - t) * flat[i + 1, j] + t * flat[i + 1, j + 1]
    return np.asarray((1.0 - s) * lower + s * upper)


def _joined(pieces: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Join pieces that end where the surface's seam and its two piths lie to closed outlines."""
    open_ = [piece for piece in pieces if len(piece) > 1]
    loops = []
    while open_:
        line = open_.pop()
        while open_:
            ends = np.array([[p[0], p[-1]] for p in open_])
            gap = np.linalg.norm(ends - line[-1], axis=2)
            if np.linalg.norm(line[0] - line[-1]) <= gap.min():
                break
            k, far = np.unravel_index(int(np.argmin(gap)), gap.shape)
            piece = open_.pop(int(k))
            line = np.concatenate((line, piece[::-1] if far else piece))
        line = line[np.concatenate(([True], np.any(np.diff(line, axis=0) != 0.0, axis=1)))]
        if len(line) > 1 and np.array_equal(line[0], line[-1]):
            line = line[:-1]
        if len(line) > 2:
            loops.append(line)
    return sorted(loops, key=lambda loop: -float(np.ptp(loop, axis=0).max()))
