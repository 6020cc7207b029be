"""Stand development as a figure and as a table."""

from __future__ import annotations

import io
from types import SimpleNamespace

import numpy as np
import pandas as pd
from PIL import Image
from rich.console import Console

from forest.view.development import draw_development
from forest.view.table import stand_table


def a_run(years: int = 23, species=("picea_abies", "fagus_sylvatica"), tables=("stand", "trees")):
    rows, trees = [], []
    for i in range(years):
        for name in (*species, "all"):
            rows.append(
                {
                    "year": 1950 + i,
                    "species": name,
                    "n_ha": 100.0,
                    "basal_area_m2ha": 1.5 * i,
                    "qmd_cm": 2.0 * i if i else np.nan,
                    "top_height_m": 1.0 + 0.7 * i,
                    "lorey_height_m": 0.6 * i,
                    "volume_m3ha": 12.0 * i,
                    "lai": 0.2 * i,
                    "floor_light": np.exp(-0.1 * i) if name == "all" else np.nan,
                }
            )
        dbh = np.linspace(1, 2 + i, 25) if i > 3 else np.full(25, np.nan)
        trees += [{"year": 1950 + i, "dbh_cm": d} for d in dbh]
    stand, trees = pd.DataFrame(rows), pd.DataFrame(trees)
    stand["species"] = stand["species"].astype("category")
    return SimpleNamespace(stand=stand, tables=tables, read=lambda table, columns: trees[columns])


def test_the_figure_is_drawn(tmp_path):
    runs = {
        "mixed": a_run(),
        "lean": a_run(species=("oak",), tables=("stand",)),
        "young": a_run(years=2),
    }
    pictures = {}
    for name, run in runs.items():
        draw_development(run, tmp_path / f"{name}.png")
        pictures[name] = np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB"), float)
        assert pictures[name].shape == (792, 1430, 3)
        assert pictures[name].std() > 10
    coloured = {name: np.mean(np.ptp(p, axis=-1) > 60) for name, p in pictures.items()}
    assert coloured["mixed"] > coloured["lean"] == 0.0


def test_the_table_has_first_tenth_and_last_years():
    out = io.StringIO()
    Console(file=out, width=100).print(stand_table(a_run()))
    lines = [line.split() for line in out.getvalue().splitlines()]
    years = [line[0] for line in lines if line and line[0].startswith("19")]
    assert years == ["1950", "1959", "1969", "1972"]
    assert lines[2] == ["1950", "100", "0.0", "–", "1.0", "0", "0.0", "1.00"]
    assert lines[3] == ["1959", "100", "13.5", "18.0", "7.3", "108", "1.8", "0.41"]
