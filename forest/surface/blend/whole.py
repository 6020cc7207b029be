"""A tree's blended surface as one closed mesh."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.surface.blend.cells import CELLS_IN_RADIUS, SLOPE, cells_near, check_memory, lattice_of
from forest.surface.blend.cones import sound
from forest.surface.blend.crossings import crossings
from forest.surface.blend.field import Blend
from forest.surface.blend.foot import Flare, usual_flare
from forest.surface.blend.limbs import Reaction, limbs_of
from forest.surface.blend.odd import refuse_buried, tell_gaps
from forest.surface.blend.polygonise import march
from forest.surface.blend.twigs import Twigs, twigs_of
from forest.surface.blend.unrolled import unroll
from forest.surface.blend.weld import Welded, weld
from forest.surface.frames import carry_frames
from forest.surface.mesh import Mesh
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]

READINGS = ("corrected", "paper")
#: Limbs thinner than this radius, in cells, are tubes.
THINNEST = 2.5
#: Usual cells are this part of the radius at the ground, but within these bounds, m.
_USUAL_PART, _USUAL_LEAST, _USUAL_MOST = 0.1, 0.001, 0.02
_TRIES = 5


class CrossingWarning(UserWarning):
    """Limbs cross or touch: the mesh is closed, but has handles."""


def usual_cell(skeleton: Skeleton) -> float:
    """Give the cell's width for a tree of this size, m."""
    skeleton = sound(skeleton)
    base = float(skeleton.radius[skeleton.parent < 0].max(initial=0.0))
    return float(np.clip(_USUAL_PART * base, _USUAL_LEAST, _USUAL_MOST))


def blend_of(
    skeleton: Skeleton,
    *,
    thinnest_m: float = 0.0,
    reaction: Reaction | None = None,
    flare: Flare | str | None = "usual",
    readings: str = "corrected",
) -> Blend:
    """Make the implicit function of a tree's surface.

    Parameters
    ----------
    skeleton : Skeleton
        The tree, whoever made it.
    thinnest_m : float
        Internodes thinner than this radius that bear none so thick are left out.
    reaction : Reaction, optional
        Reaction wood (eq. 31), e.g. of `reaction_wood`.
    flare : Flare, "usual" or None
        Root flare; the usual one is `Flare()` from a radius of 5 cm at the ground on.
    readings : "corrected" or "paper"
        Whether eq. 30 is mended (see docs/surfaces.md) or kept as printed.

    Raises
    ------
    InputError
        If the skeleton has no surface, or a word is unknown.
    """
    if readings not in READINGS:
        raise InputError(f"unknown readings {readings!r}, {nearest(readings, READINGS)}")
    skeleton = sound(skeleton)
    if isinstance(flare, str):
        if flare != "usual":
            raise InputError(f"unknown flare {flare!r}", expected="'usual', None or a Flare")
        flare = usual_flare(skeleton)
    if reaction is not None and len(reaction.reach_m) != int(skeleton.axis.max()) + 1:
        raise InputError(
            f"reaction wood of {len(reaction.reach_m)} axes",
            where="reaction",
            expected=f"that of the skeleton's {int(skeleton.axis.max()) + 1} axes",
        )
    limbs = limbs_of(
        skeleton,
        thinnest_m=thinnest_m,
        reaction=reaction,
        flare=None if flare is None else flare.columns(skeleton),
    )
    return Blend.of(limbs, printed=readings == "paper")


