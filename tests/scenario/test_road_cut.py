"""The road and the storm after it, on a small young stand."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pandas as pd
import pytest

SCRIPT = Path(__file__).parents[2] / "scenarios" / "road_cut_and_storm.py"
SMALL = [
    "plot.size_m=[30, 8]",
    "planting.density_ha=4500",
    "planting.min_distance_m=0.8",
    "years=22",
    "wind.storms=[{ year = 2001, speed_m_s = 16 }]",
    "wind.from_height_m=2",
]


def test_a_road_and_a_storm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = importlib.util.spec_from_file_location("road_cut_and_storm", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.main(["--road", "12", "--out", str(tmp_path), *(f"--set={key}" for key in SMALL)])
    said = capsys.readouterr().out
    assert "by distance from the new edge" in said
    assert (tmp_path / "road_cut_and_storm.png").read_bytes().startswith(b"\x89PNG")
    trees = pd.read_csv(tmp_path / "road_cut_and_storm.csv")
    assert (trees["from_edge_m"] >= 0.0).all()
    assert trees["outcome"].isin(["stood", "broken", "uprooted"]).all()
    fell = trees["outcome"].ne("stood")
    assert fell.any()
    near = trees["from_edge_m"] < 6.0
    assert trees["edge"][near].median() > trees["edge"][~near].median()
