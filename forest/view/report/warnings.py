"""What a reader of a report must know before believing it."""

from __future__ import annotations

from forest.record.run import Run

_FEW_TREES = 30  # below it, means of a stand say little
_SMALL_HA = 0.05
_USUAL_TABLES = ("trees", "stand", "events")


def warnings_of(run: Run) -> list[str]:
    """List what is amiss with a run file, or lets it say less than it seems to."""
    found = []
    if not len(run.years):
        return ["The run has no whole year yet: there is nothing to report."]
    planned = run.scenario.years
    if not run.complete:
        found.append(
            f"The run is not complete: {len(run.years)} of {planned} years are on file. "
            "This report ends with the last whole year."
        )
    for name in _USUAL_TABLES:
        if name not in run.tables:
            found.append(f"The file holds no table of {name}: what rests on it is left out.")
    living = int(run.population["living"].iloc[-1])
    if living == 0:
        found.append("No tree lives in the last year.")
    elif living < _FEW_TREES:
        live = "1 tree lives" if living == 1 else f"{living} trees live"
        found.append(f"Only {live} in the last year: numbers per ha rest on few trees.")
    width, depth = run.scenario.plot.size_m
    hectares = width * depth / 10_000.0
    if hectares < _SMALL_HA:
        found.append(
            f"The plot is {width:g} × {depth:g} m ({hectares:.3g} ha): one tree more or less is "
            f"{1.0 / hectares:.0f} per ha."
        )
    return found