def blended(
    skeleton: Skeleton,
    *,
    cell_m: float | None = None,
    reaction: Reaction | None = None,
    flare: Flare | str | None = "usual",
    readings: str = "corrected",
    cells_in_radius: float = CELLS_IN_RADIUS,
    strict: bool = False,
) -> Mesh:
    """Make one closed mesh of a tree, its limbs blended where they branch.

    Parameters
    ----------
    skeleton : Skeleton
        The tree, whoever made it.
    cell_m : float, optional
        Width of the smallest cell, m; thicker limbs have cells up to a quarter of their radius, and
        what is thinner than two and a half cells in radius is a tube of few sides, welded in.
        Without it a tenth of the radius at the ground, but 1 mm to 2 cm.
    reaction : Reaction, optional
        Reaction wood, e.g. of `reaction_wood`.
    flare : Flare, "usual" or None
        Root flare; the usual one is `Flare()` from a radius of 5 cm at the ground on.
    readings : "corrected" or "paper"
        Whether eq. 30 is mended (see docs/surfaces.md) or kept as printed.
    cells_in_radius : float
        How many cells, at least, the radius of a thick limb is.
    strict : bool
        Whether to refuse limbs that start off their parent, cross away from a joint, or pass so
        near to each other that their surfaces merge; else they are warned of.

    Returns
    -------
    Mesh
        Closed, oriented outward, of one part per stem from the ground, with texture coordinates
        and `forest.surface.mesh.POINT_DATA` of the nearest limb.

    Raises
    ------
    InputError
        If the skeleton has no surface, a stem grows down from its base, the cells are too large
        for the tree or too small for the memory (said before anything is made), limbs cross, touch
        or start off their parent and `strict` is set, or the surface is not closed with cells of
        this width.

    Notes
    -----
    Hart & Baker 2003, sections 5.1 and 5.2, eqs 26 to 31.
    """
    skeleton = sound(skeleton)
    cell_m = usual_cell(skeleton) if cell_m is None else float(cell_m)
    if not (np.isfinite(cell_m) and cell_m > 0.0):
        raise InputError(f"a cell of {cell_m} m", where="cell_m", expected="a width above 0")
    thickest = float(skeleton.radius.max())
    if THINNEST * cell_m > thickest:
        raise InputError(
            f"the thickest internode has a radius of {thickest:.3g} m",
            where="cell_m",
            expected=f"cells of {thickest / THINNEST:.2g} m or less",
        )
    if not 1.0 <= cells_in_radius <= 50.0:
        raise InputError(f"{cells_in_radius}", where="cells_in_radius", expected="1 to 50")
    tell_gaps(skeleton, strict)
    blend = blend_of(
        skeleton,
        thinnest_m=THINNEST * cell_m,
        reaction=reaction,
        flare=flare,
        readings=readings,
    )
    refuse_buried(blend.limbs.cones)
    check_memory(blend.limbs.cones, cell_m, cells_in_radius)
    crossed = _tell_crossings(blend, strict)
    points, triangles, handles = _closed(blend, cell_m, cells_in_radius)
    if handles and not crossed:
        _tell_handles(handles, cell_m, strict)
    _, side = carry_frames(skeleton)
    twigs = twigs_of(skeleton, blend, side, cell_m)
    mesh = _dressed(skeleton, blend, weld(points, triangles, twigs), twigs, side)
    if not mesh.is_watertight:
        raise _open(mesh, cell_m)
    return mesh


def _tell_crossings(blend: Blend, strict: bool) -> bool:
    pairs = crossings(blend)
    if not len(pairs):
        return False
    first = ", ".join(f"{a} and {b}" for a, b in pairs[:3])
    text = f"{len(pairs)} pairs of axes cross away from their joints: {first}"
    if strict:
        raise InputError(text, where="skeleton", expected="axes that meet at joints alone")
    warnings.warn(text + "; the mesh has a handle at each", CrossingWarning, stacklevel=3)
    return True


def _tell_handles(handles: int, cell_m: float, strict: bool) -> None:
    """Tell of handles that no pair of crossing axes explains."""
    text = (
        f"the mesh has {'a handle' if handles == 1 else f'{handles} handles'}, though no axes "
        "cross: limbs pass within a cell of each other, or one comes back to itself"
    )
    if strict:
        raise InputError(text, where="cell_m", expected=f"cells below {cell_m:g} m")
    warnings.warn(f"{text}; cells below {cell_m:g} m may part them", CrossingWarning, stacklevel=3)


