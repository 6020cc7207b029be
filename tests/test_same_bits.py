"""The same scenario gives the same bits: again, on more threads, resumed, beside another stand."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from forest._threads import using_threads
from forest.record.checkpoint import latest_checkpoint, write_checkpoint
from forest.record.run import Run, open_run
from forest.simulation import simulate
from forest.stand import Stand
from tests.forks import run_and_die
from tests.tiny import (
    YEARS,
    assert_same_runs,
    assert_same_state,
    assert_same_years,
    steps,
    tiny,
)

ENVIRONMENTS = {
    "shadow": ["environment={shadow={}}"],
    "canopy": ["environment={shadow={}, canopy={}}"],
    "markers": ["environment={shadow={}, markers={release=false}}"],
    "markers released": ["environment={markers={release=true}}"],
}
MECHANICS = {
    "bending": ["mechanics={wind_m_s=15}"],
    "bending, growth in the wind": ["mechanics={wind_m_s=15, wind_growth=true}"],
    "bending, printed righting": ["mechanics={righting='beta'}"],
    "stiff": ["mechanics={bending=false}"],
}
MATRIX = list(
    itertools.product(
        ["mass_balance", "paper"], ["borchert_honda", "priority", "balance"], ENVIRONMENTS
    )
)


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run in one go, on one thread."""
    return simulate(tiny(), tmp_path_factory.mktemp("straight") / "run.h5", threads=1)


def test_run_twice(straight: Run, tmp_path: Path) -> None:
    assert_same_runs(straight, simulate(tiny(), tmp_path / "run.h5", threads=1))
    assert straight.trees.height_m.max() > 1.0
    assert not straight.rings.empty


@pytest.mark.usefixtures("three_threads")
def test_two_threads(straight: Run, tmp_path: Path) -> None:
    assert_same_runs(straight, simulate(tiny(), tmp_path / "run.h5", threads=2))


def test_another_seed_is_another_stand(straight: Run, tmp_path: Path) -> None:
    with simulate(tiny("seed=2"), tmp_path / "run.h5") as other:
        assert not straight.trees.height_m.equals(other.trees.height_m)


@pytest.mark.parametrize("first", [1, 3, 5])
def test_more_years_later(straight: Run, tmp_path: Path, first: int) -> None:
    """N years, then resumed for M more, are N + M years; a year of its own samples may differ."""
    ids = "output.sample_trees={ids=[1, 4]}"
    out = tmp_path / "run.h5"
    simulate(tiny(ids, f"years={first}"), out).close()
    with (
        simulate(tiny(ids), tmp_path / "whole.h5") as whole,
        simulate(tiny(ids), out, resume=True) as run,
    ):
        assert_same_runs(whole, run)
        assert run.scenario == tiny(ids)
        assert run.digest == run.provenance["scenario_sha256"] == tiny(ids).digest()
        assert [session["years_before"] for session in run.provenance["sessions"]] == [0, first]


@pytest.mark.parametrize("mechanics", ["", "mechanics={}"])
def test_killed_and_resumed(straight: Run, tmp_path: Path, mechanics: str) -> None:
    """SIGKILL somewhere in a year, in its record or its checkpoint; three times."""
    changes = [mechanics] if mechanics else []
    if mechanics:
        straight = simulate(tiny(mechanics), tmp_path / "straight.h5", threads=1)
    out = tmp_path / "run.h5"
    every = "output.checkpoint_every_years=1"
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(tiny(every, *changes).to_toml())
    for year, moment in ((2002, 0.05), (2004, 0.5), (2006, 0.9)):
        run_and_die(scenario, out, after=year, share=moment)
    assert latest_checkpoint(out) is not None
    with simulate(tiny(every, *changes), out, resume=True) as run:
        assert len(run.provenance["sessions"]) > 1
        assert_same_runs(straight, run)


@pytest.mark.parametrize(("mode", "fate", "environment"), MATRIX)
def test_restored_stand_goes_on_the_same(
    tmp_path: Path, mode: str, fate: str, environment: str
) -> None:
    scenario = tiny(
        f"mode={mode}",
        f"growth.bud_fate={fate}",
        "planting.density_ha=500",
        *ENVIRONMENTS[environment],
    )
    whole = Stand(scenario)
    before = steps(whole, 3)
    arrays, meta = whole.state()
    write_checkpoint(tmp_path / "run.h5", arrays, meta, step=3)
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    restored = Stand.restore(scenario, *found)
    assert_same_state(whole, restored)
    after = steps(whole, 3)
    assert_same_years(after, steps(restored, 3))
    assert_same_state(whole, restored)
    assert_same_years([*before, *after], steps(Stand(scenario), 6))


@pytest.mark.parametrize("mechanics", MECHANICS)
def test_bent_stand_on_threads_and_restored(tmp_path: Path, mechanics: str) -> None:
    """One thread, two, and a checkpoint amid the years: the same shapes, rings and stability."""
    scenario = tiny(*MECHANICS[mechanics])
    whole = Stand(scenario)
    with using_threads(1):
        before = steps(whole, 4)
        arrays, meta = whole.state()
        write_checkpoint(tmp_path / "run.h5", arrays, meta, step=4)
        after = steps(whole, 4)
    assert "stability" in after[-1].tables
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    restored = Stand.restore(scenario, *found)
    other = Stand(scenario)
    with using_threads(2):
        assert_same_years(after, steps(restored, 4))
        assert_same_years([*before, *after], steps(other, 8))
    assert_same_state(whole, restored)
    assert_same_state(whole, other)


def test_a_climate_goes_on_where_it_was(tmp_path: Path) -> None:
    """Drawn, given and remembered years are the same after a checkpoint."""
    rows = ", ".join(f"{{year = {2001 + k}, temperature_c = {7 + k % 3}}}" for k in range(YEARS))
    process = "{mean = 0, sd = 1, autocorrelation = 0.6, extreme_shift_sd = -2}"
    scenario = tiny(
        f"climate.series=[{rows}]",
        f"climate.generator={{extreme_probability = 0.2, drought_index = {process}}}",
    )
    whole = Stand(scenario)
    steps(whole, 4)
    arrays, meta = whole.state()
    write_checkpoint(tmp_path / "run.h5", arrays, meta, step=4)
    after = steps(whole, 4)
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    assert_same_years(after, steps(Stand.restore(scenario, *found), 4))
    factors = [record.tables["climate"]["factor"] for record in after]
    assert len({tuple(pair) for pair in factors}) == 4
    assert (factors[0] != factors[0][0]).any()  # each species answers in its own way


def test_two_stands_do_not_touch_each_other() -> None:
    one, other = tiny(), tiny("mode=paper", "seed=5", "environment={shadow={}, markers={}}")
    alone = steps(Stand(one), YEARS), steps(Stand(other), YEARS)
    together = Stand(one), Stand(other)
    records: tuple[list, list] = ([], [])
    for _ in range(YEARS):
        for stand, kept in zip(together, records, strict=True):
            kept.append(stand.step())
    for expected, found in zip(alone, records, strict=True):
        assert_same_years(expected, found)


def test_simulate_and_step_agree(straight: Run) -> None:
    heights = [record.tables["trees"]["height_m"] for record in steps(Stand(tiny()), YEARS)]
    with open_run(straight.path) as run:
        for year, expected in zip(run.years, heights, strict=True):
            found = run.read("trees", ["height_m"], years=(year, year)).height_m
            assert found.tolist() == expected.tolist()
