"""Heights of the ground, and the files that they are read from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from forest.errors import InputError
from forest.surface.terrain import HeightField, read_heights

SLOPES = st.floats(-2.0, 2.0)


@given(a=SLOPES, b=SLOPES, cell=st.floats(0.1, 20.0), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_a_plane_stays_a_plane(a: float, b: float, cell: float, seed: int) -> None:
    rows, columns, origin = 5, 7, (-3.0, 11.0)
    x = origin[0] + (np.arange(columns) + 0.5) * cell
    y = origin[1] + (rows - 0.5 - np.arange(rows)) * cell  # row 0 is the north edge
    field = HeightField(a * x[None, :] + b * y[:, None], cell, origin)
    rng = np.random.default_rng(seed)
    px = rng.uniform(x[1], x[-2], 20)  # far enough from the edges for slopes
    py = rng.uniform(y[-2], y[1], 20)
    np.testing.assert_allclose(field.at(px, py), a * px + b * py, atol=1e-9 * (1 + cell))
    up = np.array([-a, -b, 1.0]) / np.sqrt(1.0 + a * a + b * b)
    np.testing.assert_allclose(field.normal(px, py), np.tile(up, (20, 1)), atol=1e-6)


def test_beyond_its_edges_the_ground_goes_on_level() -> None:
    field = HeightField(np.array([[1.0, 2.0], [3.0, 4.0]]), 10.0)
    assert field.at(-100.0, 100.0) == 1.0  # north-west
    assert field.at(100.0, -100.0) == 4.0  # south-east
    assert field.at(10.0, 10.0) == 2.5
    assert HeightField.flat(3.0).at([0.0, 1e6], [5.0, -7.0]).tolist() == [3.0, 3.0]


def test_files(tmp_path: Path) -> None:
    heights = np.array([[0.0, 50.0, 100.0], [25.0, 75.0, 10.0]])
    np.save(tmp_path / "h.npy", heights)
    Image.fromarray(np.round(heights * 655.35).astype(np.uint16)).save(tmp_path / "h16.png")
    Image.fromarray(np.round(heights * 2.55).astype(np.uint8)).save(tmp_path / "h8.png")
    text = "ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n"
    (tmp_path / "h.asc").write_text(text + "0 50 100\n25 75 -9999\n")
    for name, tolerance in (("h.npy", 0.0), ("h16.png", 1e-3), ("h8.png", 0.2)):
        read = read_heights(tmp_path / name, cell_m=2.0)
        np.testing.assert_allclose(read.heights, heights, atol=tolerance)
        assert read.size_m == (6.0, 4.0)
    read = read_heights(tmp_path / "h.asc")
    assert (read.cell_m, read.origin) == (2.0, (10.0, 20.0))
    assert read.heights[0].tolist() == [0.0, 50.0, 100.0]
    assert read.heights[1, 2] in (75.0, 100.0)  # a cell without data takes a neighbour's


def test_bad_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "short.asc").write_text("ncols 3\nnrows 2\ncellsize 2\n1 2 3\n")
    (tmp_path / "headless.asc").write_text("1 2 3\n")
    (tmp_path / "text.npy").write_text("no array")
    (tmp_path / "text.png").write_text("no picture")
    np.save(tmp_path / "nan.npy", np.array([[np.nan]]))
    np.save(tmp_path / "line.npy", np.zeros(3))
    Image.new("RGB", (2, 2)).save(tmp_path / "rgb.png")
    for name in ("short.asc", "headless.asc", "text.npy", "text.png", "nan.npy", "line.npy",
                 "rgb.png", "other.xyz", "missing.npy"):  # fmt: skip
        with pytest.raises(InputError, match=name.replace(".", r"\.")):
            read_heights(tmp_path / name)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("nrows 1", "nrows inf", "nrows inf is not allowed; expected a whole number above 0"),
        ("nrows 1", "nrows nan", "nrows nan is not allowed"),
        ("ncols 2", "ncols 2.5", "ncols 2.5 is not allowed; expected a whole number above 0"),
        ("ncols 2", "ncols -2", "ncols -2 is not allowed"),
        ("cellsize 1", "cellsize inf", "cellsize inf is not allowed; expected a number above 0"),
        ("cellsize 1", "", "no cellsize in the header"),
        ("cellsize 1", "cellsize 1\nxllcorner inf", "the corner lies at"),
    ],
)
def test_bad_headers_are_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    right = "ncols 2\nnrows 1\ncellsize 1\n"
    assert old in right
    (tmp_path / "h.asc").write_text(right.replace(old, new) + "1 2\n")
    with pytest.raises(InputError) as error:
        read_heights(tmp_path / "h.asc")
    assert str(error.value).startswith(f"h.asc: {says}")
