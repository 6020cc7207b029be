"""What drives the bark: the girth of every strip over the years, and how it grows around (5.2)."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dendro.disc import centres, rays
from forest.dendro.turns import UP, shortest_turn
from forest.errors import InputError
from forest.record.wood import YearlyWood
from forest.surface.bark.axes import AxisPath, BarkedTree
from forest.surface.blend.foot import Flare
from forest.surface.mesh import Mesh

_Floats = NDArray[np.float64]

#: Sectors around the girth that may grow unevenly, and how finely each is measured.
GROWING = 24
_FINE = 4
_OUTLINE = GROWING * _FINE
_BREAST_HEIGHT_M = 1.3
_ROUNDEST = 1e-9  # m; outlines that differ less are the same


class GirthHistory(NamedTuple):
    """The girth of every strip over time, without bark.

    Attributes
    ----------
    times : float64 (rows,)
        Calendar years, or steps.
    girth : float64 (rows, strips)
        m; NaN before a strip is there. It never shrinks.
    dilatation : float64 (rows - 1, strips, sectors) or None
        How fast each sector around the girth stretches, relative to the others (from the seam).
    """

    times: _Floats
    girth: _Floats
    dilatation: _Floats | None

    def upto(self, time: float) -> GirthHistory:
        """Give the part of it that ends at some time.

        Raises
        ------
        InputError
            Nothing of the tree is on record by then.
        """
        rows = int(np.searchsorted(self.times, time, side="right"))
        if not rows:
            raise InputError(
                f"no girth at {time:g}", where="bark", expected=f"{self.times[0]:g} or later"
            )
        spread = None if self.dilatation is None else self.dilatation[: rows - 1]
        return GirthHistory(self.times[:rows], self.girth[:rows], spread)


def checked_history(history: GirthHistory, strips: int) -> GirthHistory:
    """Check that a history fits some strips: what growth itself does not check.

    Raises
    ------
    InputError
        Shapes that do not fit, times that do not rise, or a strip without a girth at the end.
    """
    times, girth = np.asarray(history.times, np.float64), np.asarray(history.girth, np.float64)
    rows = len(times)
    if times.ndim != 1 or rows < 2 or not np.all(np.diff(times) > 0.0):
        raise _refused("times that do not rise", "two or more that do")
    if girth.shape != (rows, strips):
        raise _refused(
            f"girths of {girth.shape}", f"({rows}, {strips}): a row a time, a column a strip"
        )
    there = np.isfinite(girth) & (girth > 0.0)
    if not there[-1].all():
        raise _refused(f"strip {int(np.argmin(there[-1]))} has no girth at the end", "metres")
    if np.any(np.diff(there.astype(np.int8), axis=0) < 0):
        raise _refused("a girth that ends", "one for every time from the first on")
    spread = history.dilatation
    if spread is not None:
        spread = np.asarray(spread, np.float64)
        if spread.ndim != 3 or spread.shape[:2] != (rows - 1, strips):
            raise _refused(f"dilatation of {spread.shape}", f"({rows - 1}, {strips}, sectors)")
    return GirthHistory(times, girth, spread)


def _refused(what: str, expected: str) -> InputError:
    return InputError(what, where="bark: history", expected=expected)


def recorded_girths(
    tree: BarkedTree, wood: YearlyWood, *, flare: Flare | None = None
) -> GirthHistory:
    """Give the girths that a sample tree's rings tell.

    Parameters
    ----------
    tree : BarkedTree
        Its strips, laid on the skeleton of the last year that counts.
    wood : YearlyWood
        The radii of this skeleton's internodes in all years on record, and how their rings lie.
    flare : Flare, optional
        Root flare: it widens the foot in proportion to the stem's radius at the ground, most
        along the buttresses.

    Returns
    -------
    GirthHistory
        A strip's radius runs straight from the middle of one internode to that of the next.
        Where rings are eccentric or roots bulge, the outlines of two years are linked by radial
        projection from the pith, and sectors grow unevenly.
    """
    if wood.radius.shape[1] != len(tree.skeleton):
        raise InputError("radii of another skeleton", where="bark", expected="its own")
    radius = np.full((len(wood.years), len(tree.geometry.axis)), np.nan)
    uneven = bool(np.any(wood.eccentricity != 0.0)) or flare is not None
    outlines = np.zeros((*radius.shape, _OUTLINE)) if uneven else None
    foot = None if flare is None else flare.columns(tree.skeleton)
    pith = centres(
        np.diff(wood.radius, axis=0, prepend=wood.radius[:1]),
        wood.eccentricity,
        wood.thick_side_deg,
    ) if uneven else None  # fmt: skip
    for path in tree.paths:
        strips = tree.strips_of(path.axis)
        v = tree.geometry.along[strips]
        for k, row in enumerate(wood.radius):
            radius[k, strips] = _radii(path, row[path.rows], v)
        radius[:, strips] = np.fmax.accumulate(radius[:, strips], axis=0)
        if outlines is not None and pith is not None:
            base = _base_radii(wood.radius, path)
            for k in range(len(wood.years)):
                shift = _strip_pith(path, pith[k, path.rows], v)
                reach = rays_of(np.nan_to_num(radius[k, strips]), shift)
                if foot is not None:
                    share = base[k] / max(base[-1], 1e-12)
                    reach += _flared(foot[path.axis], path, v, share)
                outlines[k, strips] = reach
    if outlines is None:
        return GirthHistory(wood.years.astype(np.float64), 2.0 * np.pi * radius, None)
    there = ~np.isnan(radius)
    girth = np.where(there, np.stack([perimeter(row) for row in outlines]), np.nan)
    girth = np.where(there, np.fmax.accumulate(girth, axis=0), np.nan)
    spread = np.stack(
        [radial_projection(a, b)[1] for a, b in pairwise(outlines)]
    ) if len(outlines) > 1 else np.ones((0, *radius.shape[1:], GROWING))  # fmt: skip
    return GirthHistory(wood.years.astype(np.float64), girth, spread)


def supposed_girths(tree: BarkedTree, years: int = 40) -> GirthHistory:
    """Give the girths of a finished tree as if every ring had been as wide (a girth law).

    The ring's width is the thickest strip's radius over the years, so that thinner wood is
    younger.
    """
    if years < 2:
        raise InputError(f"{years} years", where="bark", expected="2 or more")
    ring = float(_present_radius(tree).max()) / years
    times = np.arange(1.0, years + 1.0)
    return _of_even_rings(tree, times, ring * (years - times))


def measured_girths(tree: BarkedTree, years: _Floats, girth_m: _Floats) -> GirthHistory:
    """Give the girths of a finished tree whose stem was measured over the years.

    Rings are as wide all over the tree as at breast height, so that thinner wood is younger. The
    measured girth counts in proportion to the last: then the tree is as it stands now.

    Parameters
    ----------
    tree : BarkedTree
    years : float64 (rows,)
        Rising; two or more.
    girth_m : float64 (rows,)
        Girth at breast height, m, above 0 and never falling.

    Raises
    ------
    InputError
        If they are not so.
    """
    years, girth = np.asarray(years, np.float64), np.asarray(girth_m, np.float64)
    if years.ndim != 1 or years.shape != girth.shape or len(years) < 2:
        raise _refused(f"{years.shape} years, {girth.shape} girths", "two or more of both")
    if not np.all(np.diff(years) > 0.0):
        raise _refused("years that do not rise", "years that do")
    if not (np.all(np.isfinite(girth)) and girth[0] > 0.0 and np.all(np.diff(girth) >= 0.0)):
        raise _refused("girths that fall or are none", "metres, above 0")
    trunk = tree.paths[0]
    at = float(np.clip(_BREAST_HEIGHT_M, trunk.low, trunk.high))
    stem = float(trunk.radius_at(np.array([at]))[0])
    return _of_even_rings(tree, years, stem * (1.0 - girth / girth[-1]))


def _of_even_rings(tree: BarkedTree, times: _Floats, to_come: _Floats) -> GirthHistory:
    """Take off all strips the wood, m of radius, that is still to come at each time."""
    radius = _present_radius(tree) - to_come[:, None]
    ring = (to_come[0] - to_come[-1]) / (len(times) - 1)
    radius[radius <= 0.25 * ring] = np.nan  # not made yet
    return GirthHistory(times, 2.0 * np.pi * radius, None)


def present_girths(tree: BarkedTree) -> _Floats:
    """Girth of each strip now, m, without bark."""
    return np.asarray(2.0 * np.pi * _present_radius(tree), np.float64)


def _present_radius(tree: BarkedTree) -> _Floats:
    radius = np.empty(len(tree.geometry.axis))
    for path in tree.paths:
        strips = tree.strips_of(path.axis)
        radius[strips] = path.radius_at(tree.geometry.along[strips])
    return radius


def radial_projection(before: _Floats, after: _Floats) -> tuple[_Floats, _Floats]:
    """Link two outlines of strips by rays from the axis (5.2).

    Parameters
    ----------
    before, after : float64 (strips, corners)
        How far the outlines reach from the axis, m, along even angles from the seam; `corners` is
        a multiple of `GROWING`.

    Returns
    -------
    growth : float64 (strips)
        Ratio of the girths.
    dilatation : float64 (strips, GROWING)
        By which share each sector around the girth has stretched; ones where none did.
    """
    first, second = _arcs(before), _arcs(after)
    growth = second.sum(axis=1) / np.maximum(first.sum(axis=1), 1e-12)
    spread = np.maximum(second / np.maximum(first, 1e-12) - 1.0, 0.0)
    spread[(spread.max(axis=1) <= 0.0) | (first.sum(axis=1) < _ROUNDEST)] = 1.0
    return growth, spread


def linked_girths(
    tree: BarkedTree, shapes: list[Mesh] | list[_Floats], times: _Floats | None = None
) -> GirthHistory:
    """Give the girths of a tree whose shape is given at several times (5.2).

    Parameters
    ----------
    tree : BarkedTree
        Its strips; the axes are those about which shapes are linked by radial projection.
    shapes : list of Mesh, or of float64 (strips, corners)
        The surface at each time: a mesh around these axes, or how far it reaches from the axis
        of each strip, m, along even angles from the seam.
    times : float64 (shapes,), optional
        0, 1, ... unless given.

    Raises
    ------
    InputError
        Fewer than two shapes, one that does not go around the axes, or one that shrinks.
    """
    if len(shapes) < 2:
        raise InputError(f"{len(shapes)} shapes", where="bark", expected="two or more")
    outlines = [
        outlines_of(shape, tree) if isinstance(shape, Mesh) else np.asarray(shape, np.float64)
        for shape in shapes
    ]
    strips = len(tree.geometry.axis)
    for k, outline in enumerate(outlines):
        fits = outline.ndim == 2 and len(outline) == strips and outline.shape[1] % GROWING == 0
        if not fits or not outline.size or not np.all(np.isfinite(outline) & (outline > 0.0)):
            raise InputError(
                f"shape {k} of {outline.shape} is no outline of the strips",
                where="bark",
                expected=f"({strips}, a multiple of {GROWING}) m above 0",
            )
    girth = np.stack([perimeter(outline) for outline in outlines])
    if np.any(np.diff(girth, axis=0) < -1e-9):
        step, strip = (int(k[0]) for k in np.nonzero(np.diff(girth, axis=0) < -1e-9))
        raise InputError(
            f"shape {step + 1} is thinner than the one before at strip {strip}",
            where="bark",
            expected="shapes that grow",
        )
    girth = np.maximum.accumulate(girth, axis=0)
    spread = [radial_projection(a, b)[1] for a, b in pairwise(outlines)]
    at = np.arange(float(len(shapes))) if times is None else np.asarray(times, np.float64)
    return GirthHistory(at, girth, np.stack(spread))


def outlines_of(mesh: Mesh, tree: BarkedTree) -> _Floats:
    """Measure how far a surface reaches from the axes of strips, m, (strips, corners).

    Along each ray the nearest crossing of the mesh with the plane square to the axis counts.
    """
    found = np.full((len(tree.geometry.axis), _OUTLINE), np.inf)
    angle = 2.0 * np.pi * np.arange(_OUTLINE) / _OUTLINE
    out = np.column_stack((np.cos(angle), np.sin(angle)))
    for path in tree.paths:
        strips = tree.strips_of(path.axis)
        frames = path.frame(tree.geometry.along[strips])
        for strip, place, heading, side, across in zip(strips, *frames, strict=True):
            ends = _cut(mesh, place, heading, side, across)
            found[strip] = _nearest_crossings(ends, out)
    if not np.isfinite(found).all():
        strip = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
        raise InputError(
            f"the mesh does not go around the axis at strip {strip}",
            where="bark",
            expected="a closed surface around all strips",
        )
    return found


def _cut(
    mesh: Mesh, place: _Floats, heading: _Floats, side: _Floats, across: _Floats
) -> tuple[_Floats, _Floats]:
    """Cut a mesh by a plane: both ends of the pieces, in the plane's coordinates."""
    away = mesh.points - place
    above = away @ heading
    corner = above[mesh.triangles]
    here = mesh.triangles[(corner.min(axis=1) < 0.0) & (corner.max(axis=1) >= 0.0)]
    flat = np.column_stack((away @ side, away @ across))
    ends = []
    for j in range(3):
        a, b = here[:, j], here[:, (j + 1) % 3]
        crosses = (above[a] < 0.0) != (above[b] < 0.0)
        share = above[a] / np.where(crosses, above[a] - above[b], 1.0)
        at = flat[a] + share[:, None] * (flat[b] - flat[a])
        ends.append(np.where(crosses[:, None], at, np.nan))
    three = np.stack(ends, axis=1)
    crossed = ~np.isnan(three[:, :, 0])
    first = np.argmax(crossed, axis=1)
    last = 2 - np.argmax(crossed[:, ::-1], axis=1)
    row = np.arange(len(three))
    return three[row, first], three[row, last]


