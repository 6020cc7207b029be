"""The architecture of trees as numbers, to set simulated trees beside measured ones.

Palubicki et al. (2009, section 7.3) propose to validate self-organizing trees by "a comparison of
bud fates, and the distribution of branches in the models, with measurements of real trees".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.interop.cylinders import UNKNOWN_YEAR
from forest.trees.skeleton import Skeleton

if TYPE_CHECKING:
    import pandas as pd

#: What became of the lateral bud of a node.
FATES = ("grown", "living", "dead")

#: The quantities of an axis whose distributions are compared.
QUANTITIES = ("length_m", "angle_deg", "laterals_per_m")


def axes_of(skeletons: Sequence[Skeleton]) -> pd.DataFrame:
    """Measure every axis of some trees.

    Parameters
    ----------
    skeletons : sequence of Skeleton
        Simulated trees, or measured ones.

    Returns
    -------
    pandas.DataFrame
        A row per tree and axis:

        * ``tree`` (place in the sequence), ``tree_id``, ``species``, ``axis``, ``order``
        * ``length_m``: along the axis
        * ``angle_deg``: between its first internode and the one that bears it; NaN for the trunk
          and where an internode has no length
        * ``base_radius_m``: radius of its first internode
        * ``nodes``: where the axis goes on after an internode
        * ``grown``, ``living``, ``dead``: nodes whose lateral bud made a branch that still stands;
          lives; or died, or lost its branch. NaN for the last two where nobody knows: a measured
          tree shows branches, not buds (see `forest.interop.cylinders.UNKNOWN_YEAR`)
        * ``laterals_per_m``: branches that it bears per metre of its length

        An axis' last node is not counted among the fates, since its living site may be the
        terminal bud. Cylinders of a measured tree are not internodes: shares of nodes compare
        only trees that were cut at their nodes, ``laterals_per_m`` all.

    Raises
    ------
    InputError
        If there are no trees.
    """
    import pandas as pd

    frames = [_axes(skeleton).assign(tree=k) for k, skeleton in enumerate(skeletons)]
    if not frames:
        raise InputError("no trees to measure", expected="at least one skeleton")
    frame = pd.concat(frames, ignore_index=True)
    return frame[["tree", *(name for name in frame.columns if name != "tree")]]


def bud_fates(axes: pd.DataFrame) -> pd.DataFrame:
    """Sum the fates of lateral buds by order.

    Parameters
    ----------
    axes : DataFrame
        From `axes_of`.

    Returns
    -------
    pandas.DataFrame
        A row per order and fate: ``order``, ``fate``, ``nodes`` with this fate, and their
        ``share`` of the nodes of those trees where the fate is known.
    """
    rows = []
    for order, group in axes.groupby("order"):
        for fate in FATES:
            known = group[group[fate].notna()]
            nodes, with_fate = int(known["nodes"].sum()), int(known[fate].sum())
            share = with_fate / nodes if nodes else np.nan
            rows.append((order, fate, with_fate, share))
    return _frame(rows, ("order", "fate", "nodes", "share"))


def orders(sets: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Count the branches of each order.

    Parameters
    ----------
    sets : mapping of name to DataFrame
        Axes from `axes_of`; the trunks (order 0) are no branches.

    Returns
    -------
    pandas.DataFrame
        A row per set and order: ``set``, ``order``, ``branches``, ``per_tree``, ``share`` of the
        set's branches, and their share of its branches' length, ``length_share``.
    """
    rows = []
    for name, axes in sets.items():
        trees = axes["tree"].nunique()
        branches = axes[axes["order"] > 0]
        length = branches["length_m"].sum()
        for order, group in branches.groupby("order"):
            n = len(group)
            of_length = group["length_m"].sum() / length if length > 0.0 else np.nan
            rows.append((name, order, n, n / trees, n / len(branches), of_length))
    return _frame(rows, ("set", "order", "branches", "per_tree", "share", "length_share"))


def distributions(sets: Mapping[str, pd.DataFrame], bins: int = 20) -> pd.DataFrame:
    """Tabulate how the quantities of axes are distributed in each order.

    Parameters
    ----------
    sets : mapping of name to DataFrame
        Axes from `axes_of`.
    bins : int
        Number of classes; all sets have the same, from 0 to the largest value of the order.

    Returns
    -------
    pandas.DataFrame
        A row per set, quantity, order and class: ``set``, ``quantity``, ``order``, ``low``,
        ``high``, ``axes``, and their ``share`` of the set's axes of the order.
    """
    rows = []
    for quantity, order, values in _values(sets):
        top = max(float(v.max()) for v in values.values())
        edges = np.linspace(0.0, top if top > 0.0 else 1.0, bins + 1)
        for name, found in values.items():
            counts = np.histogram(found, edges)[0]
            for low, high, n in zip(edges[:-1], edges[1:], counts, strict=True):
                rows.append((name, quantity, order, low, high, int(n), n / len(found)))
    return _frame(rows, ("set", "quantity", "order", "low", "high", "axes", "share"))


