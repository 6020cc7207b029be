"""Numbers that tell how trees stand, lean and bend, measured on skeletons and stands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import forest
from forest.trees.skeleton import Skeleton

FIGURES = Path(__file__).parents[1] / "scenarios" / "figures"
_TREE = "species.generic_deciduous"


def load(name: str, overrides: Sequence[str] = ()) -> forest.Scenario:
    """Read a figure's scenario; `overrides` starting with a dot are keys of its one species."""
    scenario = forest.Scenario.load(FIGURES / f"{name}.toml")
    return scenario.with_overrides([_TREE + o if o.startswith(".") else o for o in overrides])


def grow(name: str, overrides: Sequence[str] = (), years: Sequence[int] = ()) -> Iterator[Grown]:
    """Grow a figure's trees and give the stand in each of some years; default: the last."""
    scenario = load(name, overrides)
    stand = forest.Stand(scenario)
    for year in range(1, scenario.years + 1):
        stand.step()
        if year in years or (not years and year == scenario.years):
            yield Grown(year, stand, stand.skeleton(1))


class Grown(NamedTuple):
    """A stand in some year, and its first tree in summer."""

    year: int
    stand: forest.Stand
    tree: Skeleton


def headings(tree: Skeleton) -> NDArray[np.float64]:
    """Directions of the internodes, unit vectors, float64 (n, 3)."""
    return np.asarray((tree.end - tree.start) / tree.length[:, None])


def leans_deg(tree: Skeleton) -> NDArray[np.float64]:
    """Angle of each internode to the vertical, degrees, float64 (n,)."""
    return np.asarray(np.degrees(np.arccos(np.clip(headings(tree)[:, 2], -1.0, 1.0))))


def base_lean_deg(tree: Skeleton, height_m: float = 0.6) -> float:
    """Angle to the vertical of the line from the ground to the stem's point at `height_m` along it.

    The oldest wood: a younger tree's whole stem.
    """
    stem = np.flatnonzero(tree.axis == 0)
    along = np.cumsum(tree.length[stem])
    last = stem[min(int(np.searchsorted(along, height_m - 1e-3)), len(stem) - 1)]
    reach = tree.end[last] - tree.start[0]
    return float(np.degrees(np.arctan2(np.hypot(reach[0], reach[1]), reach[2])))


def thick_side(stand: forest.Stand, tree_id: int) -> tuple[float, float]:
    """Eccentricity of the last ring at the ground, and the azimuth of its thick side, degrees."""
    assert stand.mechanics is not None
    base = stand.rows.start[[stand.row_of(tree_id)]].astype(np.int64)
    eccentricity, azimuth = stand.mechanics.thick_sides(stand.arena, base)
    return float(eccentricity[0]), float(np.degrees(azimuth[0]))


def curvature(tree: Skeleton, axis: int = 0) -> NDArray[np.float64]:
    """Curvature of an axis in the vertical, rad/m, at its joints; negative: it bends down."""
    on = np.flatnonzero(tree.axis == axis)
    elevation = np.arcsin(np.clip(headings(tree)[on, 2], -1.0, 1.0))
    length = tree.length[on]
    return np.asarray(2.0 * np.diff(elevation) / (length[1:] + length[:-1]))


def inflections(rates: NDArray[np.float64], least: float = 0.005) -> NDArray[np.int64]:
    """Joints at which the curvature changes its sign, where it is more than `least` rad/m."""
    told = np.flatnonzero(np.abs(rates) > least)
    return np.asarray(told[1:][np.diff(np.sign(rates[told])) != 0.0], np.int64)


def s_share(tree: Skeleton, order: int = 1, least: int = 6) -> float:
    """Share of an order's axes of at least so many internodes that are S-shaped.

    That is: the lower third bends down, the upper third up.
    """
    axes, count = np.unique(tree.axis[tree.order == order], return_counts=True)
    rates = [curvature(tree, int(axis)) for axis in axes[count >= least]]
    return float(
        np.mean([r[: len(r) // 3].mean() < 0.0 < r[-(len(r) // 3) :].mean() for r in rates])
    )


def tip_height_m(tree: Skeleton) -> float:
    """Mean height of the tips of leafy twigs, m."""
    return float(tree.end[tree.leafy, 2].mean())


def lean_with_age(
    shapes: Sequence[Skeleton], orders: Sequence[int], later: int = 5
) -> tuple[float, float]:
    """Mean angle to the vertical of internodes in the year they grew, and of the same later on.

    Parameters
    ----------
    shapes : sequence of Skeleton
        A tree in successive years.
    orders : sequence of int
        Orders that count.
    later : int
        Years until they are looked at again.

    Returns
    -------
    young, old : float
        Degrees.
    """
    young, old = [], []
    for before, after in zip(shapes, shapes[later:], strict=False):
        _, k, same = np.intersect1d(before.serial, after.serial, return_indices=True)
        new = (before.birth_year[k] == before.birth_year.max()) & np.isin(before.order[k], orders)
        young.append(leans_deg(before)[k[new]])
        old.append(leans_deg(after)[same[new]])
    return float(np.concatenate(young).mean()), float(np.concatenate(old).mean())


def upper_share(tree: Skeleton, least_lean_deg: float = 20.0) -> float:
    """Share of the internodes on laterals that stand on the upper sides of leaning axes.

    A lateral counts with all that it bears, if its parent leans by `least_lean_deg` or more.
    """
    size = np.ones(len(tree))
    for i in range(len(tree) - 1, 0, -1):
        size[tree.parent[i]] += size[i]
    born = np.flatnonzero(tree.parent >= 0)
    born = born[tree.axis[born] != tree.axis[tree.parent[born]]]
    born = born[leans_deg(tree)[tree.parent[born]] >= least_lean_deg]
    way = headings(tree)
    above = tree.parent[born]
    aside = way[born] - (way[born] * way[above]).sum(axis=1, keepdims=True) * way[above]
    return float(size[born][aside[:, 2] > 0.0].sum() / size[born].sum())
