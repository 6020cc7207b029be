"""The climate as scenarios give it: files, series, generators, responses, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from forest.errors import InputError
from forest.scenario import Scenario

TEXT = """
years = 3
start_year = 2001
plot = { size_m = [5, 5] }
environment = { shadow = {} }
species = { picea_abies = {} }
planting = { kind = "explicit", trees = [{ x_m = 1, y_m = 1 }] }
[climate]
file = "years.csv"
"""
YEARS = "year,drought_index,temperature_c\n2001,-1,8\n2002,0.5,9\n2003,0,7.5\n"


def load(folder: Path, text: str = TEXT, csv: str = YEARS) -> Scenario:
    (folder / "years.csv").write_text(csv)
    (folder / "stand.toml").write_text(text)
    return Scenario.load(folder / "stand.toml")


def test_a_file_becomes_a_series_and_the_scenario_stands_for_itself(tmp_path: Path) -> None:
    scenario = load(tmp_path)
    climate = scenario.climate
    assert climate.file == ""
    assert [y.year for y in climate.series] == [2001, 2002, 2003]
    assert climate.given == ("temperature_c", "drought_index")
    assert climate.series[1].drought_index == 0.5
    (tmp_path / "years.csv").unlink()
    again = Scenario.from_toml(scenario.to_toml())
    assert again == scenario
    assert again.digest() == scenario.digest()


def test_rows_in_any_order(tmp_path: Path) -> None:
    head, *rows = YEARS.splitlines()
    other = load(tmp_path, csv="\n".join([head, *reversed(rows)]))
    assert other == load(tmp_path)


def test_another_file_for_one_run(tmp_path: Path) -> None:
    scenario = load(tmp_path)
    (tmp_path / "wet.csv").write_text(YEARS.replace("-1", "1"))
    changed = scenario.with_overrides(["climate.file=wet.csv"])
    assert changed.climate.series[0].drought_index == 1.0


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("year,", "jahr,", ["'years.csv' line 1 has no column 'year'"]),
        (",drought_index,", ";drought_index,", ["no column 'year'"]),
        ("drought_index", "drougt_index", ["'drougt_index'", "did you mean 'drought_index'?"]),
        ("temperature_c", "drought_index", ["line 1 names a column twice"]),
        ("2002,0.5,9", "2001,0.5,9", ["line 3: 2001 stands in line 2 already"]),
        ("2002,0.5,9\n", "", ["line 3: 2003 does not follow 2001", "every year"]),
        ("2002,0.5", "2002,nan", ["line 3, column 'drought_index': 'nan'", "-10 to 10"]),
        ("2002,0.5", "2002,", ["line 3, column 'drought_index': ''"]),
        ("2002,0.5", "2002,dry", ["line 3, column 'drought_index': 'dry'"]),
        ("9\n", "900\n", ["line 3, column 'temperature_c': '900'", "-60 to 60"]),
        ("2002", "2002.5", ["line 3, column 'year': '2002.5'", "a whole number"]),
        ("2003,0,7.5", "2003,0", ["line 4 has 2 columns", "3 as in its header"]),
        ("2003,0,7.5\n", "", ["2001 to 2002 do not cover the run, 2001 to 2003", "repeat = true"]),
        (YEARS, "year,growth_index\n", ["holds no year"]),
        (YEARS, "year\n2001\n", ["has only years"]),
        (YEARS, "", ["is empty"]),
    ],
)
def test_files_that_are_refused(tmp_path: Path, old: str, new: str, parts: list[str]) -> None:
    assert old in YEARS
    with pytest.raises(InputError) as caught:
        load(tmp_path, csv=YEARS.replace(old, new, 1))
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert message.startswith(("stand.toml: climate.file: ", "stand.toml: climate.series: "))
    for part in parts:
        assert part in message


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"climate\.file: no such file '.*none\.csv'"):
        load(tmp_path, TEXT.replace("years.csv", "none.csv"))


@pytest.mark.parametrize(
    ("climate", "parts"),
    [
        ("file = 'years.csv'\nseries = [{year = 2001, growth_index = 1}]", ["climate.file", "one"]),
        ("repeat = true", ["climate.repeat", "nothing to repeat"]),
        ("series = [{year = 2001}]", ["series[0]", "tells nothing"]),
        (
            "series = [{year = 2001, growth_index = 1}, {year = 2003, growth_index = 1}]",
            ["series[1].year", "2003 does not follow 2001"],
        ),
        (
            "series = [{year = 2001, growth_index = 1}, {year = 2002, drought_index = 1}]",
            ["series[1]", "tells drought_index", "expected growth_index"],
        ),
        ("generator = {}", ["climate.generator", "draws nothing", "drought_index"]),
        ("generator.drought_index.mean = 0", ["climate.generator.drought_index.sd", "missing key"]),
        (
            "generator.drought_index = {mean = 0, sd = 1, autocorrelation = 1}",
            ["climate.generator.drought_index.autocorrelation", "-0.95 to 0.95"],
        ),
        (
            "noise_sd = 0.1\ngenerator.growth_index = {mean = 1, sd = 0.1}",
            ["climate.generator.growth_index", "one of the two"],
        ),
        ("generator.drout_index = {}", ["did you mean 'drought_index'?"]),
    ],
)
def test_climates_that_are_refused(tmp_path: Path, climate: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, TEXT.replace('file = "years.csv"', climate))
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    for part in parts:
        assert part in message


def test_the_old_name_is_answered_with_the_new_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown key 'weather', did you mean 'climate'"):
        load(tmp_path, TEXT.replace('[climate]\nfile = "years.csv"', "[weather]\nnoise_sd = 0.1"))


@pytest.mark.parametrize("other", ["repeat = true", "generator.drought_index = {mean=0, sd=1}"])
def test_what_may_stand_in_for_years_without_a_series(tmp_path: Path, other: str) -> None:
    csv = "year,drought_index\n2001,-1\n"
    assert load(tmp_path, TEXT + other, csv).climate.given == ("drought_index",)
    with pytest.raises(InputError, match="do not cover"):
        load(tmp_path, csv=csv)


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("drought_index_lags=[0.5, 0.2, 0.2]", "the weights add up to 0.9"),
        ("drought_index_gaussian=[0, 1]", "drought_index_curve = [] switches the curve off"),
        ("temperature_gaussian=[8]", "[8.0] is no bell"),
        ("temperature_gaussian=[8, 0]", "width above 0"),
        ("precipitation_curve=[[500, 1], [400, 0.5]]", "does not rise"),
        ("least_share=0", "above 0"),
    ],
)
def test_responses_that_are_refused(tmp_path: Path, key: str, says: str) -> None:
    scenario = load(tmp_path)
    with pytest.raises(InputError) as caught:
        scenario.with_overrides([f"species.picea_abies.response.{key}"])
    assert says in str(caught.value)
    assert f"species.picea_abies.response.{key.split('=')[0]}" in str(caught.value)