def _nearest_crossings(ends: tuple[_Floats, _Floats], out: _Floats) -> _Floats:
    """How far rays from the origin reach to the nearest of some pieces."""
    a, b = ends
    piece = b - a
    cross = out[:, None, 0] * piece[None, :, 1] - out[:, None, 1] * piece[None, :, 0]
    safe = np.where(np.abs(cross) > 1e-15, cross, np.inf)
    reach = (a[:, 0] * piece[:, 1] - a[:, 1] * piece[:, 0])[None] / safe
    share = (a[None, :, 0] * out[:, None, 1] - a[None, :, 1] * out[:, None, 0]) / safe
    hit = np.isfinite(safe) & (reach > 0.0) & (share >= -1e-9) & (share <= 1.0 + 1e-9)
    return np.asarray(np.where(hit, reach, np.inf).min(axis=1, initial=np.inf), np.float64)


def perimeter(reach: _Floats) -> _Floats:
    """Girth of outlines, (strips,): of a circle exactly, of others to within a part in 1000."""
    return np.asarray(_arcs(reach).sum(axis=1), np.float64)


def _arcs(reach: _Floats) -> _Floats:
    """Lengths of the sectors of outlines, (strips, GROWING); a circle's are those of its arcs."""
    reach = np.asarray(reach, np.float64)
    angle = 2.0 * np.pi / reach.shape[1]
    ahead = np.roll(reach, -1, axis=1)
    # (d reach)^2 + (reach d angle)^2: exact for circles about the axis.
    pieces = np.sqrt((ahead - reach) ** 2 + (0.5 * (ahead + reach) * angle) ** 2)
    return np.asarray(pieces.reshape(len(reach), GROWING, -1).sum(axis=2), np.float64)


