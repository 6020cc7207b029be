"""The brush scripts: their pictures, and a scenario of each that grows the same tree."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from forest.scenario import Scenario
from forest.stand import Stand

SCRIPTS = Path(__file__).parents[2] / "scenarios"


@pytest.fixture(scope="module")
def scripts() -> list:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(SCRIPTS)
        return [importlib.import_module(f"brush_fig{k}") for k in (15, 16, 17)]


def regrown(to: Path) -> np.ndarray:
    """Grow the tree of a scenario; give the ends of its internodes."""
    stand = Stand(Scenario.load(to))
    for _ in range(stand.scenario.years):
        stand.step()
    return stand.skeleton(1).end


def test_strokes_and_a_constrained_branch(scripts, tmp_path: Path, capsys) -> None:
    scripts[0].main(["--out", str(tmp_path), "--threads", "1"])
    assert "markers by stroke" in capsys.readouterr().out
    assert (tmp_path / "brush_fig15.png").read_bytes().startswith(b"\x89PNG")
    table = pd.read_csv(tmp_path / "brush_fig15.csv")
    assert (table["colonised"] >= 0.8 * table["markers"]).all()
    session = scripts[0].Session(None)
    tree = scripts[0].paint(session)[-1].trees[0]
    np.testing.assert_array_equal(regrown(tmp_path / "brush_fig15.toml"), tree.end)


def test_a_tree_leans_over_the_fence(scripts, tmp_path: Path) -> None:
    scripts[1].main(["--out", str(tmp_path)])
    table = pd.read_csv(tmp_path / "brush_fig16.csv").set_index("tree")
    assert table.loc["brushed", "beyond_the_fence"] > 0.6
    assert table.loc["left alone", "crown_from_stem_m"] < 0.2
    assert table.loc["brushed", "crown_from_stem_m"] > 1.0
    ends = regrown(tmp_path / "brush_fig16.toml")
    assert len(ends) == table.loc["brushed", "internodes"]
    for low, high in scripts[1].FENCE:  # nothing grows through posts and rails
        assert not np.any(np.all((ends > low) & (ends < high), axis=1))


def test_ornaments(scripts, tmp_path: Path) -> None:
    scripts[2].main(["--out", str(tmp_path)])
    table = pd.read_csv(tmp_path / "brush_fig17.csv")
    assert (table["colonised"] >= 0.8 * table["markers"]).all()
    session = scripts[2].Session(None, **scripts[2].SLENDER)
    scripts[2].trellis(session)
    ends = session.stand.skeleton(1).end
    np.testing.assert_array_equal(regrown(tmp_path / "brush_fig17_tiling.toml"), ends)
    points = session.laid
    whole = points[points[:, 2] > 0.6]  # rows, not the stem
    image = whole * [-1, 1, 1] + [12, 0, 0]
    assert {tuple(p) for p in whole.tolist()} == {tuple(p) for p in image.tolist()}
