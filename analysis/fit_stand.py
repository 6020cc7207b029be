"""The stand that a fit grows, and how far it is from its targets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

import forest
from analysis.fit_targets import Goal, Target
from analysis.self_thinning import thinning_slope

_FIRST_THINNING = 30  # age from which a stand is thinned towards its table
_EVERY = 5  # years between thinnings
_OPEN_M = 15.0  # edge of the plot that an open-grown tree has for its own
_OPEN_YEARS = 50  # in which it is to be 10 cm thick
#: What a target that the stand did not live to see counts, in tolerances.
_MISSED = 5.0


def number_at(table: pd.DataFrame, age: float) -> float:
    """Give a table's N per ha at an age, straight on doubly logarithmic paper, also before it."""
    ages, numbers = np.log(table.index.to_numpy(float)), np.log(table["n_ha"].to_numpy())
    at = math.log(age)
    if at < ages[0]:
        slope = (numbers[1] - numbers[0]) / (ages[1] - ages[0])
        return float(np.exp(numbers[0] + slope * (at - ages[0])))
    return float(np.exp(np.interp(at, ages, numbers)))


def thin_from_below(stand: forest.Stand, n_ha: float) -> None:
    """Fell the thinnest trees until n_ha are left."""
    trees = stand.trees.fillna({"dbh_cm": 0.0}).sort_values(["dbh_cm", "height_m"])
    width, depth = stand.scenario.plot.size_m
    surplus = len(trees) - round(n_ha * width * depth / 1e4)
    if surplus > 0:
        stand.fell([int(i) for i in trees["tree_id"].iloc[:surplus]], "thinning")


def scenario_of(
    species: str, goal: Goal, plot_m: float, seed: int, values: Mapping[str, float]
) -> forest.Scenario:
    """Give the scenario of a goal's stand with these parameters, `section.key`: value."""
    return forest.Scenario.from_toml(
        "\n".join(
            [
                f"years = {goal.years}",
                f"seed = {seed}",
                f"[plot]\nsize_m = [{plot_m}, {plot_m}]\nboundary = 'periodic'",
                f"[site]\nlatitude_deg = {goal.latitude_deg}",
                "[environment.shadow]\n[environment.canopy]",
                f"[species.{species}]",
                f"[planting]\nkind = 'random'\ndensity_ha = {goal.density_ha}",
            ]
        ),
        where=f"fit of {species}",
    ).with_overrides([f"species.{species}.{key}={value!r}" for key, value in values.items()])


def open_slenderness(species: str, goal: Goal, values: Mapping[str, float]) -> float:
    """Give height per diameter of an open-grown tree in the year that it passes 10 cm; or NaN."""
    alone = replace(goal, density_ha=1e4 / _OPEN_M**2)
    stand = forest.Stand(scenario_of(species, alone, _OPEN_M, 1, values))
    for _ in range(_OPEN_YEARS):
        stand.step()
        trees = stand.trees
        if not len(trees):
            break
        diameter, height = trees[["dbh_cm", "height_m"]].iloc[0]
        if diameter >= 10.0:
            return float(100.0 * height / diameter)
    return float("nan")


def grow_towards(
    species: str, goal: Goal, plot_m: float, seed: int, values: Mapping[str, float]
) -> pd.DataFrame:
    """Grow a goal's stand, thinned where the goal is; give its stand table by age.

    The column `open_slenderness` is that of a tree of its own, the same in all rows.
    """
    stand = forest.Stand(scenario_of(species, goal, plot_m, seed, values))
    rows = []
    for age in range(goal.seedling_age + 1, goal.years + 1):
        table = goal.thinned
        if table is not None and age >= _FIRST_THINNING and age % _EVERY == 0:
            thin_from_below(stand, number_at(table, age))
        columns = stand.step().tables["stand"]
        rows.append({name: column[-1] for name, column in columns.items()})
        if not len(stand.rows.tree_id):
            break
    grown = pd.DataFrame(rows)
    first = goal.seedling_age + 1
    grown.index = pd.RangeIndex(first, first + len(grown), name="age")
    grown["open_slenderness"] = open_slenderness(species, goal, values)
    return grown


def model(table: pd.DataFrame, target: Target) -> float:
    """Give a stand's number for a target; NaN if it did not live so long."""
    if target.column == "thinning_slope":
        return thinning_slope(table) if len(table) > 1 else float("nan")
    if not target.age:
        return float(table[target.column].max())
    return float(table[target.column].get(target.age, float("nan")))


def residual(table: pd.DataFrame, target: Target) -> float:
    """Give ln(model / target) in tolerances."""
    ratio = model(table, target) / target.value
    if not ratio > 0.0:
        return _MISSED
    off = float(np.clip(np.log(ratio) / target.tolerance, -_MISSED, _MISSED))
    return max(off * target.side, 0.0) if target.side else off


def misfit(tables: Sequence[pd.DataFrame], targets: Sequence[Target]) -> float:
    """Give the mean square of the residuals over stands and targets."""
    return float(np.mean([[residual(t, target) ** 2 for target in targets] for t in tables]))


def off_percent(found: float, target: Target) -> float:
    """Give how far a number is from its target, %."""
    return 100.0 * (found / target.value - 1.0)


def within(found: float, target: Target) -> bool:
    """Say whether a number meets its target."""
    off = off_percent(found, target) * (target.side or 1)
    return off <= 100.0 * target.tolerance if target.side else abs(off) <= 100.0 * target.tolerance
