"""The whole forest: no tree comes or goes without its event, and nothing hangs on how it is run."""

from __future__ import annotations

import signal
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from forest.record.checkpoint import latest_checkpoint, write_checkpoint
from forest.record.ledger import CARBON_TOLERANCE, by_cause, check_carbon, population_row
from forest.record.run import Run, open_run
from forest.record.schema import CAUSES, DEATH_CAUSES, EVENT_KINDS, FELLING_CAUSES, STAYING_KINDS
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand
from tests.everything import TOML, VARIANTS, YEARS, everything
from tests.forks import run_and_die
from tests.tiny import assert_same_runs, assert_same_state, assert_same_years, steps

SCENARIOS = sorted(
    path
    for path in (Path(__file__).parents[1] / "scenarios").rglob("*.toml")
    if path.parent.name != "scenery"  # scenes to look at, not to grow
)

#: The causes that each kind of event may have.
OF_KIND = {
    "planted": {"none"},
    "recruited": {"none"},
    "pruned": {"none"},
    "marked": {"none"},
    "bent": {"none"},
    "cracked": {"none"},
    "died": set(DEATH_CAUSES),
    "felled": set(FELLING_CAUSES),
    "windthrown": {"wind"},
}
HAPPENS = {
    "upright": {"suppression", "age", "background", "fire", "insects", "other"},
    "bending": {"buckling", "no_buds", "suppression", "age", "background", "fire", "insects"},
}


@pytest.fixture(scope="module", params=VARIANTS)
def variant(request: pytest.FixtureRequest) -> str:
    """The name of a variant of the forest in which all happens."""
    return str(request.param)