def _open(mesh: Mesh, cell_m: float) -> InputError:
    """Say where a mesh is open."""
    edges = mesh.edges()[~mesh.edges_with_two_faces()]
    if not len(edges):
        return InputError("nothing of the tree stands above its ground", where="skeleton.start")
    x, y, z = mesh.points[edges[0]].mean(axis=0)
    count = "an edge" if len(edges) == 1 else f"{len(edges)} edges, the first"
    return InputError(
        f"the surface stays open at {count} near {x:.3f}, {y:.3f}, {z:.3f} m",
        where="cell_m",
        expected=f"another width than {cell_m:g} m, as {0.7 * cell_m:.2g} m",
    )


def _closed(
    blend: Blend, cell_m: float, cells_in_radius: float
) -> tuple[_Floats, NDArray[np.int32], int]:
    """Polygonise; where cells were left out that the surface passes, look for more of them.

    Gives points, triangles, and how many handles they have.
    """
    lattice = lattice_of(blend.limbs.cones, cell_m, cells_in_radius)
    slope = SLOPE
    for _ in range(_TRIES):
        leaves = cells_near(blend, lattice, cells_in_radius, slope)
        points, triangles = march(blend, lattice, leaves)
        mesh = Mesh(points, triangles, np.zeros((0, 3, 2)))
        if mesh.is_watertight:
            return _wood_alone(blend, mesh)
        slope *= 1.6
    raise _open(mesh, cell_m)


def _wood_alone(blend: Blend, mesh: Mesh) -> tuple[_Floats, NDArray[np.int32], int]:
    """Drop hollows enclosed in the wood, and crumbs: one part stays per stem from the ground."""
    points, triangles, part = mesh.points, mesh.triangles, mesh.components()
    parts = int(part.max()) + 1
    if parts > 1:
        stems = int(np.sum(np.isfinite(blend.limbs.cones.ground)))
        a, b, c = (points[triangles[:, k]] - points.mean(axis=0) for k in range(3))
        volume = np.bincount(part, np.sum(a * np.cross(b, c), axis=1))
        stay = np.argsort(-volume, kind="stable")[: max(stems, 1)]
        stay = stay[volume[stay] > 0.0]
        triangles = triangles[np.isin(part, stay)]
        needed = np.zeros(len(points), np.bool_)
        needed[triangles.ravel()] = True
        points = points[needed]
        triangles = (np.cumsum(needed) - 1)[triangles].astype(np.int32)
        parts = len(stay)
    # Euler's formula of a closed mesh, which has three edges for two triangles.
    return points, triangles, parts - (len(points) - len(triangles) // 2) // 2


def _dressed(skeleton: Skeleton, blend: Blend, welded: Welded, twigs: Twigs, side: _Floats) -> Mesh:
    """Add texture coordinates and the arrays of points."""
    limb = welded.ring < 0
    found = blend.limb(welded.point[limb])
    internode = np.empty(len(welded.point), np.int64)
    radius = np.empty(len(welded.point))
    internode[limb] = blend.limbs.internode(found.axis, found.along)
    radius[limb] = found.radius
    internode[~limb] = twigs.internode[welded.ring[~limb]]
    radius[~limb] = twigs.radius[welded.ring[~limb]]
    own = np.zeros(len(welded.point), np.int64)
    own[limb] = found.cone
    uv = welded.uv
    unroll(blend.limbs, side, welded.point, own, welded.triangle, welded.blended, uv)
    return Mesh(
        welded.point,
        welded.triangle,
        uv,
        {
            "radius_m": radius.astype(np.float32),
            "order": skeleton.order[internode].astype(np.int32),
            "birth_year": skeleton.birth_year[internode].astype(np.int32),
            "tree_id": np.full(len(internode), skeleton.tree_id, np.int32),
            "axis": skeleton.axis[internode].astype(np.int32),
        },
    )
