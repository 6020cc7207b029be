"""The plates of Weber & Penn 1995."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis import plates
from forest.species.parametric import load_parameters, parametric_names


def test_every_species_is_shown() -> None:
    assert sorted(plates.SPECIES) == parametric_names()
    assert all(load_parameters(name).source for name in plates.SPECIES)


def test_a_species_without_and_with_leaves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plates.draw_species("queen_palm", tmp_path, height_px=120)
    told = capsys.readouterr().out
    assert told.startswith("queen_palm | height 1")
    with Image.open(tmp_path / "plate_queen_palm.png") as picture:
        colours = np.asarray(picture.convert("RGB"), np.int64)
    green = (colours[..., 1] > colours[..., 0] + 15) & (colours[..., 1] > colours[..., 2] + 15)
    half = green.shape[1] // 2
    assert not green[:, :half].any()
    assert green[:, half:].sum() > 50


def test_a_panel_is_to_scale() -> None:
    tree = plates.tree_of("saguaro")
    low, high = plates.extent(tree)
    grey = np.asarray(plates.panel(tree, 20.0).convert("L"))
    rows, columns = np.nonzero(grey < 200)
    assert np.ptp(rows) == pytest.approx(20.0 * high[2], abs=3)
    widest = tree.nodes.radius.max() * (1.0 + tree.parameters.lobe_depth)
    wide = 20.0 * (high[0] - low[0])
    assert wide <= np.ptp(columns) + 2 <= wide + 40.0 * widest
