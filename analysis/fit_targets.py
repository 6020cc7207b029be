"""What each species is fitted to: yield tables and pattern figures.

Yield tables stand in `analysis/data`. A pattern figure is what foresters expect of any such stand;
its tolerance says how sharply it is meant.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

DATA = Path(__file__).resolve().parent / "data"

#: How near the columns of a yield table are to be met.
TOLERANCE = {
    "top_height_m": 0.15,
    "qmd_cm": 0.25,
    "basal_area_m2ha": 0.25,
    "n_ha": 0.35,
}


@dataclass(frozen=True)
class Target:
    """A number that a stand is to have at an age (0: over all its life).

    `side` is 1 for a ceiling and -1 for a floor: then only what is beyond it counts.
    """

    age: int
    column: str
    value: float
    tolerance: float
    side: int = 0


@dataclass(frozen=True)
class Free:
    """A parameter that a fit may move: `section.key` between two bounds."""

    key: str
    low: float
    high: float

    def value(self, place: float) -> float:
        """Give the value at a place between the bounds, 0..1; by ratio where both are above 0."""
        place = min(max(place, 0.0), 1.0)
        if self.low > 0.0:
            return float(f"{self.low * (self.high / self.low) ** place:.3g}")
        return round(float(self.low + (self.high - self.low) * place), 4)

    def place(self, value: float) -> float:
        """Give the place of a value between the bounds."""
        if self.low > 0.0:
            place = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            place = (value - self.low) / (self.high - self.low)
        return min(max(place, 0.0), 1.0)


@dataclass(frozen=True)
class Goal:
    """A stand to grow, and what it is held against.

    Attributes
    ----------
    source : str
        What the targets are, for the page and for `[sources]`.
    density_ha, latitude_deg : float
        Seedlings planted, and where.
    years : int
        Age to which the stand is grown.
    targets : tuple of Target
    free : tuple of Free
        What the fit may move.
    seedling_age : int
        Age of the seedlings when planted, from which tables count: 0.2 m high, one internode.
    thinned : DataFrame or None
        The yield table whose N the stand is felled to, from below.
    """

    source: str
    density_ha: float
    latitude_deg: float
    years: int
    targets: tuple[Target, ...]
    free: tuple[Free, ...]
    seedling_age: int = 0
    thinned: pd.DataFrame | None = None


def yield_table(name: str) -> tuple[str, pd.DataFrame]:
    """Read a yield table: the line that names its source, and its rows by age."""
    text = (DATA / name).read_text(encoding="utf-8").splitlines()
    notes = [line.lstrip("# ") for line in text if line.startswith("#")]
    rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    return " ".join(notes), pd.DataFrame(rows).astype(float).set_index("age")


def of_table(table: pd.DataFrame, columns: Sequence[str]) -> tuple[Target, ...]:
    """Make targets of a yield table's columns at all its ages."""
    return tuple(
        Target(int(age), column, float(table.loc[age, column]), TOLERANCE[column])
        for age in table.index
        for column in columns
    )


def pattern(column: str, tolerance: float, by_age: Mapping[int, float]) -> tuple[Target, ...]:
    """Make targets of one column, of one tolerance."""
    return tuple(Target(age, column, value, tolerance) for age, value in by_age.items())


_KOIVISTO, KOIVISTO = yield_table("koivisto_pine.csv")
_ASSMANN, ASSMANN = yield_table("assmann_franz_spruce.csv")

#: Reineke's slope and half its usual range.
_SLOPE = Target(0, "thinning_slope", -1.6, 0.2)


def _slenderness(floor: float) -> Target:
    """Height per diameter of an open-grown tree of 10 cm (Vospernik et al. 2010)."""
    return Target(0, "open_slenderness", floor, 0.1, side=-1)


def _densest(index: float) -> Target:
    """Reineke's index that a stand does not pass."""
    return Target(0, "sdi", index, 0.05, side=1)


_FREE = (
    Free("bud_fate.alpha", 0.8, 5.0),
    Free("bud_fate.apical_bias", 0.49, 0.6),
    Free("shedding.light_per_internode", 0.005, 0.2),
    Free("leaves.area_m2", 0.008, 0.04),
    Free("carbon.light_use_efficiency_kg_m2", 0.25, 2.0),
    Free("carbon.maintenance_per_year", 0.01, 0.12),
    Free("carbon.ring_fraction", 0.3, 0.8),
    Free("carbon.branch_pipe_ratio", 0.25, 0.9),
    Free("carbon.hydraulic_length_m", 30.0, 300.0),
    Free("carbon.turgor_limit_m", 22.0, 70.0),
    Free("carbon.first_pipe_diameter_m", 0.0003, 0.0015),
    Free("carbon.suppression_ratio", -0.5, 0.4),
    Free("carbon.vigour_sd", 0.05, 0.3),
    Free("carbon.seed_reserve_kg", 0.00005, 0.002),
)

