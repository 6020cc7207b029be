"""Stands of pure species left to themselves, held against yield tables.

`python analysis/self_thinning.py` grows `scenarios/self_thinning.toml` with three seeds, once more
with weather, and the other species in pure stands; it writes docs/stands.md and its figure.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from forest.dynamics.weather import income_factor  # noqa: E402

SCENARIO = ROOT / "scenarios" / "self_thinning.toml"
PAGE = ROOT / "docs" / "stands.md"
FIGURE = ROOT / "docs" / "gallery" / "self_thinning.png"

SEEDS = (1, 2, 3)
HARD_YEAR = 60  # stand age in which income is halved
WEATHER = [
    "weather.noise_sd=0.15",
    f"weather.extreme_years=[{{ year = {{year}}, factor = 0.5 }}]",
]

#: Koivisto: Scots pine, Finland, Myrtillus type, natural normal stands; age: N, Dq, Hdom, G.
KOIVISTO = {
    20: (7900, 4.8, 6.7, 14.0),
    40: (2700, 11.2, 14.9, 26.6),
    60: (1415, 17.2, 21.1, 32.9),
    80: (940, 22.0, 25.0, 35.7),
}

#: The other species: 2500 seedlings per ha on 20 x 20 m.
PURE = ["plot.size_m=[20, 20]", "planting.density_ha=2500", "years=80", "site.latitude_deg=51"]
OTHERS = ("picea_abies", "fagus_sylvatica", "betula_pendula", "quercus_robur")

_ONSET = 0.85  # of the planted number
_DETREND_YEARS = 11


@dataclass(frozen=True)
class History:
    """What became of a stand.

    Attributes
    ----------
    stand : DataFrame
        The stand table of all trees; indexed by stand age, years.
    ring : Series
        Mean width of the year's rings at 1.3 m, mm, of the trees that live to the end; by stand age.
    income : Series
        The weather's factor on income; by stand age.
    """

    stand: pd.DataFrame
    ring: pd.Series
    income: pd.Series


def grow(scenario: forest.Scenario) -> History:
    """Grow a scenario to its end and keep its stand table and rings."""
    stand = forest.Stand(scenario)
    rows, widths = [], []
    for _ in range(scenario.years):
        tables = stand.step().tables
        rows.append({name: column[-1] for name, column in tables["stand"].items()})
        rings = tables["rings"]
        widths.append(pd.Series(rings["width_mm"], index=rings["tree_id"], dtype=float))
    table = pd.DataFrame(rows)
    table.index = pd.RangeIndex(1, len(table) + 1, name="age")
    by_tree = pd.DataFrame(widths, index=table.index)
    living = [int(i) for i in stand.rows.tree_id if i in by_tree.columns]
    weather = scenario.weather
    extremes = [(entry.year, entry.factor) for entry in weather.extreme_years]
    income = [
        income_factor(int(year), scenario.seed, weather.noise_sd, extremes)
        for year in table["year"]
    ]
    return History(table, by_tree[living].mean(axis=1), pd.Series(income, index=table.index))


def self_thinning(seed: int, overrides: Sequence[str] = ()) -> History:
    """Grow the pine stand of `scenarios/self_thinning.toml`."""
    return grow(forest.Scenario.load(SCENARIO).with_overrides([f"seed={seed}", *overrides]))


def with_weather(seed: int) -> History:
    """Grow the pine stand with 15 % noise on yearly income and one year at half income."""
    first = forest.Scenario.load(SCENARIO).start_year
    year = str(first + HARD_YEAR - 1)
    return self_thinning(seed, [line.replace("{year}", year) for line in WEATHER])


def onset(stand: pd.DataFrame) -> int:
    """Give the age at which fewer than 85 % of the planted trees live (the onset of mortality)."""
    few = stand["n_ha"] < _ONSET * stand["n_ha"].iloc[0]
    return int(few.idxmax()) if few.any() else int(stand.index[-1])


def thinning_slope(stand: pd.DataFrame) -> float:
    """Fit d ln N / d ln Dq from the onset of mortality on (Reineke 1933: about -1.6)."""
    past = stand.loc[onset(stand) :]
    return float(np.polyfit(np.log(past["qmd_cm"]), np.log(past["n_ha"]), 1)[0])


def follows_weather(history: History, from_age: int = 20) -> tuple[float, float]:
    """Correlate the mean ring with the income factor, from an age on.

    Returns
    -------
    raw, detrended : float
        Pearson's r of the ring widths, and of their ratio to a running mean of 11 years.
    """
    trend = history.ring.rolling(_DETREND_YEARS, center=True, min_periods=6).mean()
    income = history.income.loc[from_age:]
    raw = history.ring.loc[from_age:].corr(income)
    return float(raw), float((history.ring / trend).loc[from_age:].corr(income))


def pure(species: str, seed: int = 1) -> History:
    """Grow a pure stand of another species: 2500 seedlings per ha, 80 years."""
    text = SCENARIO.read_text(encoding="utf-8").replace("pinus_sylvestris", species)
    scenario = forest.Scenario.from_toml(text, where=species, folder=SCENARIO.parent)
    return grow(scenario.with_overrides([*PURE, f"seed={seed}"]))
