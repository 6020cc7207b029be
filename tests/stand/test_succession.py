"""Bare ground for 250 years, and a gap in an old stand: what the scripts are there to show."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from scenarios import bare_ground_succession, gap_dynamics

TOLERANT = ["picea_abies", "fagus_sylvatica"]


@pytest.mark.stand
@pytest.mark.parametrize("seed", ["1", "2", "3"])
def test_pioneers_come_first_and_the_tolerant_pass_them(tmp_path: Path, seed: str) -> None:
    bare_ground_succession.main(["--out", str(tmp_path), "--seed", seed])
    whole = pd.read_csv(tmp_path / "pattern.csv").set_index("what")["value"]
    assert 10 <= whole["share of Betula pendula is greatest at age"] <= 50
    assert 40 <= whole["tolerant pass light-demanding species at age"] <= 120
    assert whole["share of tolerant species at the end"] > 0.5
    assert 0.01 <= whole["light at the floor"] <= 0.10
    assert 4.0 <= whole["leaf area index"] <= 10.0
    assert 1.0 <= whole["stems of 10 cm lost, % a year"] <= 2.5
    assert 0.5 <= whole["stems grown to 10 cm, % a year"] <= 4.0
    live = pd.read_csv(tmp_path / "species.csv").set_index("species")["seedlings_live"]
    assert live[TOLERANT].min() > 0.8 > live["betula_pendula"]


@pytest.mark.stand
def test_a_gap_is_recolonised(tmp_path: Path) -> None:
    gap_dynamics.main(["--out", str(tmp_path)])
    by_year = pd.read_csv(tmp_path / "by_year.csv").set_index("years")
    assert by_year["light_gap"][1] > 2.0 * by_year["light_closed"][1]
    assert by_year["light_gap"].iloc[-1] < 0.5 * by_year["light_gap"][1]
    last = by_year.iloc[-1]
    assert last["new_m2ha_gap"] > 5.0
    assert last["new_m2ha_gap"] > 2.0 * last["new_m2ha_closed"]
    assert last["tallest_m_gap"] > 8.0