#: A conifer's stem stays straight and its limbs side branches only above this apical bias.
_STRAIGHT = tuple(
    replace(free, low=0.535) if free.key == "bud_fate.apical_bias" else free for free in _FREE
)

GOALS = {
    "pinus_sylvestris": Goal(
        source=_KOIVISTO,
        density_ha=8500.0,
        latitude_deg=62.0,
        years=80,
        targets=(
            *of_table(KOIVISTO, list(TOLERANCE)),
            *pattern("lai", 0.15, {40: 3.5, 60: 3.5, 80: 3.5}),
            *pattern("floor_light", 0.15, {40: 0.12, 60: 0.12, 80: 0.12}),
            _SLOPE,
            _densest(1008.0),
            _slenderness(58.0),
        ),
        free=(*_STRAIGHT, Free("leaves.sla_m2_kg", 4.0, 12.0)),
        seedling_age=3,
    ),
    "picea_abies": Goal(
        source=_ASSMANN,
        density_ha=4500.0,
        latitude_deg=48.0,
        years=100,
        targets=(
            *of_table(ASSMANN, ["top_height_m", "qmd_cm", "basal_area_m2ha"]),
            *pattern("lai", 0.15, {40: 9.0, 60: 8.5, 80: 8.0, 100: 7.5}),
            *pattern("floor_light", 0.4, {40: 0.025, 60: 0.025, 80: 0.03}),
            _densest(1018.0),
            _slenderness(66.0),
        ),
        free=(*_STRAIGHT, Free("leaves.sla_m2_kg", 4.0, 9.0)),
        seedling_age=3,
        thinned=ASSMANN,
    ),
    "fagus_sylvatica": Goal(
        source="beech: slow at first and long-lasting in height, G to 33 m2/ha, LAI 5.5, "
        "floor light 2 to 5 %",
        density_ha=6000.0,
        latitude_deg=50.0,
        years=120,
        targets=(
            *pattern("top_height_m", 0.1, {20: 5.0, 40: 13.0, 60: 20.0, 80: 25.5, 120: 32.0}),
            *pattern("basal_area_m2ha", 0.15, {40: 22.0, 60: 28.0, 80: 32.0, 120: 34.0}),
            *pattern("lai", 0.1, {40: 5.5, 80: 5.5, 120: 5.5}),
            *pattern("floor_light", 0.3, {40: 0.033, 80: 0.033, 120: 0.035}),
            _SLOPE,
            _slenderness(60.0),
        ),
        free=_FREE,
    ),
    "betula_pendula": Goal(
        source="birch: fast at first and soon level in height, G to 19 m2/ha, floor light 20 to "
        "50 %",
        density_ha=5000.0,
        latitude_deg=60.0,
        years=100,
        targets=(
            *pattern("top_height_m", 0.1, {10: 5.5, 20: 11.0, 40: 18.5, 60: 22.5, 100: 25.5}),
            *pattern("basal_area_m2ha", 0.15, {20: 12.0, 40: 17.0, 60: 19.0, 80: 19.0, 100: 19.0}),
            *pattern("lai", 0.15, {20: 2.5, 40: 2.5, 60: 2.3, 80: 2.1}),
            *pattern("floor_light", 0.2, {40: 0.23, 60: 0.25, 80: 0.28}),
            _SLOPE,
            _slenderness(60.0),
        ),
        free=(*_FREE, Free("leaves.sla_m2_kg", 10.0, 25.0)),
    ),
    "quercus_robur": Goal(
        source="oak: G to 27 m2/ha, LAI about 4.5, floor light between those of beech and birch",
        density_ha=6000.0,
        latitude_deg=50.0,
        years=120,
        targets=(
            *pattern("top_height_m", 0.1, {20: 7.0, 40: 13.5, 60: 18.5, 80: 22.5, 120: 27.0}),
            *pattern("basal_area_m2ha", 0.15, {40: 19.0, 60: 23.5, 80: 26.0, 120: 27.5}),
            *pattern("lai", 0.1, {40: 4.5, 80: 4.5, 120: 4.3}),
            *pattern("floor_light", 0.3, {40: 0.07, 80: 0.08, 120: 0.09}),
            _SLOPE,
            _slenderness(60.0),
        ),
        free=(*_FREE, Free("leaves.sla_m2_kg", 10.0, 25.0)),
    ),
}
