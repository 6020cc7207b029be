"""The report on stability: by hand, on the command line, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from forest.view.stability_table import classes
from tests.tiny import forest, write_tiny

WINDY = "mechanics={ bending=false, wind_m_s=15 }"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stability")
    path = folder / "windy.h5"
    code, _, err = forest("run", write_tiny(folder), "--set", WINDY, "--out", path)
    assert code == 0, err
    return path


def test_classes_by_hand() -> None:
    trees = pd.DataFrame(
        {
            "species": ["pine"] * 11 + ["oak"],
            "dbh_cm": [12.0] * 11 + [np.nan],
            "safety_factor": [0.5, *np.arange(1.0, 11.0), 7.0],
            "frequency_hz": [*np.arange(11.0), 2.0],
            "stress_share": 0.1,
            "wind_stress_share": [*np.arange(11.0) / 10.0, 0.3],
        }
    )
    oak, pine = classes(trees).to_dict("records")
    assert (oak["species"], oak["size_class"], oak["trees"]) == ("oak", "< 1.3 m", 1)
    assert (pine["size_class"], pine["trees"]) == ("10-20 cm", 11)
    assert (pine["safety_min"], pine["safety_p10"], pine["safety_median"]) == (0.5, 1.0, 5.0)
    assert pine["share_below_1"] == pytest.approx(1 / 11)
    assert (pine["frequency_hz"], pine["wind_stress_share"], pine["wind_stress_max"]) == (5, 0.5, 1)


def test_report(run: Path, tmp_path: Path) -> None:
    code, out, _ = forest("stability", run)
    assert code == 0
    assert "pinus_sylvestris" in out and "median" in out
    code, out, _ = forest("stability", run, "--year", "2004", "--to", tmp_path / "table.csv")
    assert (code, out) == (0, f"{tmp_path / 'table.csv'}: 2 classes\n")
    assert pd.read_csv(tmp_path / "table.csv")["trees"].sum() == 10
    code, out, _ = forest("stability", run, "--to", tmp_path / "stability.png")
    assert code == 0
    assert (tmp_path / "stability.png").read_bytes()[1:4] == b"PNG"


def test_refusals(run: Path, tmp_path: Path) -> None:
    code, _, err = forest("stability", run, "--year", "1999")
    assert code == 2
    assert "holds no year 1999" in err and "2001 to 2008" in err and err.count("\n") == 1
    code, _, err = forest("stability", run, "--to", tmp_path / "table.doc")
    assert code == 2 and "unknown format '.doc'" in err
    calm = tmp_path / "calm.h5"
    assert forest("run", write_tiny(tmp_path), "--out", calm)[0] == 0
    code, _, err = forest("stability", calm)
    assert code == 2
    assert "a run whose scenario has [mechanics]" in err
