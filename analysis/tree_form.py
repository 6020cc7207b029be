"""Numbers that tell the forms of trees apart, measured on skeletons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import forest
from forest.trees.skeleton import Skeleton

FIGURES = Path(__file__).parents[1] / "scenarios" / "figures"
_TREE = "species.generic_deciduous"


def grow(figure: str, overrides: Sequence[str] = (), seed: int = 1) -> list[Skeleton]:
    """Grow the trees of a figure's scenario; `overrides` starting with a dot are species keys."""
    scenario = forest.Scenario.load(FIGURES / f"figure_{figure}.toml").with_overrides(
        [f"seed={seed}", *(_TREE + o if o.startswith(".") else o for o in overrides)]
    )
    stand = forest.Stand(scenario)
    for _ in range(scenario.years):
        stand.step()
    return [stand.skeleton(int(tree_id)) for tree_id in stand.rows.tree_id]


class Form(NamedTuple):
    """Form of a tree.

    Attributes
    ----------
    metamers : float
        Number of internodes.
    height_m : float
        Height of the highest node.
    leader : float
        Height of the trunk axis' highest node per tree height.
    trunk_wood, limb_wood : float
        Share of the wood in the trunk axis, and in first-order axes.
    width : float
        Crown diameter (98th percentile of the nodes' distance from the base) per tree height.
    clear : float
        Height below which 2 % of the branches' nodes stand, per tree height.
    droop : float
        Mean vertical part of the directions of internodes above order 0 that are up to 3 years
        old; negative: they hang.
    gnarl_deg : float
        Mean angle between successive internodes of an axis above order 0.
    """

    metamers: float
    height_m: float
    leader: float
    trunk_wood: float
    limb_wood: float
    width: float
    clear: float
    droop: float
    gnarl_deg: float


def form_of(tree: Skeleton) -> Form:
    """Measure a tree."""
    base = tree.start[0]
    node = tree.end - base
    height = float(node[:, 2].max())
    wood = tree.radius**2 * tree.length
    reach = np.hypot(node[:, 0], node[:, 1])
    heading = (tree.end - tree.start) / tree.length[:, None]
    young = (tree.order > 0) & (tree.birth_year > tree.birth_year.max() - 3)
    on_axis = np.flatnonzero((tree.parent >= 0) & (tree.order > 0))
    on_axis = on_axis[tree.axis[on_axis] == tree.axis[tree.parent[on_axis]]]
    cosine = (heading[on_axis] * heading[tree.parent[on_axis]]).sum(axis=1)
    return Form(
        metamers=float(len(tree)),
        height_m=height,
        leader=float(node[tree.axis == 0, 2].max()) / height,
        trunk_wood=float(wood[tree.axis == 0].sum() / wood.sum()),
        limb_wood=float(wood[tree.order == 1].sum() / wood.sum()),
        width=2.0 * float(np.percentile(reach, 98)) / height,
        clear=float(np.percentile(node[tree.order > 0, 2], 2)) / height,
        droop=float(heading[young, 2].mean()),
        gnarl_deg=float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).mean()),
    )


def mean_form(figure: str, overrides: Sequence[str] = (), seeds: Sequence[int] = (1, 2, 3)) -> Form:
    """Average the forms of a figure's first tree over seeds."""
    forms = [form_of(grow(figure, overrides, seed)[0]) for seed in seeds]
    return Form(*(float(x) for x in np.mean(forms, axis=0)))


def _cells(tree: Skeleton, edge_m: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List the cells that hold internodes, and how many each holds."""
    cell = np.floor(0.5 * (tree.start + tree.end) / edge_m).astype(np.int64)
    found, count = np.unique(cell, axis=0, return_counts=True)
    return found, count


def density_by_height(tree: Skeleton, edge_m: float = 0.8) -> NDArray[np.float64]:
    """Mean number of internodes per cell that holds any, in thirds of the height, float64 (3,)."""
    cells, count = _cells(tree, edge_m)
    third = np.minimum(3 * cells[:, 2] // (cells[:, 2].max() + 1), 2)
    return np.array([count[third == k].mean() for k in range(3)])


def overlap(one: Skeleton, other: Skeleton, edge_m: float = 0.8) -> float:
    """Share of the smaller crown's cells that the other crown holds, too."""
    a = {tuple(c) for c in _cells(one, edge_m)[0]}
    b = {tuple(c) for c in _cells(other, edge_m)[0]}
    return len(a & b) / min(len(a), len(b))


def branching_angles(tree: Skeleton) -> NDArray[np.float64]:
    """Angle between each axis' first internode and the internode that bears it, degrees."""
    heading = (tree.end - tree.start) / tree.length[:, None]
    child = np.flatnonzero(tree.parent >= 0)
    child = child[tree.axis[child] != tree.axis[tree.parent[child]]]
    cosine = (heading[child] * heading[tree.parent[child]]).sum(axis=1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), np.float64)


def runions(seed: int = 1) -> Skeleton:
    """Grow a tree by space colonization without buds in the envelope of figure 21.

    The first child of a node continues its axis; d^2.2 adds up.
    """
    from tests.reference.space_colonization_runions import colonize

    rng = np.random.default_rng(seed)
    cube = rng.uniform(-1.0, 1.0, (9000, 3))
    cloud = cube[(cube**2).sum(axis=1) < 1.0] * (2.5, 2.5, 3.2) + (0.0, 0.0, 3.4)
    place, joint = colonize(cloud, (0.0, 0.0, 0.0), 0.2, 1.0, 0.4)
    parent = joint[1:] - 1  # internode i ends at node i + 1
    n = len(parent)
    axis, order = np.zeros(n, np.int32), np.zeros(n, np.int32)
    continued, leafy = np.zeros(n, bool), np.ones(n, bool)
    pipe = np.full(n, 0.004**2.2)
    axes = 0
    for i in range(n):
        p = parent[i]
        if p < 0:
            continue
        leafy[p] = False
        if continued[p]:
            axes += 1
            axis[i], order[i] = axes, order[p] + 1
        else:
            continued[p] = True
            axis[i], order[i] = axis[p], order[p]
    for i in range(n - 1, 0, -1):
        if parent[i] >= 0:
            pipe[parent[i]] += pipe[i]
    return Skeleton(
        parent=parent.astype(np.int32),
        start=place[joint[1:]],
        end=place[1:],
        radius=0.5 * pipe ** (1.0 / 2.2),
        axis=axis,
        order=order,
        birth_year=np.zeros(n, np.int32),
        leafy=leafy,
        serial=np.arange(n, dtype=np.int32),
        species="generic_deciduous",
    )
