"""Bare ground and the gap: both scripts, on a few square metres and for a few years."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

import forest
from analysis import succession
from scenarios import bare_ground_succession, gap_dynamics

PNG = b"\x89PNG"


def _smaller(script_file: Path, folder: Path, *changes: tuple[str, str]) -> Path:
    text = script_file.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    small = folder / "small.toml"
    small.write_text(text)
    return small


@pytest.fixture
def small_ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small = _smaller(
        bare_ground_succession.SCENARIO, tmp_path, ("size_m = [40.0, 40.0]", "size_m = [8.0, 8.0]")
    )
    monkeypatch.setattr(bare_ground_succession, "SCENARIO", small)


@pytest.mark.usefixtures("small_ground")
def test_bare_ground(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    bare_ground_succession.main(["--out", str(out), "--years", "22", "--threads", "1"])
    said = capsys.readouterr().out
    assert "Betula pendula is greatest at age" in said
    assert (out / "bare_ground_succession.png").read_bytes().startswith(PNG)
    numbers = pd.read_csv(out / "species.csv").set_index("species")
    assert len(numbers) == 5
    assert numbers["last_share"].sum() == pytest.approx(1.0)
    assert numbers["peak_share"].idxmax() == "betula_pendula"
    whole = pd.read_csv(out / "pattern.csv")
    assert whole.columns.tolist() == ["what", "value", "published"]
    with forest.open_run(out / "bare_ground_succession.h5") as run:
        assert len(run.years) == 22
        rows, stand = run.regeneration, run.stand
        floor = stand.loc[stand["species"] == "all"].set_index("year")["floor_light"]
        of = rows[rows["species"] == "betula_pendula"].set_index("year")
        dark = [year for year in of.index[1:] if floor[year] < 0.5]
        stood = of.loc[[year - 1 for year in dark], "n_ha"].sum()
        survived = 1.0 - of.loc[dark, "died_ha"].sum() / stood
        monkeypatch.setattr(succession, "SHADE", 0.5)
        assert succession.seedling_survival(run)["betula_pendula"] == pytest.approx(survived)
        assert 0.0 < survived < 1.0


@pytest.mark.usefixtures("small_ground")
def test_a_seed_of_ones_own(tmp_path: Path) -> None:
    trees = []
    for seed in ("1", "2"):
        out = tmp_path / seed
        bare_ground_succession.main(["--out", str(out), "--years", "10", "--seed", seed])
        with forest.open_run(out / "bare_ground_succession.h5") as run:
            assert run.scenario.seed == int(seed)
            trees.append(run.trees)
    assert not trees[0].equals(trees[1])


def test_a_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small = _smaller(
        gap_dynamics.SCENARIO,
        tmp_path,
        ("size_m = [40.0, 40.0]", "size_m = [10.0, 10.0]"),
        ("x_m = 20.0, y_m = 20.0, radius_m = 11.0", "x_m = 1.0, y_m = 5.0, radius_m = 3.0"),
    )
    monkeypatch.setattr(gap_dynamics, "SCENARIO", small)
    out = tmp_path / "out"
    gap_dynamics.main(["--out", str(out), "--before", "16", "--years", "6", "--threads", "1"])
    assert "trees recruited on it since" in capsys.readouterr().out
    assert (out / "gap_dynamics.png").read_bytes().startswith(PNG)
    by_year = pd.read_csv(out / "by_year.csv", index_col="year")
    assert by_year["years"].tolist() == list(range(6))
    assert (by_year["light_gap"] > by_year["light_closed"]).all()
    assert by_year["new_ha_gap"].iloc[-1] >= by_year["new_ha_closed"].iloc[-1]
    numbers = pd.read_csv(out / "by_species.csv")
    assert set(numbers["ground"]) <= {"gap", "closed"}
    with forest.open_run(out / "gap.h5") as gap, forest.open_run(out / "closed.h5") as closed:
        felled = [run.events["kind"].eq("felled").sum() for run in (gap, closed)]
        assert felled[0] > 0
        assert felled[1] == 0
        before = int(by_year.index[0])
        both = [run.trees[run.trees["year"] < before] for run in (gap, closed)]
        pd.testing.assert_frame_equal(*both)


@pytest.mark.usefixtures("small_ground")
def test_wrong_threads_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        bare_ground_succession.main(["--out", str(tmp_path), "--threads", "0"])
    assert end.value.code == 2
    assert capsys.readouterr().err.startswith("error: ")
