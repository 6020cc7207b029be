"""Mensuration of living trees: from the arena of metamers to one number per tree and column.

Diameters come from the pipe model: d = pipe^(1/n) is the diameter of the wood, under bark.
Whatever a forester measures from outside (dbh, base diameter, stem volume) is over bark: with b,
the double bark thickness as a share of the diameter over bark, d_over = d_under / (1 - b).

The *stem* is the path that a forester would call so: from the base up along the main
continuation while there is one; where an axis has ended, along the branch at its last node.
A node bears one lateral bud, so that branch is the only one, and one forward scan finds the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.species import Species
from forest.trees.metamers import CONTINUED, LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import DISCS, Trees

#: Height at which dbh and rings are measured, m.
BREAST_HEIGHT_M = 1.3

_BINS = 32  # fixed, so that results do not depend on the number of threads
_QUARTER_PI = 0.25 * np.pi
_NAN = np.nan


NO_HEIGHTS: NDArray[np.float64] = np.empty(0)


class MeasureSpecies(NamedTuple):
    """What mensuration must know of each species; float64 arrays of one entry per species."""

    pipe_exponent: NDArray[np.float64]  # n of the pipe model
    bark_factor: NDArray[np.float64]  # double bark thickness / diameter over bark
    density_kg_m3: NDArray[np.float64]  # dry wood
    leaf_area_m2: NDArray[np.float64]  # per living site
    sla_m2_kg: NDArray[np.float64]  # specific leaf area
    merchantable_top_m: NDArray[np.float64]  # smallest diameter over bark that is sold
    stump_height_m: NDArray[np.float64]

    @classmethod
    def of(cls, species: Sequence[Species], pipe_exponent: NDArray[np.float64]) -> Self:
        """Read the species; the exponent is that of the run."""

        def each(section: str, key: str, scale: float = 1.0) -> NDArray[np.float64]:
            values = [scale * getattr(getattr(s, section), key) for s in species]
            return np.array(values, np.float64)

        return cls(
            pipe_exponent=pipe_exponent,
            bark_factor=each("mensuration", "bark_factor"),
            density_kg_m3=each("wood", "density_kg_m3"),
            leaf_area_m2=each("leaves", "area_m2"),
            sla_m2_kg=each("leaves", "sla_m2_kg"),
            merchantable_top_m=each("mensuration", "merchantable_top_cm", 0.01),
            stump_height_m=each("mensuration", "stump_height_m"),
        )


class TreeMeasures(NamedTuple):
    """Measured trees: arrays of one entry per row of the tree table."""

    dbh_cm: NDArray[np.float64]  # over bark; NaN below breast height
    base_diameter_cm: NDArray[np.float64]  # over bark
    height_m: NDArray[np.float64]  # of the highest tip
    crown_base_m: NDArray[np.float64]  # of the lowest living site; NaN without one
    crown_radius_m: NDArray[np.float64]  # mean reach of the living sites in 8 sectors
    crown_area_m2: NDArray[np.float64]  # octagon of the 8 reaches
    lean_deg: NDArray[np.float64]  # of the line from the base to the top of the stem
    basal_area_m2: NDArray[np.float64]  # over bark at breast height; 0 without a dbh
    stem_volume_m3: NDArray[np.float64]  # stem from base to top, over bark
    merchantable_volume_m3: NDArray[np.float64]  # its part above the stump that is thick enough
    biomass_kg: NDArray[np.float64]  # dry: wood of stem and branches, and leaves
    leaf_area_m2: NDArray[np.float64]
    light: NDArray[np.float64]  # mean relative light of the living sites; NaN without one
    metamers: NDArray[np.int32]
    buds: NDArray[np.int32]  # living sites
    breast_metamer: NDArray[np.int32]  # metamer at breast height, in the tree's extent; or -1
    breast_serial: NDArray[np.int32]  # its serial; -1 while there is none
    disc_metamer: NDArray[np.int32]  # (n, DISCS + 1) those at the rings' heights and, last, at the
    # crown's base, in the tree's extent; -1 for none

    def columns(self) -> dict[str, NDArray[Any]]:
        """Give what is measured, by column, without what only helps to find rings."""
        hidden = ("breast_metamer", "breast_serial", "disc_metamer")
        return {name: column for name, column in self._asdict().items() if name not in hidden}


@njit
def octagon(reach: Any) -> Any:
    """Give mean radius and area of the octagon whose corners are the reaches (squared).

    `reach` is indexed by the bits of a sector: 1 steep (|y| > |x|), 2 x < 0, 4 y < 0.
    """
    around = (0, 1, 3, 2, 6, 7, 5, 4)
    total = 0.0
    area = 0.0
    before = np.sqrt(reach[4])
    for sector in around:
        radius = np.sqrt(reach[sector])
        total += radius
        area += radius * before
        before = radius
    return total / 8.0, 0.5 * np.sin(_QUARTER_PI) * area


@njit
def _measure_tree(
    metamers: Any, trees: Any, species: Any, full_light: Any, heights: Any, t: Any, out: Any
) -> Any:
    """Measure tree `t` in one forward scan of its extent."""
    first = trees.start[t]
    n = trees.size[t]
    kind = trees.species[t]
    exponent = species.pipe_exponent[kind]
    over_bark = 1.0 / (1.0 - species.bark_factor[kind])
    top_limit = species.merchantable_top_m[kind]
    stump = species.stump_height_m[kind]
    old_breast = trees.breast_serial[t]

    reach = np.zeros(8)
    height = 0.0
    crown_base = np.inf
    light = 0.0
    buds = np.int64(0)
    wood = 0.0  # sum of d^2 * length
    stem = -1  # last metamer of the stem so far
    stem_goes_on = False
    along = 0.0  # length of the stem so far
    stem_wood = 0.0
    sold_wood = 0.0
    crossing = -1
    kept = -1
    discs = out.disc_metamer[t]
    discs[:] = -1
    found = np.zeros(len(heights), np.bool_)  # still the wood of last year
    for j in range(n):
        i = first + j
        state = metamers.state[i]
        z = np.float64(metamers.tip[i, 2])
        length = np.float64(metamers.length[i])
        square = np.float64(metamers.pipe[i])
        if exponent != 2.0:
            square = square ** (2.0 / exponent)
        wood += square * length
        height = max(height, z)
        if metamers.serial[i] == old_breast:
            kept = j

        sites = np.int64((state & TERMINAL) != 0) + np.int64((state & LATERAL) != 0)
        if sites > 0:
            buds += sites
            light += sites * np.float64(metamers.light[i])
            crown_base = min(crown_base, z)
            x = np.float64(metamers.tip[i, 0])
            y = np.float64(metamers.tip[i, 1])
            sector = np.int64(abs(y) > abs(x)) + 2 * np.int64(x < 0.0) + 4 * np.int64(y < 0.0)
            reach[sector] = max(reach[sector], x * x + y * y)

        if metamers.parent[i] == stem and (not stem_goes_on or (state & MAIN) != 0):
            stem = j
            stem_goes_on = (state & CONTINUED) != 0
            stem_wood += square * length
            above = along + length - max(along, stump)
            along += length
            if above > 0.0 and np.sqrt(square) * over_bark >= top_limit:
                sold_wood += square * min(above, length)
            if crossing < 0 and z >= BREAST_HEIGHT_M:
                crossing = j
            for k in range(len(heights)):
                if metamers.serial[i] == trees.disc_serial[t, k]:
                    discs[k] = j
                    found[k] = True
                elif not found[k] and discs[k] < 0 and z >= heights[k]:
                    discs[k] = j

    if buds > 0:
        j = stem
        while j >= 0 and metamers.tip[first + j, 2] >= crown_base:
            discs[-1] = j
            j = metamers.parent[first + j]
    out.metamers[t] = n
    out.buds[t] = buds
    out.height_m[t] = height
    out.crown_base_m[t] = crown_base if buds > 0 else _NAN
    out.crown_radius_m[t], out.crown_area_m2[t] = octagon(reach)
    out.light[t] = light / (buds * full_light) if buds > 0 else _NAN
    leaves = buds * species.leaf_area_m2[kind]
    out.leaf_area_m2[t] = leaves
    out.biomass_kg[t] = (
        _QUARTER_PI * wood * species.density_kg_m3[kind] + leaves / species.sla_m2_kg[kind]
    )
    with_bark = _QUARTER_PI * over_bark * over_bark
    out.stem_volume_m3[t] = with_bark * stem_wood
    out.merchantable_volume_m3[t] = with_bark * sold_wood
    out.base_diameter_cm[t] = 0.0
    out.lean_deg[t] = 0.0
    if n > 0:
        base = np.float64(metamers.pipe[first])
        out.base_diameter_cm[t] = 100.0 * over_bark * base ** (1.0 / exponent)
        x, y, z = metamers.tip[first + stem]
        side = np.sqrt(np.float64(x) ** 2 + np.float64(y) ** 2)
        out.lean_deg[t] = np.degrees(np.arctan2(side, np.float64(z)))

    breast = kept if kept >= 0 else crossing
    if breast < 0:
        out.dbh_cm[t] = _NAN
        out.basal_area_m2[t] = 0.0
        out.breast_metamer[t] = -1
        out.breast_serial[t] = -1
    else:
        under = np.float64(metamers.pipe[first + breast]) ** (1.0 / exponent)
        dbh = under * over_bark
        out.dbh_cm[t] = 100.0 * dbh
        out.basal_area_m2[t] = _QUARTER_PI * dbh * dbh
        out.breast_metamer[t] = breast
        out.breast_serial[t] = metamers.serial[first + breast]


@driver
def _measure_all(
    first: Any,
    step: Any,
    metamers: Any,
    trees: Any,
    species: Any,
    full_light: Any,
    heights: Any,
    by_size: Any,
    out: Any,
) -> None:
    """Measure all trees; they are dealt to bins from the largest to the smallest."""
    for b in range(first, _BINS, step):
        for k in range(b, len(by_size), _BINS):
            _measure_tree(metamers, trees, species, full_light, heights, by_size[k], out)


def measure_trees(
    metamers: Metamers,
    trees: Trees,
    species: MeasureSpecies,
    full_light: float = 1.0,
    heights: NDArray[np.float64] = NO_HEIGHTS,
) -> TreeMeasures:
    """Measure every tree of the table.

    Parameters
    ----------
    metamers : Metamers
        The arena.
    trees : Trees
        The tree table, n rows.
    species : MeasureSpecies
        One entry per species of the scenario.
    full_light : float
        Light Q of an unshaded bud (C of Palubicki et al. 2009, 4.1); `light` is relative to it.
    heights : float64 (k,)
        Heights of the stem at which rings are told, m; at most `forest.trees.table.DISCS`.

    Returns
    -------
    TreeMeasures
        Arrays of n entries.

    Notes
    -----
    *dbh* is read where the stem first reached 1.3 m, and stays with that metamer
    (`trees.breast_serial`) as long as it is on the tree: wood does not climb.
    *Crown base* is the height of the lowest living site; *crown radius* the mean over 8 sectors
    of 45 degrees of the farthest living site's horizontal distance from the stem base (0 where a
    sector has none), and *crown area* the octagon with these radii.
    *Stem volume* sums the internodes of the stem as cylinders over bark; *merchantable volume*
    those parts farther than the stump's height along the stem and not thinner than the species'
    limit. *Biomass* has no bark.
    """
    n = len(trees.tree_id)
    columns: dict[str, NDArray[Any]] = {name: np.empty(n) for name in TreeMeasures._fields}
    for name in ("metamers", "buds", "breast_metamer", "breast_serial"):
        columns[name] = np.empty(n, np.int32)
    columns["disc_metamer"] = np.empty((n, DISCS + 1), np.int32)
    out = TreeMeasures(**columns)
    by_size = np.argsort(-trees.size, kind="stable")
    in_threads(_measure_all, metamers, trees, species, float(full_light), heights, by_size, out)
    return out
