"""Runs with deaths of all causes: the ledger by cause, same bits, deaths that cannot be."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from forest._threads import using_threads
from forest.errors import ActError
from forest.record.checkpoint import latest_checkpoint, write_checkpoint
from forest.record.ledger import LedgerError, by_cause
from forest.record.run import Run, open_run
from forest.record.schema import CAUSES, DEATH_CAUSES, FELLING_CAUSES
from forest.scenario.mortality import Disturbance
from forest.simulation import simulate
from forest.stand import Stand
from tests.tiny import (
    TOML,
    assert_same_runs,
    assert_same_state,
    assert_same_years,
    forest,
    steps,
    tiny,
)

EVENTS = (
    "mortality.events=[{year=2004, tree_id=3, cause='insects'}, {year=2005, share=0.2},"
    " {year=2006, x_m=5, y_m=5, radius_m=4, cause='wind'}]"
)
RULES = [
    "planting.density_ha=4000",
    "output.sample_trees={ids=[1, 3]}",
    "species.fagus_sylvatica.mortality.background_per_year=0.1",
    "species.pinus_sylvestris.mortality={longevity_years=9, snag_half_life_years=1}",
    "mortality={age=true, background=true, buckling=true, snags=true}",
    "mechanics={bending=false}",
    "acts=[{kind='fell', year=2007, tree_ids=[2], cause='tending'}]",
    EVENTS,
]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run in one go, on one thread."""
    return simulate(tiny(*RULES), tmp_path_factory.mktemp("all") / "run.h5", threads=1)


def test_the_ledger_by_cause(run: Run) -> None:
    ledger = run.ledger
    assert ledger.index.tolist() == list(range(2001, 2009))
    events = run.events
    for name, kind, cause in (
        ("died_age", "died", "age"),
        ("died_background", "died", "background"),
        ("died_other", "died", "other"),
        ("felled_tending", "felled", "tending"),
        ("windthrown", "windthrown", "wind"),
    ):
        of_cause = events[(events.kind == kind) & (events.cause == cause)]
        assert len(of_cause), name
        assert ledger[name].sum() == len(of_cause)
    assert ledger.died_insects.to_dict()[2004] == 1
    died = ledger[[name for name in ledger if name.startswith("died_")]].sum(axis=1)
    assert died.tolist() == run.population.died.tolist()
    assert ledger.living.tolist() == run.trees.groupby("year").size().tolist()


def test_a_ledger_that_does_not_balance(run: Run) -> None:
    lost = run.events.drop(run.events.index[run.events.year == 2004][0])
    with pytest.raises(LedgerError, match="2004"):
        by_cause(run.population, lost)
    late = run.population.copy()
    late.loc[late.year >= 2006, ["living_before", "living"]] += 1
    with pytest.raises(LedgerError, match="2006"):
        by_cause(late, run.events)


def test_causes_have_their_columns() -> None:
    given = set(Disturbance.model_json_schema()["properties"]["cause"]["enum"])
    assert given - {"wind"} < set(DEATH_CAUSES)
    assert {*DEATH_CAUSES, *FELLING_CAUSES, "wind", "none"} == set(CAUSES)


def test_unusual_events_get_columns_of_their_own(run: Run) -> None:
    events = run.events.copy()
    row = events.index[events.kind == "felled"][0]
    events["cause"] = pd.Categorical(events["cause"], CAUSES)
    events.loc[row, "cause"] = "none"
    assert by_cause(run.population, events).felled_none.sum() == 1


def test_info_tells_the_causes(run: Run) -> None:
    code, out, _ = forest("info", run.path)
    assert code == 0
    text = " ".join(out.split())
    assert "40 planted" in text
    for name in ("died (background)", "died (insects)", "felled (tending)", "windthrown"):
        assert name in text


@pytest.mark.usefixtures("three_threads")
def test_same_bits_on_threads_and_resumed(run: Run, tmp_path: Path) -> None:
    with simulate(tiny(*RULES), tmp_path / "two.h5", threads=2) as two:
        assert_same_runs(run, two)
    simulate(
        tiny(*RULES[:-2], "years=3"), tmp_path / "run.h5"
    ).close()  # deaths and acts come later
    with simulate(tiny(*RULES), tmp_path / "run.h5", resume=True) as resumed:
        assert_same_runs(run, resumed)
    assert run.deadwood.fallen_snags_ha.sum() > 0.0


