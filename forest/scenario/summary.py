"""A scenario in a few lines."""

from __future__ import annotations

import numpy as np

from forest.scenario.scenario import Scenario

#: Acts that are named one by one.
_MOST_ACTS = 6
#: Residual trees that are named one by one.
_MOST_RESIDUAL = 6
#: Storms that are named one by one.
_MOST_STORMS = 6


def summary(scenario: Scenario) -> list[tuple[str, str]]:
    """Say in a few lines what a scenario would grow.

    Returns
    -------
    list of (label, text)

    Raises
    ------
    InputError
        If a random planting finds no room for a tree.
    """
    _, _, kind = scenario.planting_positions()
    width, depth = scenario.plot.size_m
    counts = np.bincount(kind, minlength=len(scenario.species))
    trees = ", ".join(
        f"{count:,} {name}" for name, count in zip(scenario.species, counts, strict=True) if count
    )
    last = scenario.start_year + scenario.years - 1
    parts = [name for name, part in scenario.environment if part is not None]
    return [
        ("title", scenario.title or "(none)"),
        ("plot", f"{width:g} x {depth:g} m, {scenario.plot.boundary}"),
        ("trees", f"{trees or 'none'} ({len(kind) / (width * depth) * 1e4:,.0f} per ha)"),
        ("years", f"{scenario.years} ({scenario.start_year} to {last})"),
        ("mode", scenario.mode),
        ("climate", _climate(scenario)),
        ("environment", " + ".join(parts)),
        ("bud fate", scenario.growth.bud_fate),
        ("mechanics", _mechanics(scenario)),
        ("mortality", _mortality(scenario)),
        ("regeneration", _regeneration(scenario)),
        ("wind", _wind(scenario)),
        ("obstacles", str(len(scenario.obstacles)) if scenario.obstacles else "none"),
        ("residual trees", _residual(scenario)),
        ("acts", _acts(scenario)),
        ("seed", str(scenario.seed)),
        ("tables", ", ".join(scenario.output.tables) or "none"),
        ("sha256", scenario.digest()),
    ]


def _climate(scenario: Scenario) -> str:
    climate = scenario.climate
    told = []
    if climate.series:
        span = f"{climate.series[0].year} to {climate.series[-1].year}"
        again = ", repeated" if climate.repeat else ""
        told.append(f"{', '.join(climate.given)} of {span}{again}")
    if climate.drawn:
        told.append(f"{', '.join(climate.drawn)} drawn")
    if climate.extreme_years:
        told.append(f"{len(climate.extreme_years)} years by hand")
    return "; ".join(told) or "mean years"


def _mechanics(scenario: Scenario) -> str:
    mechanics = scenario.mechanics
    if mechanics is None:
        return "none"
    how = f"bending, righting {mechanics.righting}" if mechanics.bending else "stability alone"
    answered = ", answered by growth" if mechanics.wind_growth else ""
    return f"{how}, wind {mechanics.wind_m_s:g} m/s{answered}"


def _mortality(scenario: Scenario) -> str:
    mortality = scenario.mortality
    causes = [key for key in ("age", "background", "buckling") if getattr(mortality, key)]
    events = [event for event in mortality.events if event.year in scenario.calendar]
    if events:
        causes.append(f"{len(events)} disturbances")
    kept = "; snags and dead wood" if mortality.snags else ""
    paper = scenario.mode == "paper"
    return (", ".join([*([] if paper else ["suppression"]), *causes]) or "none") + kept


def _regeneration(scenario: Scenario) -> str:
    regeneration = scenario.regeneration
    if regeneration is None:
        return "none"
    rain = ", ".join(name for name, seeds in regeneration.seed_rain.items() if seeds)
    return f"trees from {regeneration.handover_height_m:g} m; seed from outside: {rain or 'none'}"


def _wind(scenario: Scenario) -> str:
    wind = scenario.wind
    if wind is None:
        return "none"
    storms = [storm for storm in wind.storms if storm.year in scenario.calendar]
    parts = [f"{storm.year} {storm.speed_m_s:g} m/s" for storm in storms[:_MOST_STORMS]]
    parts += [f"{len(storms) - _MOST_STORMS} more"] if len(storms) > _MOST_STORMS else []
    if wind.yearly is not None:
        parts.append(f"every year about {wind.yearly.mode_m_s:g} m/s")
    return ", ".join(parts) or "no storms"


def _residual(scenario: Scenario) -> str:
    """Name the residual trees, or tell how many they are."""
    trees = scenario.residual_trees
    if len(trees) > _MOST_RESIDUAL:
        return str(len(trees))
    return ", ".join(f"{t.name} ({t.species}, {t.height_m:g} m)" for t in trees) or "none"


def _acts(scenario: Scenario) -> str:
    """Name the acts in the order of their first years, or the first and last of many."""
    calendar = scenario.calendar
    reached = [act for act in scenario.acts if act.calendar_years(calendar)]
    acts = sorted(reached, key=lambda act: act.calendar_years(calendar)[0])
    named = [f"{act.in_words} {act.time_in_words}" for act in acts]
    if len(named) > _MOST_ACTS:
        named[_MOST_ACTS - 1 : -1] = [f"... ({len(acts)} in all)"]
    return ", ".join(named) or "none"
