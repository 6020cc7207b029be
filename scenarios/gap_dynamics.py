"""A gap in an old stand: who comes up in it, and how the light closes above them.

    python scenarios/gap_dynamics.py --out out/gap

An old stand grows until the year of the harvest that the scenario gives. Its run file and last
checkpoint are copied and both are resumed: one with the gap, one without. In each the same piece of
ground is watched, year by year: its light, its seedlings, and the trees that were recruited on it
since. So what the gap lets in stands beside what came up below the closed canopy in those years.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.patches import Circle as Disc  # noqa: E402

import forest  # noqa: E402
from analysis.common import panels, plain, save  # noqa: E402
from forest.management.regions import inside  # noqa: E402
from forest.measure.tables import plot_of  # noqa: E402
from forest.progress import Bar  # noqa: E402
from forest.record.checkpoint import checkpoint_paths  # noqa: E402
from forest.view.looks import look_of  # noqa: E402
from scenarios.common import command_line, draw_map, one_line_errors, report  # noqa: E402

SCENARIO = Path(__file__).with_suffix(".toml")
#: Years after the gap that the table shows.
SHOWN = (0, 1, 2, 5, 10, 20, 30, 40, 50, 60)


class Watch(Bar):
    """Shows progress, and notes every year what the ground in a region is like.

    Attributes
    ----------
    years : list of dict
        `year`; `light`, the mean at the ground above the seedlings; and seedlings per ha by
        species.
    """

    def __init__(self, region: Any) -> None:
        super().__init__()
        self._region = region
        self.years: list[dict[str, float]] = []

    def year_done(self, stand: forest.Stand) -> None:
        """Note the year."""
        super().year_done(stand)
        canopy, regeneration = stand.surroundings.canopy, stand.regeneration
        assert canopy is not None
        assert regeneration is not None
        plot = plot_of(stand.scenario)
        light, cells, cohorts = canopy.ground_light, regeneration.cells, regeneration.cohorts
        y, x = (
            ((np.arange(n) + 0.5) * edge / n).ravel()
            for n, edge in zip(light.shape, plot.size_m[::-1], strict=True)
        )
        grid_x, grid_y = np.meshgrid(x, y)
        watched = inside(self._region, grid_x.ravel(), grid_y.ravel(), plot)
        place_y, place_x = np.divmod(np.arange(cells.count), cells.nx)
        ours = inside(self._region, (place_x + 0.5) * cells.dx, (place_y + 0.5) * cells.dy, plot)
        n = np.bincount(cohorts.species, cohorts.n * ours[cohorts.cell], len(stand.species)) / (
            ours.sum() * cells.area
        )
        self.years.append(
            {
                "year": stand.year,
                "light": float(light.ravel()[watched].mean()),
                **dict(zip(stand.species_names, 10_000.0 * n, strict=True)),
            }
        )


def newcomers(run: forest.Run, region: Any, since: int) -> pd.DataFrame:
    """Give the living trees of a region, year by year, that were recruited since a year.

    Events of the year itself tell of seedlings that were tall enough at the end of the last one.
    """
    came = run.events
    ids = came.loc[(came["kind"] == "recruited") & (came["year"] > since), "tree_id"]
    trees = run.trees
    there = trees[trees["tree_id"].isin(ids) & (trees["status"] == "living")]
    x, y = (there[name].to_numpy(np.float64) for name in ("x_m", "y_m"))
    return there[inside(region, x, y, plot_of(run.scenario))]


def over_time(watched: pd.DataFrame, new: pd.DataFrame, hectares: float) -> pd.DataFrame:
    """Tell of a region year by year: its light, its seedlings and its new trees per hectare.

    Returns
    -------
    DataFrame
        A row per year: `light`, `seedlings_ha`, `new_ha`, `new_m2ha` and `tallest_m`.
    """
    seedlings = watched.drop(columns="light").sum(axis=1)
    by_year = new.groupby("year")
    return pd.DataFrame(
        {
            "light": watched["light"],
            "seedlings_ha": seedlings,
            "new_ha": by_year.size().reindex(watched.index, fill_value=0) / hectares,
            "new_m2ha": by_year["basal_area_m2"].sum().reindex(watched.index, fill_value=0.0)
            / hectares,
            "tallest_m": by_year["height_m"].max().reindex(watched.index),
        }
    )


def by_species(
    runs: dict[str, forest.Run], region: Any, since: int, hectares: float
) -> pd.DataFrame:
    """Compare the region's recruits by species: a row per stand and species that has any."""
    rows = []
    for name, run in runs.items():
        new = newcomers(run, region, since)
        for species in run.species_names:
            of = new[new["species"].astype(str) == species]
            if not len(of):
                continue
            last = of[of["year"] == run.years[-1]]
            tall = last["height_m"].nlargest(5)
            rows.append(
                {
                    "ground": name,
                    "species": species,
                    "recruits_ha": of["tree_id"].nunique() / hectares,
                    "living_ha": len(last) / hectares,
                    "basal_area_m2ha": last["basal_area_m2"].sum() / hectares,
                    "height_of_tallest_m": tall.mean() if len(tall) else np.nan,
                    "light": of["light"].mean(),
                }
            )
    return pd.DataFrame(rows)


