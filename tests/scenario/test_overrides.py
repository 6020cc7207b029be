"""A shorter or longer run of a file: what lies beyond it, and what messages name."""

from __future__ import annotations

from pathlib import Path

import pytest

from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.summary import summary
from forest.simulation import simulate
from forest.stand import Stand
from tests.tiny import TOML, assert_same_runs, forest, steps

BEYOND = """
acts = [
    { kind = "fell", year = 2007, tree_ids = [1] },
    { kind = "thin", method = "below", n_ha = 900, years = [2003, 2008] },
    { kind = "thin", method = "below", n_ha = 800, when = "n_ha > 1e6", from_year = 2006 },
]
mortality = { events = "deaths.csv" }
wind = { storms = [{ year = 2006, speed_m_s = 30 }] }
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file of eight years with something due until the last; its climate covers six."""
    (tmp_path / "deaths.csv").write_text("year,share\n2008,0.5\n")
    rows = "".join(f"{year},1\n" for year in range(2001, 2007))
    (tmp_path / "years.csv").write_text("year,growth_index\n" + rows)
    path = tmp_path / "file.toml"
    text = TOML.replace("climate = { noise_sd = 0.15 }", 'climate = { file = "years.csv" }')
    assert text != TOML
    path.write_text(text.replace("dbh_quantiles", "at_year = 2007, dbh_quantiles") + BEYOND)
    return path


def test_a_short_run_does_not_reach_what_lies_beyond(path: Path) -> None:
    with pytest.raises(InputError, match=r"^file.toml: climate.series: 2001 to 2006 do not cover"):
        Scenario.load(path)
    short = Scenario.load(path, years=4)
    assert short == Scenario.load(path, ["years=4"])
    assert (short.calendar[-1], short.planned_calendar[-1]) == (2004, 2008)
    assert Scenario.from_toml(short.to_toml()) == short
    assert Scenario.load(path, years=6).with_overrides(["years=4"]) == short
    told = dict(summary(short))
    assert told["acts"] == "thin from below to n_ha 900 in 2003, 2008"
    assert told["wind"] == "no storms"
    assert "disturbances" not in told["mortality"]
    records = steps(Stand(short), 4)
    assert [len(r.tables.get("treatments", {}).get("year", ())) > 0 for r in records] == [
        False, False, True, False,
    ]  # fmt: skip


def test_a_short_run_can_go_on_to_the_bits_of_a_long_one(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    simulate(Scenario.load(path, years=4), out).close()
    longer = Scenario.load(path, years=6)
    with simulate(longer, out, resume=True) as run, simulate(longer, tmp_path / "b.h5") as whole:
        assert_same_runs(run, whole)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--years", "3", "--set", "start_year=1990"], "file.toml with --set, --years: climate.s"),
        (["--years", "8"], "file.toml with --years: climate.series: 2001 to 2006 do not cover"),
        (["--years", "20000"], "--years: years: 20000 is not allowed"),
        (["--years", "4", "--set", "plot.size_m=1"], "--set: plot.size_m: 1 is not allowed"),
        (["--set", "seed=1", "--seed", str(10**30)], "--seed: seed: 1"),
        (
            ["--years", "4", "--set", "wind.storms=[{year=2009, speed_m_s=1}]"],
            "--set: wind.storms[0].year: 2009 is not a year of the run; expected a calendar year, "
            "2001 to 2008",
        ),
    ],
)
def test_messages_name_the_option_that_was_given(path: Path, words: list[str], says: str) -> None:
    code, _, err = forest("run", path, "--out", path.parent / "run.h5", *words)
    assert (code, len(err.splitlines())) == (2, 1)
    assert err.startswith(f"forest: error: {says}")
