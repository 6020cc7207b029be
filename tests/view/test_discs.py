"""Pictures of discs and boards, and the trunk as a solid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista
from matplotlib import image

from forest.dendro.disc import Disc
from forest.dendro.knots import Branches, Knot
from forest.dendro.life import StemLife
from forest.dendro.section import section
from forest.view.disc_picture import draw_disc, draw_section
from forest.view.trunk_mesh import write_trunk

YEARS = np.arange(2001, 2005)


def pole(radius: np.ndarray) -> StemLife:
    """A vertical stem of four internodes of 1 m with these radii by year and internode, m."""
    end = np.column_stack((np.zeros(4), np.zeros(4), np.arange(1.0, 5.0)))
    flat = np.zeros_like(radius)
    return StemLife(
        tree_id=7,
        species="picea_abies",
        years=YEARS,
        start=end - [0, 0, 1],
        end=end,
        birth_year=YEARS,
        radius=radius,
        eccentricity=flat,
        thick_side_deg=flat,
        branches=Branches(
            np.empty(0, np.int32),
            np.empty(0, np.int64),
            np.empty((0, 3)),
            np.empty(0, np.int64),
            np.empty((4, 0)),
        ),
        bark_factor=0.1,
    )


GROWN = 0.1 * np.maximum(np.subtract.outer(np.arange(1.0, 5.0), np.arange(4.0)), 0.0)


def disc(**more) -> Disc:
    fields = {
        "tree_id": 7,
        "species": "picea_abies",
        "height_m": 1.3,
        "years": np.arange(1995, 2005),
        "cambial_ages": np.arange(1, 11),
        "ring_widths": np.full(10, 0.01),
        "eccentricity": np.zeros(10),
        "thick_side_deg": np.zeros(10),
        "bark_factor": 0.1,
    }
    return Disc(**{**fields, **more})


def dark(path: Path) -> np.ndarray:
    return image.imread(path)[:, :, :3].max(axis=2) < 0.4


def test_a_disc_shows_bark_thick_side_and_knots(tmp_path: Path) -> None:
    square = 0.01 * np.array([[3.0, -2], [6, -2], [6, 2], [3, 2]])
    knot = Knot(1, 1996, 2000, False, square)
    eccentric = {"eccentricity": np.full(10, 0.5), "thick_side_deg": np.full(10, 180.0)}
    drawn = {
        "plain": disc(),
        "barkless": disc(bark_factor=0.0),
        "knot": disc(knots=(knot,)),
        "eccentric": disc(**eccentric),
        "undated": disc(undated_radius=0.05),
    }
    for name, one in drawn.items():
        draw_disc(one, tmp_path / f"{name}.png")
    shades = {name: dark(tmp_path / f"{name}.png") for name in drawn}
    assert shades["plain"].sum() > 2 * shades["barkless"].sum()
    different = image.imread(tmp_path / "knot.png") != image.imread(tmp_path / "plain.png")
    columns = np.flatnonzero(different.any(axis=(0, 2)))
    width = different.shape[1]
    assert 0.55 * width < columns[0] < columns[-1] < 0.85 * width
    pith = [np.flatnonzero(s[:, : width // 2].any(axis=1)) for s in shades.values()]
    assert all(len(rows) for rows in pith)


def test_other_formats_and_broadleaves(tmp_path: Path) -> None:
    draw_disc(disc(), tmp_path / "disc.svg", conifer=False)
    text = (tmp_path / "disc.svg").read_text()
    assert text.count("<path") > 10 and "</svg>" in text
    draw_disc(disc(), tmp_path / "b.png", conifer=False)
    draw_disc(disc(), tmp_path / "c.png")
    broadleaf, conifer = (image.imread(tmp_path / f"{n}.png") for n in "bc")
    assert np.any(broadleaf != conifer)


def test_a_board_is_drawn(tmp_path: Path) -> None:
    board = section(pole(GROWN), (0, 0, 1), (0, 1, 0))
    assert board.years.tolist() == YEARS.tolist()
    draw_section(board, tmp_path / "board.png", widen=3.0)
    picture = image.imread(tmp_path / "board.png")
    assert (picture[:, :, :3].min(axis=2) < 0.9).mean() > 0.2
    draw_section(board, tmp_path / "foot.png", length_m=0.8)
    foot = image.imread(tmp_path / "foot.png")
    assert foot.shape[1] / foot.shape[0] > 1.5 * picture.shape[1] / picture.shape[0] / 3.0


def test_a_log_is_a_closed_solid_with_its_rings_on_both_ends(tmp_path: Path) -> None:
    to = tmp_path / "log.vtp"
    stem = pole(np.tril(np.full((4, 4), 0.1)).cumsum(axis=0))
    assert write_trunk(stem, to, height_m=1.5) == pyvista.read(to).n_cells
    log = pyvista.read(to)
    solid = log.clean(tolerance=0.0).triangulate()
    assert solid.n_open_edges == 0
    assert log.bounds[4:] == pytest.approx((0.0, 2.0))
    # the radius is 0.4 m up to the middle of the first internode, then falls to 0.3 m
    frustum = np.pi / 3 * (0.4**2 + 0.4 * 0.3 + 0.3**2)
    around = np.sin(2 * np.pi / 72) / (2 * np.pi / 72)
    expected = around * (0.5 * np.pi * 0.4**2 + frustum + 0.5 * np.pi * 0.3**2)
    assert solid.volume == pytest.approx(expected, rel=1e-3)
    centre = log.cell_centers().points
    foot = log["year"][np.abs(centre[:, 2]) < 1e-6]
    assert sorted(set(foot.tolist())) == YEARS.tolist()
    head = log["year"][np.abs(centre[:, 2] - 2.0) < 1e-6]
    assert sorted(set(head.tolist())) == [2002, 2003, 2004]
    middle = (centre[:, 2] > 0.1) & (centre[:, 2] < 1.9)
    assert set(log["year"][middle].tolist()) == {2004}


def test_a_whole_trunk_ends_at_its_top(tmp_path: Path) -> None:
    write_trunk(pole(GROWN), tmp_path / "trunk.vtp")
    trunk = pyvista.read(tmp_path / "trunk.vtp")
    assert trunk.bounds[5] == pytest.approx(4.0)
    assert trunk.clean(tolerance=0.0).triangulate().n_open_edges == 0