def distances(one: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    """Measure how far two sets of trees are apart in each order.

    Parameters
    ----------
    one, other : DataFrame
        Axes from `axes_of`.

    Returns
    -------
    pandas.DataFrame
        A row per quantity and order that both have: ``quantity``, ``order``, ``n_one``,
        ``n_other``, the medians ``median_one`` and ``median_other``, and ``distance``, the
        largest difference of the two cumulative shares (Kolmogorov-Smirnov; 0 alike, 1 apart).
    """
    rows = []
    for quantity, order, values in _values({"one": one, "other": other}):
        if len(values) == 2:
            a, b = values["one"], values["other"]
            medians = (float(np.median(a)), float(np.median(b)))
            rows.append((quantity, order, len(a), len(b), *medians, _apart(a, b)))
    return _frame(
        rows,
        ("quantity", "order", "n_one", "n_other", "median_one", "median_other", "distance"),
    )


def _axes(tree: Skeleton) -> pd.DataFrame:
    import pandas as pd

    parent, axis, length = tree.parent, tree.axis, tree.length
    n = int(axis.max()) + 1
    first = np.full(n, len(tree))
    np.minimum.at(first, axis, np.arange(len(tree)))
    starts = np.zeros(len(tree), np.bool_)
    starts[first] = True
    goes_on = np.zeros(len(tree), np.bool_)
    goes_on[parent[~starts]] = True
    branched = np.zeros(len(tree), np.bool_)
    branched[parent[starts & (parent >= 0)]] = True

    def count(internodes: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.bincount(axis[internodes], minlength=n).astype(np.float64)

    known = bool((tree.birth_year != UNKNOWN_YEAR).any())
    along = np.bincount(axis, weights=length, minlength=n)
    with np.errstate(invalid="ignore", divide="ignore"):
        laterals = np.where(along > 0.0, count(branched) / along, np.nan)
    return pd.DataFrame(
        {
            "tree_id": tree.tree_id,
            "species": tree.species,
            "axis": np.arange(n),
            "order": tree.order[first],
            "length_m": along,
            "angle_deg": _angles(tree, first),
            "base_radius_m": tree.radius[first],
            "nodes": count(goes_on).astype(np.int64),
            "grown": count(goes_on & branched),
            "living": count(goes_on & ~branched & tree.leafy) if known else np.nan,
            "dead": count(goes_on & ~branched & ~tree.leafy) if known else np.nan,
            "laterals_per_m": laterals,
        }
    )


def _angles(tree: Skeleton, first: NDArray[np.int64]) -> NDArray[np.float64]:
    """Angle between each axis' first internode and the one that bears it, degrees."""
    bearer = tree.parent[first]
    along = tree.end - tree.start
    with np.errstate(invalid="ignore", divide="ignore"):
        along = along / tree.length[:, None]
    cosine = (along[first] * along[bearer]).sum(axis=1)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.where(bearer >= 0, angle, np.nan)


def _values(
    sets: Mapping[str, pd.DataFrame],
) -> list[tuple[str, int, dict[str, NDArray[np.float64]]]]:
    """List each quantity and order with the values of the sets that have any."""
    found = []
    highest = max(int(axes["order"].max()) for axes in sets.values())
    for quantity in QUANTITIES:
        for order in range(highest + 1):
            values = {}
            for name, axes in sets.items():
                column = axes.loc[axes["order"] == order, quantity].dropna().to_numpy()
                if len(column):
                    values[name] = column
            if values:
                found.append((quantity, order, values))
    return found


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Kolmogorov and Smirnov's distance of two samples."""
    at = np.concatenate([a, b])
    share_a = np.searchsorted(np.sort(a), at, side="right") / len(a)
    share_b = np.searchsorted(np.sort(b), at, side="right") / len(b)
    return float(np.abs(share_a - share_b).max())


def _frame(rows: Sequence[tuple[object, ...]], columns: tuple[str, ...]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(list(rows), columns=list(columns))