@pytest.fixture(scope="module")
def straight(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Its run in one go, on one thread."""
    out = tmp_path_factory.mktemp(variant) / "run.h5"
    return simulate(everything(*VARIANTS[variant]), out, threads=1)


def assert_follow(living: Iterable[tuple[int, set[int]]], events: pd.DataFrame) -> None:
    """Check that events, tree by tree, lead from the living of each year to those of the next."""
    here: set[int] = set()
    seen: set[int] = set()
    for year, now in living:
        of_year = events[events["year"] == year]
        ids = {kind: of_year.loc[of_year["kind"] == kind, "tree_id"].tolist() for kind in OF_KIND}
        came = ids["planted"] + ids["recruited"]
        gone = ids["died"] + ids["felled"] + ids["windthrown"]
        assert len(set(came)) == len(came), year
        assert len(set(gone)) == len(gone), year
        assert not seen & set(came), year  # an id is never used twice
        here |= set(came)
        seen |= here
        assert set(gone) <= here, year
        assert set(ids["pruned"]) <= here, year
        here -= set(gone)
        assert here == now, year
    for kind, causes in events.groupby("kind")["cause"]:
        assert set(causes) <= OF_KIND[str(kind)], kind


def _named(events: pd.DataFrame) -> pd.DataFrame:
    return events.assign(kind=events["kind"].astype(str), cause=events["cause"].astype(str))


def test_all_of_it_happens(variant: str, straight: Run) -> None:
    """The proofs below are of a forest in which every part has its say."""
    events = _named(straight.events)
    assert set(events["kind"]) == set(OF_KIND)
    assert HAPPENS[variant] <= set(events["cause"])
    assert set(FELLING_CAUSES) <= set(events["cause"])
    thrown = straight.storms[straight.storms["outcome"] != "stood"]
    assert 0 < len(thrown) < (events["kind"] == "windthrown").sum()  # some by a given event
    assert (straight.treatments.groupby("act").year.nunique() > 1).any()  # a trigger, twice
    assert straight.regeneration.sprouts_ha.sum() > 0.0
    assert straight.deadwood.snags_ha.max() > 0.0
    assert straight.climate.factor.nunique() > YEARS
    assert (straight.events.mother_id > 0).any()


def test_every_tree_is_accounted_for(straight: Run) -> None:
    living = straight.trees.groupby("year").tree_id.agg(set)
    assert_follow(living.items(), _named(straight.events))
    ledger = straight.ledger
    causes = _named(straight.events).groupby(["year", "kind", "cause"]).size()
    for (year, kind, cause), n in causes.items():
        name = f"{kind}_{cause}" if kind in ("died", "felled") else kind
        if kind not in STAYING_KINDS:
            assert ledger.loc[year, name] == n
    assert ledger.living.tolist() == living.map(len).tolist()
    assert ledger.living_before.tolist() == [0, *ledger.living.tolist()[:-1]]


def test_all_dry_mass_is_accounted_for(straight: Run) -> None:
    carbon = straight.carbon
    spent = carbon[["leaves", "upkeep", "extension", "ring", "reserve_change"]]
    gap = (carbon["income"] - spent.sum(axis=1)).abs()
    largest = np.maximum(carbon["income"].abs(), spent.abs().max(axis=1))
    assert (gap <= CARBON_TOLERANCE * largest).all()
    assert (carbon["income"] > 0.0).any()


def test_every_seedling_is_accounted_for(straight: Run) -> None:
    table = straight.regeneration.pivot(index="year", columns="species")
    came = table["germinated_ha"] + table["sprouts_ha"]
    went = table["died_ha"] + table["crowded_ha"] + table["recruits_ha"]
    np.testing.assert_allclose(table["n_ha"].diff().iloc[1:], (came - went).iloc[1:], atol=1e-6)
    told = straight.regeneration.groupby("year").recruits_ha.sum() / 100.0
    recruited = straight.ledger.recruited
    assert recruited.tolist()[1:] == pytest.approx(told.tolist()[:-1])  # trees a year later


@pytest.mark.parametrize("threads", [2, 3])
def test_same_on_threads(
    variant: str, straight: Run, threads: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FOREST_THREADS", "3")
    scenario = everything(*VARIANTS[variant])
    with simulate(scenario, tmp_path / "run.h5", threads=threads) as other:
        assert_same_runs(straight, other)


def test_same_killed_twice(variant: str, straight: Run, tmp_path: Path) -> None:
    """SIGKILL in the year after 2005 and after 2010; some years are grown again, two to four."""
    scenario, out = tmp_path / "everything.toml", tmp_path / "run.h5"
    scenario.write_text(everything(*VARIANTS[variant]).to_toml())
    for year in (2005, 2010):
        assert run_and_die(scenario, out, after=year, share=0.5) == -signal.SIGKILL
    with open_run(out) as cut:
        assert 2010 <= cut.years[-1] < 2014
    with simulate(Scenario.load(scenario), out, resume=True) as run:
        assert len(run.provenance["sessions"]) == 3
        assert_same_runs(straight, run)


def test_same_with_more_years_later(variant: str, straight: Run, tmp_path: Path) -> None:
    """What the scenario says of years to come, acts, storms and deaths, may be said later."""
    overrides = (*VARIANTS[variant], "output.sample_trees={ids=[1, 2]}")
    text = TOML[: TOML.index('[[acts]]\nkind = "harvest"')]
    for old, new in ((f"\nyears = {YEARS}", "\nyears = 9"), ("storms = [{ year = 2011", "# ")):
        assert old in text
        text = text.replace(old, new)
    short = Scenario.from_toml(text).with_overrides(overrides)
    out = tmp_path / "run.h5"
    simulate(short, out).close()
    with (
        simulate(everything(*overrides), out, resume=True) as run,
        simulate(everything(*overrides), tmp_path / "whole.h5") as whole,
    ):
        assert_same_runs(whole, run)
        assert run.trees.equals(straight.trees)


@pytest.mark.parametrize("years", [4, 9])
def test_a_restored_stand_goes_on_the_same(variant: str, years: int, tmp_path: Path) -> None:
    """All that the next years need is in a checkpoint, and nothing but it decides."""
    scenario = everything(*VARIANTS[variant])
    whole = Stand(scenario)
    steps(whole, years)
    arrays, meta = whole.state()
    write_checkpoint(tmp_path / "run.h5", arrays, meta, step=years)
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    restored = Stand.restore(scenario, *found)
    assert_same_state(whole, restored)
    for _ in range(YEARS - years):
        assert_same_years([whole.step()], [restored.step()])
        assert_same_state(whole, restored)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_the_ledgers_of_shipped_scenarios(path: Path) -> None:
    """Every scenario that is shipped, for its first years, whatever comes later in it."""
    stand = Stand(Scenario.load(path))
    living: list[tuple[int, set[int]]] = []
    events, population = [], []
    for record in steps(stand, min(4, stand.scenario.years)):
        trees, of_year = record.tables["trees"], record.tables["events"]
        before = len(living[-1][1]) if living else 0
        population.append(pd.DataFrame(population_row(record.year, before, trees, of_year)))
        check_carbon(record.year, record.tables["carbon"])
        living.append((record.year, set(trees["tree_id"].tolist())))
        events.append(pd.DataFrame(of_year))
    told = pd.concat(events)
    told["kind"] = [EVENT_KINDS[code] for code in told["kind"]]
    told["cause"] = [CAUSES[code] for code in told["cause"]]
    assert_follow(living, told)
    ledger = by_cause(pd.concat(population), told)
    assert ledger.living.tolist() == [len(now) for _, now in living]
