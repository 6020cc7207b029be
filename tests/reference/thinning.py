"""Slow twins of the rules of thinning: one tree after the other, everything counted anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple


class Tree(NamedTuple):
    """A tree of a marker's list; `dbh` is None below breast height."""

    tree_id: int
    species: int
    x: float
    y: float
    dbh: float | None
    height: float


def thickness(tree: Tree) -> tuple[float, float]:
    """Order trees from the thinnest on; those without a dbh by height, before all others."""
    return (-1.0 if tree.dbh is None else tree.dbh, tree.height)


def density(
    trees: Sequence[Tree], quantity: str, hectares: float, max_sdi: Sequence[float]
) -> float:
    """Measure what is left."""
    thick = [tree.dbh for tree in trees if tree.dbh is not None]
    if quantity == "n_ha":
        return len(trees) / hectares
    if quantity == "basal_area_m2ha":
        return sum(math.pi * (d / 200) ** 2 for d in thick) / hectares
    if quantity == "sdi":
        if not thick:
            return 0.0
        qmd = math.sqrt(sum(d * d for d in thick) / len(thick))
        return len(thick) / hectares * (qmd / 25.4) ** 1.605
    return sum(
        density([t for t in trees if t.species == kind], "sdi", hectares, max_sdi) / most
        for kind, most in enumerate(max_sdi)
    )


def thin(
    trees: Sequence[Tree],
    candidates: Sequence[Tree],
    quantity: str,
    limit: float,
    hectares: float,
    max_sdi: Sequence[float],
) -> list[int]:
    """Fell candidates one after the other until no more than the limit is left; give their ids."""
    left = list(trees)
    gone = []
    slack = 1e-9 * density(trees, quantity, hectares, max_sdi)
    for tree in candidates:
        if density(left, quantity, hectares, max_sdi) <= limit + slack:
            break
        if tree.dbh is None and quantity != "n_ha":
            continue
        left.remove(tree)
        gone.append(tree.tree_id)
    return gone


def distance(a: Tree, b: Tree, size: tuple[float, float], periodic: bool) -> float:
    """Measure to the nearest image."""
    shifts = (-1, 0, 1) if periodic else (0,)
    return min(
        math.hypot(a.x - b.x + i * size[0], a.y - b.y + j * size[1]) for i in shifts for j in shifts
    )


def crop_trees(
    trees: Sequence[Tree], count: int, spacing: float, size: tuple[float, float], periodic: bool
) -> list[Tree]:
    """Choose the thickest that keep their distance."""
    chosen: list[Tree] = []
    for tree in sorted(trees, key=lambda t: (-thickness(t)[0], -t.height, t.tree_id)):
        if len(chosen) < count and all(
            distance(tree, other, size, periodic) >= spacing for other in chosen
        ):
            chosen.append(tree)
    return chosen


def pressing(
    crop: Sequence[Tree],
    trees: Sequence[Tree],
    count: int,
    within: float,
    size: tuple[float, float],
    periodic: bool,
) -> set[int]:
    """Name the strongest competitors of each crop tree: most dbh per distance."""
    gone = set()
    for tree in crop:
        near = [
            (-other.dbh / max(away, 1e-6), other.tree_id)
            for other in trees
            if other not in crop
            and other.dbh is not None
            and (away := distance(tree, other, size, periodic)) <= within
        ]
        gone |= {tree_id for _, tree_id in sorted(near)[:count]}
    return gone


def inside(
    holds: Callable[[float, float], bool],
    x: float,
    y: float,
    size: tuple[float, float],
    periodic: bool,
) -> bool:
    """Ask a shape for a place and, on a torus, for all its images around."""
    shifts = range(-4, 5) if periodic else (0,)
    return any(holds(x + i * size[0], y + j * size[1]) for i in shifts for j in shifts)