def draw(
    runs: dict[str, forest.Run], times: dict[str, pd.DataFrame], region: Any, year: int
) -> Figure:
    """Draw the stand three times from above, and the gap's ground beside closed ground.

    Stems are four times as thick as they are.
    """
    figure, (maps, curves) = panels(3, 2, size=(4.4, 4.1))
    run = runs["gap"]
    trees = run.trees[run.trees["status"] == "living"]
    last = int(run.years[-1])
    for axes, when in zip(maps, (year, min(year + 20, last), last), strict=True):
        shown = trees[trees["year"] == when].sort_values("height_m")
        draw_map(axes, shown, run.scenario.plot.size_m, f"{when - year} years after the gap", 4.0)
        place = (region.x_m, region.y_m)
        axes.add_patch(Disc(place, region.radius_m, fill=False, ls="--", lw=1.0))
    light, number, height = curves
    named: set[str] = set()
    for name, style in (("gap", "-"), ("closed", "--")):
        of = times[name]
        light.plot(of.index - year, of["light"], color="black", ls=style, lw=1.5, label=name)
        number.plot(of.index - year, of["new_ha"], color="black", ls=style, lw=1.5)
        new = newcomers(runs[name], region, year)
        for species, ours in new.groupby("species", observed=True):
            colour = look_of(str(species)).line
            tall = ours.groupby("year")["height_m"].max()
            label = None if species in named else plain(str(species))
            named.add(str(species))
            height.plot(tall.index - year, tall, color=colour, ls=style, lw=1.5, label=label)
    after = "years after the gap"
    light.set(xlabel=after, ylabel="light at the ground", ylim=(0, None))
    light.legend(frameon=False, fontsize=8)
    number.set(xlabel=after, ylabel="living trees recruited since, per ha", ylim=(0, None))
    height.set(xlabel=after, ylabel="height of the tallest of them, m", ylim=(0, None))
    if named:
        height.legend(frameon=False, fontsize=8)
    return figure


def grow_both(
    scenario: forest.Scenario, folder: Path, gap_year: int, threads: int | None
) -> tuple[dict[str, forest.Run], dict[str, pd.DataFrame]]:
    """Grow the stand up to the gap, and from there twice: with it and without.

    Returns
    -------
    runs, watched : dict
        By `gap` and `closed`: the finished run, and the years that `Watch` noted.
    """
    region = _gap(scenario).gap
    old = folder / "old_stand.h5"
    before = scenario.with_overrides([f"years={gap_year - scenario.start_year}", "acts=[]"])
    forest.simulate(before, old, threads=threads, overwrite=True, progress=True).close()
    runs, watched = {}, {}
    for name, of in (("gap", scenario), ("closed", scenario.with_overrides(["acts=[]"]))):
        to = folder / f"{name}.h5"
        for path in (*checkpoint_paths(to), to):
            path.unlink(missing_ok=True)
        shutil.copy(old, to)
        for path in checkpoint_paths(old):
            shutil.copy(path, folder / path.name.replace(old.name, to.name))
        watch = Watch(region)
        runs[name] = forest.simulate(of, to, threads=threads, resume=True, progress=watch)
        watched[name] = pd.DataFrame(watch.years).set_index("year")
    return runs, watched


def _gap(scenario: forest.Scenario) -> Any:
    """Give the act that cuts the gap."""
    (act,) = (act for act in scenario.acts if act.kind == "harvest" and act.method == "gap")
    return act


def main(words: Sequence[str] | None = None) -> None:
    """Grow both stands, print what came up in them, and draw it."""
    parser = command_line(__doc__, "gap")
    parser.add_argument("--before", type=int, help="age of the old stand, years")
    parser.add_argument("--years", type=int, help="years to grow after the gap")
    asked = parser.parse_args(words)
    with one_line_errors():
        scenario = forest.Scenario.load(SCENARIO)
        start, act = scenario.start_year, _gap(scenario)
        gap_year = act.year if asked.before is None else start + asked.before
        after = start + scenario.years - act.year if asked.years is None else asked.years
        circle = ", ".join(f"{key} = {value!r}" for key, value in act.gap.model_dump().items())
        cut = f"kind = 'harvest', method = 'gap', year = {gap_year}, gap = {{ {circle} }}"
        changes = [f"years={gap_year - start + after}", f"acts=[{{ {cut} }}]"]
        if asked.seed is not None:
            changes.append(f"seed={asked.seed}")
        scenario = scenario.with_overrides(changes)
        asked.out.mkdir(parents=True, exist_ok=True)
        runs, watched = grow_both(scenario, asked.out, gap_year, asked.threads)
        hectares = np.pi * act.gap.radius_m**2 / 10_000.0
        times = {
            name: over_time(watched[name], newcomers(run, act.gap, gap_year), hectares)
            for name, run in runs.items()
        }
        both = pd.concat(times, axis=1)
        both.columns = [f"{column}_{name}" for name, column in both.columns]
        both.insert(0, "years", both.index - gap_year)
        both.to_csv(asked.out / "by_year.csv")
        shown = both[both["years"].isin(SHOWN)].sort_index(axis=1).set_index("years").reset_index()
        report(shown, asked.out / "over_time.csv", "the ground of the gap, per ha of it")
        numbers = by_species(runs, act.gap, gap_year, hectares)
        report(numbers, asked.out / "by_species.csv", "trees recruited on it since")
        save(draw(runs, times, act.gap, gap_year), asked.out / "gap_dynamics.png")
        for run in runs.values():
            run.close()


if __name__ == "__main__":
    main()
