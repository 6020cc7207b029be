"""What a scenario says of measured trees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.inventory import curve_height, fit_height_curve

TOML = """
years = 2
plot = { size_m = [10, 10] }
environment = { canopy = {} }
species = { picea_abies = {}, fagus_sylvatica = {} }
planting = { kind = "inventory", file = "plot.csv", species = "picea_abies" }
"""
HEAD = "x_m,y_m,species,dbh_cm,height_m,crown_base_m,age\n"
ROWS = "1,1,,20,18,6,50\n2,2,fagus_sylvatica,9,11.5,,\n\n3,3,,0,1.1,,\n"


def read(folder: Path, rows: str, toml: str = TOML, head: str = HEAD) -> Scenario:
    (folder / "plot.csv").write_text(head + rows)
    return Scenario.from_toml(toml, folder=folder)


def test_the_file_is_embedded(tmp_path: Path) -> None:
    scenario = read(tmp_path, ROWS)
    first, second, third = scenario.planting.trees
    assert (first.species, first.dbh_cm, first.crown_base_m, first.age) == (
        "picea_abies",
        20,
        6,
        50,
    )
    assert (second.species, second.crown_base_m, second.line) == ("fagus_sylvatica", None, 3)
    assert (third.dbh_cm, third.line) == (None, 5)
    (tmp_path / "plot.csv").unlink()
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    x, _, kind = scenario.planting_positions()
    assert (x.tolist(), kind.tolist()) == ([1, 2, 3], [0, 1, 0])
    assert len(scenario.planting_leans()[0]) == 3


def test_missing_heights_come_from_the_curve_of_the_species(tmp_path: Path) -> None:
    d = np.array([8.0, 12.0, 20.0, 30.0])
    known = "".join(
        f"{k},1,,{x:g},{curve_height(x, (2.0, 0.2)):.6f},,\n" for k, x in enumerate(d, start=1)
    )
    scenario = read(tmp_path, known + "8,8,,25,,,\n")
    assert scenario.planting.height_curve["picea_abies"] == pytest.approx((2.0, 0.2), rel=1e-4)
    assert scenario.planting.trees[-1].height_m == pytest.approx(1.3 + (25 / 7) ** 2, rel=1e-4)


def test_a_given_curve_is_used(tmp_path: Path) -> None:
    toml = TOML.replace('"plot.csv",', '"plot.csv", height_curve = { picea_abies = [2.5, 0.2] },')
    tree = read(tmp_path, "1,1,,20,,,\n", toml).planting.trees[0]
    assert tree.height_m == pytest.approx(1.3 + (20 / 6.5) ** 2)


@given(st.floats(0.5, 5), st.floats(0.1, 0.5), st.lists(st.floats(3, 60), min_size=3, unique=True))
@settings(max_examples=25, deadline=None)
def test_an_exact_curve_is_found_again(a: float, b: float, dbh: list[float]) -> None:
    if np.ptp(dbh) < 1.0:
        return
    found = fit_height_curve(dbh, [curve_height(d, (a, b)) for d in dbh])
    assert found == pytest.approx((a, b), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("rows", "parts"),
    [
        ("1,1,,5,1.2,,\n", ["'plot.csv' line 2", "does not reach 1.3 m"]),
        ("1,1,,,5,,\n", ["'plot.csv' line 2", "dbh_cm", "a dbh of every tree above 1.3 m"]),
        ("1,1,,,,,\n", ["'plot.csv' line 2", "neither dbh nor height"]),
        ("1,1,,5,6,7,\n", ["line 2", "crown_base_m", "above the tree"]),
        ("1,1,,-5,6,,\n", ["line 2", "dbh_cm", "above 0"]),
        ("1,1,,5,6,,2.5\n", ["line 2", "age", "whole number"]),
        ("1,1,,five,6,,\n", ["line 2, column 'dbh_cm'", "'five'"]),
        ("1,1,picea_abis,5,6,,\n", ["line 2", "did you mean 'picea_abies'?"]),
        ("1,1,,5,6,,\n1,1,,5,6,,\n", ["line 3: stands on the spot of line 2"]),
        ("1,11,,5,6,,\n", ["line 2: (1, 11) is outside the plot"]),
        ("1,1,,5,6,,\n2,2,,8,,,\n", ["line 3: no height", "height_curve.picea_abies = [a, b]"]),
        ("", ["holds no tree"]),
    ],
)
def test_refused(tmp_path: Path, rows: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as refused:
        read(tmp_path, rows)
    message = str(refused.value)
    assert message.startswith("scenario: planting")
    assert "\n" not in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("planting", "parts"),
    [
        ('{ kind = "inventory" }', ["planting.file", "no trees"]),
        (
            '{ kind = "inventory", trees = [{ x_m = 1, y_m = 1, dbh_cm = 3, height_m = 4 }] }',
            ["planting.trees[0]", "no species"],
        ),
        (
            '{ kind = "inventory", file = "plot.csv", height_curve = { picea_abies = [1, -1] } }',
            ["planting.height_curve.picea_abies", "a and b above 0"],
        ),
        (
            '{ kind = "inventory", file = "plot.csv", height_curve = { picea = [1, 1] } }',
            ["planting.height_curve", "unknown species 'picea'"],
        ),
    ],
)
def test_refused_tables(tmp_path: Path, planting: str, parts: list[str]) -> None:
    toml = TOML.replace(TOML.splitlines()[-1], f"planting = {planting}")
    with pytest.raises(InputError) as refused:
        read(tmp_path, "1,1,picea_abies,5,6,,\n", toml)
    for part in parts:
        assert part in str(refused.value)
