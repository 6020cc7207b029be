"""A sweep read as a landscape: dominance, stages, turnover, sums by area, the command."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import forest as public
from forest.ensemble.design import PlannedRun, plan
from forest.ensemble.landscape import NONE, Landscape, _changes, _plot, landscape
from forest.ensemble.manifest import Manifest, file_of
from forest.errors import InputError
from forest.measure.stages import STAGES, development_stage
from forest.record.run import open_run
from forest.simulation import simulate
from forest.view.landscape_picture import draw_landscape
from forest.view.landscape_table import landscape_table
from tests.tiny import forest, tiny

YEARS = 7
LAST = 2000 + YEARS
SIDES = ([10, 10], [14, 10])
LEAST = 0.02


def _grown(runs: list[PlannedRun], folder: Path) -> None:
    """Make a sweep's folder without a cluster; the last run has failed."""
    manifest = Manifest(folder, runs)
    for run in runs[:-1]:
        simulate(run.scenario, folder / file_of(run), threads=1).close()
        manifest.done(run, 1.0)
    manifest.failed(runs[-1], "for this test")
    manifest.write()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five plots, of which two are larger, and a failed one."""
    folder = tmp_path_factory.mktemp("landscape")
    base = tiny(f"years={YEARS}", "output.sample_trees={}", "site.productivity=2")
    _grown(plan({"tiny": base}, {"plot.size_m": list(SIDES)}, 3), folder)
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> Landscape:
    return landscape(folder, least_basal_area_m2ha=LEAST)


def test_a_row_per_plot_and_year(folder: Path, found: Landscape):
    plots = found.plots
    assert len(plots) == 5 * YEARS
    assert found.years == tuple(range(2001, LAST + 1))
    assert plots.groupby("run")["area_ha"].first().tolist() == pytest.approx(
        [0.01] * 3 + [0.014] * 2
    )
    assert list(plots.columns[:3]) == ["run", "scenario", "plot.size_m"]
    last = plots[plots["year"] == LAST].iloc[3]
    with open_run(folder / f"{last['run']}.h5") as run:
        of = run.stand[run.stand["year"] == LAST].set_index("species")
    ground = of["basal_area_m2ha"].drop("all")
    assert last["dominant"] == ground.idxmax()
    assert last["dominant_share"] == pytest.approx(ground.max() / ground.sum(), rel=1e-6)
    whole = of.loc["all"]
    for name in ("top_height_m", "qmd_cm", "basal_area_m2ha", "n_ha", "volume_m3ha", "biomass_tha"):
        assert last[name] == whole[name]
    assert last["stage"] == development_stage(
        [whole["top_height_m"]], [whole["qmd_cm"]], [whole["basal_area_m2ha"]]
    )
    assert (plots.loc[plots["basal_area_m2ha"] < LEAST, "dominant"] == NONE).all()
    assert plots.loc[plots["dominant"] == NONE, "dominant_share"].isna().all()
    assert {NONE} < set(plots["dominant"])


def test_totals_are_weighed_by_area(found: Landscape):
    last = found.plots[found.plots["year"] == LAST]
    row = found.totals.set_index("year").loc[LAST]
    area = last["area_ha"].to_numpy()
    assert (row["plots"], row["area_ha"]) == (5, pytest.approx(0.058))
    for name in ("n_ha", "basal_area_m2ha", "volume_m3ha", "biomass_tha", "top_height_m"):
        assert row[name] == pytest.approx(np.average(last[name], weights=area))
        assert row[f"{name}_sd"] == pytest.approx(np.std(last[name], ddof=1), rel=1e-5)
    for shares, column in ((found.dominants, "dominant"), (found.stages, "stage")):
        assert shares.sum(axis=1).to_numpy() == pytest.approx(1.0)
        for name in shares.columns:
            of = area[(last[column] == name).to_numpy()].sum() / 0.058
            assert shares.loc[LAST, name] == pytest.approx(of)
    assert list(found.stages.columns) == list(STAGES)


def test_species_of_the_landscape(found: Landscape):
    of = found.species[found.species["year"] == LAST].set_index("species")
    assert of["share"].sum() == pytest.approx(1.0)
    assert of["plot_share"].sum() == pytest.approx(1.0)
    total = found.totals.set_index("year").loc[LAST]
    for name in ("basal_area_m2ha", "volume_m3ha", "biomass_tha"):
        assert of[name].sum() == pytest.approx(total[name], rel=1e-6)
    own = found.by_species.query(f"year == {LAST} and species == 'fagus_sylvatica'")["share"]
    assert of.loc["fagus_sylvatica", "plot_share_sd"] == pytest.approx(own.std(), rel=1e-5)
    assert math.isnan(found.species["share"].iloc[0])  # seedlings have no basal area


def test_turnover_counts_a_species_that_follows_another():
    """A year without any is not one; nor is the first that dominates."""
    dominant = pd.Series([NONE, "a", "a", NONE, "a", NONE, "b", "b", "a"])
    assert _changes(dominant).tolist() == [False] * 6 + [True, False, True]


def test_a_plot_by_hand():
    nan = math.nan
    rows = [
        (1, "a", 0.0), (1, "b", 0.0), (1, "all", 0.0),
        (2, "a", 3.0), (2, "b", 1.0), (2, "all", 4.0),
        (3, "a", 2.0), (3, "b", 6.0), (3, "all", 8.0),
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["year", "species", "basal_area_m2ha"])
    table["top_height_m"] = [nan] * 3 + [9.0] * 6
    table["qmd_cm"] = [nan] * 3 + [8.0] * 6
    for name in ("n_ha", "volume_m3ha", "biomass_tha"):
        table[name] = 1.0
    whole, each = _plot(table, 1.0)
    assert whole["dominant"].tolist() == [NONE, "a", "b"]
    assert whole["dominant_share"].tolist() == pytest.approx([nan, 0.75, 0.75], nan_ok=True)
    assert whole["stage"].tolist() == ["bare", "pole", "pole"]
    assert whole["changed"].tolist() == [False, False, True]
    assert each["share"].tolist() == pytest.approx([nan, nan, 0.75, 0.25, 0.25, 0.75], nan_ok=True)


def test_public_names(folder: Path, found: Landscape):
    assert public.landscape is landscape
    again = public.open_sweep(folder).landscape(least_basal_area_m2ha=LEAST)
    pd.testing.assert_frame_equal(again.plots, found.plots)


def test_the_command(folder: Path, tmp_path: Path, found: Landscape):
    files = [tmp_path / name for name in ("l.png", "plots.csv", "totals.parquet")]
    words = ["--to", files[0], "--csv", files[1], "--totals", files[2]]
    words += ["--least-basal-area", str(LEAST)]
    code, out, err = forest("landscape", folder, "--year", "2006", *words)
    assert (code, err) == (0, "")
    assert "2006" in out
    assert files[0].read_bytes().startswith(b"\x89PNG")
    assert len(pd.read_csv(files[1])) == 5 * YEARS
    assert pd.read_parquet(files[2])["turnover"].tolist() == found.totals["turnover"].tolist()
    assert forest("landscape", folder, *words)[0] == 2
    assert forest("landscape", folder, *words, "--force")[0] == 0


def test_the_table_sums_up(found: Landscape):
    table = landscape_table(found, LAST)
    columns = [list(column.cells) for column in table.columns]
    names, plots, areas = columns[0], columns[1], columns[2]
    split = names.index("")
    assert sum(map(int, plots[:split])) == 5
    assert sum(map(int, plots[split + 1 : -2])) == 5
    assert (names[-1], plots[-1], areas[-1]) == ("all", "5", "100")


def test_a_single_plot_of_one_year_is_drawn(tmp_path: Path):
    _grown(plan({"tiny": tiny("years=1")}, {}, 2), tmp_path)
    alone = landscape(tmp_path)
    draw_landscape(alone, tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 5000
    assert math.isnan(alone.totals["basal_area_m2ha_sd"].item())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--year", "1999"), "no year 1999; expected a year from 2001 to 2007"),
        (("--to", "x.pdf"), "unknown format '.pdf'"),
        (("--least-basal-area", "-1"), "least_basal_area_m2ha: -1.0; expected 0 or more"),
        (("--csv", "x.txt"), "unknown format '.txt'"),
        (("--totals", "nowhere/x.csv"), "cannot be written"),
    ],
)
def test_the_command_refuses_with_2(folder: Path, words: tuple[str, ...], says: str):
    code, _, err = forest("landscape", folder, *words)
    assert code == 2
    assert says in err
    assert err.count("\n") == 1


def test_a_folder_that_is_no_sweep(tmp_path: Path):
    code, out, err = forest("landscape", tmp_path)
    assert (code, out) == (2, "")
    assert "holds no sweep" in err
    runs = plan({"tiny": tiny("years=1")}, {}, 1)
    manifest = Manifest(tmp_path, runs)
    manifest.write()
    with pytest.raises(InputError, match="no finished run holds a stand table"):
        landscape(tmp_path)
    with pytest.raises(InputError, match="least_basal_area_m2ha: -1"):
        landscape(tmp_path, least_basal_area_m2ha=-1)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--csv", "plots.csv", "--totals", "no/years.csv"], "no/years.csv: cannot be written"),
        (["--csv", "plots.csv", "--totals", "years.xls"], "unknown format '.xls'"),
        (["--csv", "plots.csv", "--totals", "old.csv"], "old.csv: exists already"),
        (["--csv", "plots.csv", "--totals", "./plots.csv"], "plots.csv: is asked for twice"),
        (["--csv", "plots.csv", "--to", "plots.csv"], "plots.csv: unknown format '.csv'"),
    ],
)
def test_all_targets_are_checked_before_any_is_written(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text("mine")
    code, out, err = forest("landscape", folder, *words)
    assert (code, out) == (2, "")
    assert says in err
    assert [path.name for path in tmp_path.iterdir()] == ["old.csv"]
