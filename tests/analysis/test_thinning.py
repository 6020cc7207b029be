"""The study of treatments, on a stand that is thinned, harvested and left alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis import thinning
from forest.record.run import Run
from forest.scenario import Scenario
from forest.simulation import simulate
from tests.analysis.conftest import DENSE_STAND

ACTS = """acts=[
{kind='thin', year=1975, method='below', share_n=0.3},
{kind='thin', when='relative_density > 0.1', from_year=1980,
 method='above', share_n=0.2, at_most=1},
{kind='harvest', year=1985, method='diameter_limit', limit_cm=8},
{kind='thin', year=1985, method='random', share_n=0.5}]"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Run, Run]]:
    folder: Path = tmp_path_factory.mktemp("thinned")
    short = Scenario.from_toml(DENSE_STAND).with_overrides(
        ["years=27", "planting.density_ha=3000", "output.sample_trees={}"]
    )
    treated = short.with_overrides([" ".join(ACTS.split())])
    with (
        simulate(treated, folder / "treated.h5") as run,
        simulate(short, folder / "alone.h5") as alone,
    ):
        yield run, alone


def test_each_treatment(runs: tuple[Run, Run]) -> None:
    table = thinning.treatments(runs[0])
    assert table["act"].tolist() == [0, 1, 2, 3]
    assert table["kind"].tolist() == ["thin", "thin", "harvest", "thin"]
    assert (table["n_before"] - table["n_after"]).tolist() == pytest.approx(
        table["removed_ha"].tolist()
    )
    assert (table["removed_ha"] > 0.0).all()
    assert table["ratio"][0] < 1.0 < table["ratio"][1]
    assert np.isnan(table["ratio"][2:]).all()  # two acts in one year


def test_removals_and_production_add_up(runs: tuple[Run, Run]) -> None:
    run, alone = runs
    events = run.events
    felled = events[events["kind"] == "felled"]
    gone = thinning.removals(run)
    assert gone["removed"].sum() * 0.01 == pytest.approx(felled["dbh_cm"].notna().sum())
    made = thinning.production(run)
    assert made["removed"].iloc[-1] == pytest.approx(felled["volume_m3"].sum() / 0.01)
    whole = run.stand[run.stand["species"] == "all"]
    assert made["removed"].iloc[-1] == pytest.approx(whole["removed_volume_m3ha"].sum())
    assert (made["total"].diff().iloc[1:] > 0).sum() > 20
    without = thinning.production(alone)
    assert without["removed"].max() == 0.0
    pd.testing.assert_frame_equal(made.loc[:1974], without.loc[:1974])


def test_it_draws_both(
    runs: tuple[Run, Run], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    to = tmp_path / "figure.png"
    run, alone = (str(run.path) for run in runs)
    thinning.main([run, "--to", str(to), "--against", alone])
    assert to.read_bytes().startswith(b"\x89PNG")
    assert len(capsys.readouterr().out.splitlines()) == 5
    with pytest.raises(SystemExit) as end:
        thinning.main([alone, "--to", str(to)])
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith("has no treatment; expected a run with acts\n")
