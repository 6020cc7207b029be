"""The road and the storm after it, on a small young stand."""

from __future__ import annotations

import importlib
from pathlib import Path

import pandas as pd
import pytest

SCRIPTS = Path(__file__).parents[2] / "scenarios"
SMALL = [
    "plot.size_m=[30, 8]",
    "planting.density_ha=4500",
    "planting.min_distance_m=0.8",
    "years=22",
    "wind.from_height_m=2",
]


def test_a_road_and_a_storm(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(SCRIPTS)
    script = importlib.import_module("road_cut_and_storm")
    script.main(
        [
            "--road",
            "12",
            "--out",
            str(tmp_path),
            "--weak",
            "0.05",
            *(f"--set={key}" for key in SMALL),
        ]
    )
    said = capsys.readouterr().out
    assert "by distance from the new edge" in said
    assert (tmp_path / "road_cut_and_storm.png").read_bytes().startswith(b"\x89PNG")
    trees = pd.read_csv(tmp_path / "road_cut_and_storm.csv")
    assert (trees["from_edge_m"] >= 0.0).all()
    assert trees["outcome"].isin(["stood", "broken", "uprooted"]).all()
    fell = trees["outcome"].ne("stood")
    assert fell.any()
    near = trees["from_edge_m"] < 6.0
    assert trees["critical_m_s"][near].median() < trees["critical_m_s"][~near].median()
    first = trees["round"].eq(1)  # later falls expose the rest, up to the last edge
    assert first[near].mean() > first[~near].mean()