def test_a_restored_stand_goes_on_the_same(tmp_path: Path) -> None:
    scenario = tiny(*RULES)
    whole = Stand(scenario)
    steps(whole, 5)
    assert len(whole.snags)
    arrays, meta = whole.state()
    write_checkpoint(tmp_path / "run.h5", arrays, meta, step=5)
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    restored = Stand.restore(scenario, *found)
    assert_same_state(whole, restored)
    with using_threads(2):
        after = steps(restored, 3)
    assert_same_years(steps(whole, 3), after)
    assert_same_state(whole, restored)


def test_years_on_file_keep_their_deaths(run: Run, tmp_path: Path) -> None:
    """A run may be resumed with other deaths to come, not with others that have been."""
    out = tmp_path / "run.h5"
    simulate(tiny("years=3", "mortality.events=[{year=2002, tree_id=1}]"), out).close()
    toml = tmp_path / "other.toml"
    toml.write_text(tiny("mortality.events=[{year=2002, tree_id=2}]").to_toml())
    before = out.read_bytes()
    code, _, err = forest("run", toml, "--out", out, "--resume")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "made by a different scenario" in err
    assert out.read_bytes() == before


def test_deaths_that_cannot_be(tmp_path: Path) -> None:
    """One line, exit 2, and all years before on file; corrected, the run goes on."""
    scenario, out = tmp_path / "tiny.toml", tmp_path / "run.h5"
    (tmp_path / "deaths.csv").write_text("year,tree_id,share\n2003,,1\n2005,1,\n")
    scenario.write_text(TOML + '\n[mortality]\nevents = "deaths.csv"\n')
    code, _, err = forest("run", scenario, "--out", out)
    assert code == 2
    (line,) = (line for line in err.splitlines() if line.startswith("forest: error: "))
    assert "'deaths.csv' line 3 in 2005: no living tree has the id 1" in line
    (tmp_path / "deaths.csv").write_text("year,tree_id,share\n2003,,1\n")
    code, _, err = forest("run", scenario, "--out", out, "--resume")
    assert code == 0, err
    with open_run(out) as run:
        assert run.ledger.died_other.to_dict()[2003] == 10
        assert run.years[-1] == 2008


def test_a_death_in_the_first_year_is_refused_before_it() -> None:
    with pytest.raises(ActError, match=r"mortality.events\[0\].tree_id in 2001: .*id 99"):
        Stand(tiny("mortality.events=[{year=2001, tree_id=99}]"))


def test_bad_rows_leave_no_file(tmp_path: Path) -> None:
    (tmp_path / "deaths.csv").write_text("year,share\n2003,half\n")
    scenario = tmp_path / "tiny.toml"
    scenario.write_text(TOML + '\n[mortality]\nevents = "deaths.csv"\n')
    for command in (("check", scenario), ("run", scenario, "--out", tmp_path / "run.h5")):
        code, out, err = forest(*command)
        assert (code, out) == (2, "")
        assert err == (
            "forest: error: tiny.toml: mortality.events: 'deaths.csv' line 2, column 'share': "
            "'half' is not allowed; expected a number\n"
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["deaths.csv", "tiny.toml"]


def test_paper_mode_knows_no_suppression() -> None:
    rules = "mortality={background=true, snags=true}"
    often = "species.fagus_sylvatica.mortality.background_per_year=0.3"
    records = steps(Stand(tiny("mode=paper", rules, often)), 6)
    causes = {CAUSES[c] for r in records for c in r.tables["events"]["cause"]}
    assert causes == {"none", "background"}
    assert records[-1].tables["deadwood"]["lying_tha"][-1] > 0.0


def test_trees_felled_in_the_year_are_spared_the_rest() -> None:
    fell = "acts=[{kind='fell', year=2003, tree_ids=[1]}]"
    stand = Stand(tiny(fell, "mortality.events=[{year=2003, tree_id=1}]"))
    events = steps(stand, 3)[-1].tables["events"]
    assert events["tree_id"].tolist() == [1]
    assert [CAUSES[cause] for cause in events["cause"]] == ["harvest"]
