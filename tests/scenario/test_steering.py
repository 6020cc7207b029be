"""Steering towards old growth, on a small plot and for the years of the first treatments."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

import forest
from scenarios import steering_old_growth

YEARS = 41


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = steering_old_growth.SCENARIO.read_text()
    assert "size_m = [40.0, 40.0]" in text
    path = tmp_path / "small.toml"
    path.write_text(text.replace("size_m = [40.0, 40.0]", "size_m = [12.0, 12.0]"))
    monkeypatch.setattr(steering_old_growth, "SCENARIO", path)


@pytest.mark.usefixtures("small")
def test_steering(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    steering_old_growth.main(["--out", str(out), "--years", str(YEARS), "--threads", "1"])
    said = capsys.readouterr().out
    assert "nearness to the target from age 30 on" in said
    assert (out / "steering_old_growth.png").read_bytes().startswith(b"\x89PNG")
    table = pd.read_csv(out / "by_decade.csv").set_index(["stand", "age"])
    assert table.index.get_level_values("age").unique().tolist() == [1, 11, 21, 31, 41]
    assert table.loc["left alone", "felled_m3ha"].eq(0.0).all()
    assert table.loc[("steered", 41), "felled_m3ha"] > table.loc[("steered", 31), "felled_m3ha"] > 0
    before = table.loc[("left alone", 21)], table.loc[("steered", 21)]
    pd.testing.assert_series_equal(*before, check_names=False)
    near = pd.read_csv(out / "nearness.csv").set_index("stand")
    assert near["overlap_mean"].between(0.0, 1.0).all()
    done = pd.read_csv(out / "treatments.csv")
    assert done["year"].tolist() == [2001, 2001, 2011]
    with forest.open_run(out / "steered.h5") as run:
        last = table.loc[("steered", 41)]
        stand = run.stand[(run.stand["species"] == "all") & (run.stand["year"] == run.years[-1])]
        assert last["n_ha"] == pytest.approx(stand["n_ha"].iloc[0])
        assert run.scenario.years == YEARS
        assert len(run.scenario.acts) == 4  # of the years that are grown


def test_nearness_counts_from_an_age_on() -> None:
    table = pd.DataFrame(
        {"overlap": [0.1, 0.5, 0.7], "gap_share": [0.9, 0.095, 0.195]},
        index=pd.Index([20, 30, 40], name="age"),
    )
    (row,) = steering_old_growth.nearness({"one": table}, 30).to_dict("records")
    assert row["overlap_mean"] == pytest.approx(0.6)
    assert row["overlap_last"] == pytest.approx(0.7)
    assert row["gaps_off_mean"] == pytest.approx(0.05)
    assert row["gaps_off_last"] == pytest.approx(0.1)


def test_an_error_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        steering_old_growth.main(["--out", str(tmp_path / "out"), "--years", "0"])
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "out").exists()