def rays_of(radius: _Floats, shift: _Floats) -> _Floats:
    """How far circles whose centres are shifted reach from the pith, (strips, corners)."""
    angle = 2.0 * np.pi * np.arange(_OUTLINE) / _OUTLINE
    return rays(radius, shift, angle)


def _radii(path: AxisPath, radius: _Floats, v: _Floats) -> _Floats:
    """Radii of strips in a year; NaN beyond the axis' tip of that year."""
    made = int(np.argmin(radius > 0.0)) if np.any(radius <= 0.0) else len(radius)
    if not made:
        return np.full(len(v), np.nan)
    found = np.interp(v, path.middle[:made], radius[:made])
    return np.asarray(np.where(v <= path.v[made], found, np.nan), np.float64)


def _strip_pith(path: AxisPath, shift: _Floats, v: _Floats) -> _Floats:
    """Where the centres of outlines lie from the pith, in the frames of strips, m, (k, 2)."""
    i = path.internode(v)
    level = np.column_stack((shift[i], np.zeros(len(i))))
    turn = shortest_turn(UP, path.heading[i])
    leaning = np.einsum("kij,kj->ki", turn, level)
    across = np.cross(path.heading[i], path.side[i])
    x = np.sum(leaning * path.side[i], axis=1)
    return np.column_stack((x, np.sum(leaning * across, axis=1)))


def _base_radii(radius: _Floats, path: AxisPath) -> _Floats:
    """Radius of an axis at its base in each year, m."""
    return np.asarray(np.maximum.accumulate(radius[:, path.rows[0]]), np.float64)


def _flared(column: _Floats, path: AxisPath, v: _Floats, share: float) -> _Floats:
    """By how much root flare widens outlines, m, (strips, corners)."""
    height, widening, lobes, depth, phase = column
    height, widening = height * share, widening * share
    if height <= 0.0:
        return np.zeros((len(v), _OUTLINE))
    place, _, side, across = path.frame(v)
    angle = 2.0 * np.pi * np.arange(_OUTLINE) / _OUTLINE
    out = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * across[:, None]
    azimuth = np.arctan2(out[..., 1], out[..., 0])
    above = np.clip((place[:, 2] - path.place[0, 2]) / height, 0.0, 1.0)
    lobe = 1.0 - depth * 0.5 * (1.0 - np.cos(lobes * azimuth + phase))
    return np.asarray(widening * ((1.0 - above) ** 3)[:, None] * lobe, np.float64)
