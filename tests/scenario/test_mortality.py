"""Mortality in a scenario: tables, files of disturbances, and what is refused before the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings

from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.mortality import Disturbance, Mortality
from forest.scenario.summary import summary
from tests.scenario.test_fuzz import mutated
from tests.tiny import TOML

CSV = """year,tree_id,x_m,y_m,radius_m,share,species,min_dbh_cm,max_dbh_cm,cause
2003,2,,,,,,,,insects

2004,,5,5,2.5,,,,,fire
2005,,,,,0.25,fagus_sylvatica,,7.5,browsing
"""


def load(folder: Path, csv: str | bytes, rules: str = 'events = "deaths.csv"') -> Scenario:
    data = csv.encode() if isinstance(csv, str) else csv
    (folder / "deaths.csv").write_bytes(data)
    path = folder / "stand.toml"
    path.write_text(f"{TOML}\n[mortality]\n{rules}\n")
    return Scenario.load(path)


def test_a_file_is_read_and_kept(tmp_path: Path) -> None:
    scenario = load(tmp_path, CSV, 'events = "deaths.csv"\nage = true\nsnags = true')
    insects, fire, browsing = scenario.mortality.events
    assert (insects.tree_id, insects.cause, insects.share) == (2, "insects", None)
    assert (fire.x_m, fire.radius_m, fire.source) == (5.0, 2.5, "'deaths.csv' line 4")
    assert browsing == Disturbance(
        year=2005,
        share=0.25,
        species="fagus_sylvatica",
        max_dbh_cm=7.5,
        cause="browsing",
        source="'deaths.csv' line 5",
    )
    assert Scenario.from_toml(scenario.to_toml()) == scenario  # without the file
    text = dict(summary(scenario))["mortality"]
    assert text == "suppression, age, 3 disturbances; snags and dead wood"


def test_nothing_but_suppression_by_default() -> None:
    scenario = Scenario.from_toml(TOML)
    assert scenario.mortality == Mortality()
    assert dict(summary(scenario))["mortality"] == "suppression"


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("2003,2.5,,,,,,,,", "'deaths.csv' line 2, column 'tree_id': '2.5' is not.*whole number"),
        (
            "2_003,1,,,,,,,,",
            "line 2, column 'year': '2_003' is not allowed; expected a whole number",
        ),
        ("2003,,1_0,1,1,,,,,", "line 2, column 'x_m': '1_0' is not allowed; expected a number"),
        ("", "'deaths.csv' holds no row; expected at least one below its header"),
        ("2003,,a,,,,,,,", "line 2, column 'x_m': 'a' is not allowed; expected a number"),
        ("2003,,nan,1,1,,,,,", "line 2: x_m: nan"),
        ("2003,,,,,1.5,,,,", "line 2: share: 1.5 is not allowed; expected number, 0 to 1"),
        ("2003,,,,,,,,,fire", "line 2: names no trees; expected tree_id, or x_m"),
        ("2003,1,,,,0.5,,,,", "line 2: share: given beside tree_id"),
        ("2003,,1,,2,,,,,", "line 2: y_m: not given; expected x_m, y_m and radius_m"),
        ("2003,,11,1,2,,,,,", r"line 2: \(11, 1\) is outside the plot"),
        ("2003,1,,,,,,,,fier", "line 2: cause: 'fier' is not allowed; expected \"fire\""),
        ("2003,,,,,1,fagus,,,", "line 2: unknown species 'fagus', did you mean 'fagus_sylvatica'"),
        ("2003,,,,,1,,9,3,", "line 2: max_dbh_cm: 3 lies below min_dbh_cm; expected 9 or more"),
        ("1999,1,,,,,,,,", "line 2: 1999 is not a year of the run; expected .*2001 to 2008"),
        (",1,,,,,,,,", "line 2: year: missing key 'year'"),
        ("2003,1", "line 2 has 2 columns; expected 10"),
    ],
)
def test_a_bad_row_is_named(tmp_path: Path, row: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as refusal:
        load(tmp_path, CSV.splitlines()[0] + "\n" + row + "\n")
    assert str(refusal.value).startswith("stand.toml: mortality.events: ")


@pytest.mark.parametrize(
    ("rules", "says"),
    [
        ("buckling = true", "mortality.buckling: buckling is found by mechanics"),
        ("buckle = true", "unknown key 'buckle', did you mean 'buckling'"),
        ("age = 1", "mortality.age: 1 is not allowed; expected true or false"),
        ('events = "death.csv"', "mortality.events: .*death.csv"),
        ("events = [{year = 2003}]", r"mortality.events\[0\]: names no trees"),
        ("events = [{year = 2013, share = 1}]", r"mortality.events\[0\]: 2013 is not a year"),
        (
            "events = [{year = 2004, tree_id = 1}, {year = 2003, tree_id = 1}]",
            r"mortality.events\[0\].tree_id: tree 1 has died in 2003; expected a tree that still",
        ),
        ("events = 3", "mortality.events: 3 is not allowed"),
    ],
)
def test_refusals(tmp_path: Path, rules: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        load(tmp_path, CSV, rules)


@pytest.mark.parametrize("text", ["", "\n", "share\n0.5\n"])
def test_a_file_without_years_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"expected columns year$"):
        load(tmp_path, text)


def test_a_tree_dies_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'deaths.csv' line 3: tree 1 has died in 2003"):
        load(tmp_path, "year,tree_id\n2003,1\n2004,1\n")


def test_an_unknown_column_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="column 'min_dbh', did you mean 'min_dbh_cm'"):
        load(tmp_path, "year,share,min_dbh\n2003,0.5,3\n")


@settings(max_examples=60, deadline=None)
@given(mutated(CSV.encode()))
def test_spoilt_files(tmp_path_factory: pytest.TempPathFactory, csv: bytes) -> None:
    try:
        scenario = load(tmp_path_factory.mktemp("spoilt"), csv)
    except InputError as refusal:
        assert len(str(refusal).splitlines()) == 1
        assert str(refusal).isprintable()
    else:
        assert Scenario.from_toml(scenario.to_toml()) == scenario
