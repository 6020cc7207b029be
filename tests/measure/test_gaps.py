"""Canopy gaps: by hand, and against every cell that asks every crown."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.measure.crowns import Crowns, crowns_of
from forest.measure.gaps import gap_share, gaps, label_patches
from forest.measure.stand import Plot
from forest.measure.tables import measure_stand, plot_of
from forest.stand import Stand
from tests.reference import gaps as slow
from tests.tiny import tiny

SIZE = (6.0, 4.0)
CELLS = (12, 8)
REACH = [f"crown_radius_{45 * k:03d}_m" for k in range(8)]

# no foot on the centre of a cell, where every triangle of an octagon begins
_place = st.builds(
    lambda i, j: (0.01 * i + 0.0013, 0.01 * j + 0.0013), st.integers(0, 599), st.integers(0, 399)
)
_row = st.lists(st.booleans(), min_size=5, max_size=5)
_reach = st.lists(st.just(0.0) | st.floats(0.01, 3.0), min_size=8, max_size=8)
_ROUNDING = 1e-9


def trees_of(places: list[tuple[float, float]], radius: object, height: object) -> pd.DataFrame:
    x, y = zip(*places, strict=True) if places else ((), ())
    table = pd.DataFrame({"x_m": x, "y_m": y}, dtype=float)
    table["dbh_cm"] = 20.0
    table["height_m"] = height
    table["crown_radius_m"] = radius
    return table.astype(float)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(_place, _reach), max_size=5), st.booleans())
def test_open_cells_equal_the_slow_twin(crowns, periodic):
    """As discs and as octagons; a centre on a crown's very edge may go either way."""
    places = [place for place, _ in crowns]
    plot = Plot(SIZE, periodic)
    table = trees_of(places, [reach[0] for _, reach in crowns], 10.0)
    shaped = table.copy()
    shaped[REACH] = np.array([reach for _, reach in crowns]).reshape(len(crowns), 8)
    for of, shapes in (
        (table, [reach[0] for _, reach in crowns]),
        (shaped, [r for _, r in crowns]),
    ):
        wide, narrow = (
            slow.open_cells(places, (np.array(shapes) * k).tolist(), SIZE, CELLS, periodic)
            for k in (1.0 + _ROUNDING, 1.0 - _ROUNDING)
        )
        found = gaps(of, plot)
        is_open = found.label > 0
        assert (wide <= is_open).all()
        assert (is_open <= narrow).all()
        sizes = sorted(0.25 * len(patch) for patch in slow.patches(is_open, periodic))
        assert sorted(found.area_m2) == pytest.approx(sizes)
        assert found.share() == pytest.approx(is_open.mean())


@settings(max_examples=25, deadline=None)
@given(st.lists(_row, min_size=1, max_size=5), st.booleans())
def test_patches_equal_the_flood(rows, periodic):
    marked = np.array(rows)
    got = label_patches(marked, periodic)
    mine = {frozenset(zip(*np.nonzero(got == k), strict=True)) for k in range(1, got.max() + 1)}
    assert mine == {frozenset(patch) for patch in slow.patches(marked, periodic)}
    assert ((got > 0) == marked).all()


def test_a_patch_goes_on_across_the_edges_of_a_periodic_plot():
    corners = np.zeros((4, 5), bool)
    corners[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    assert label_patches(corners, True).max() == 1
    assert label_patches(corners, False).max() == 4
    assert label_patches(~corners, True).max() == 1
    assert label_patches(np.zeros((2, 2), bool), True).max() == 0


def test_only_high_trees_close_the_canopy():
    table = trees_of([(3.0, 2.0), (1.0, 1.0)], [9.0, 1.0], [3.0, 12.0])
    plot = Plot(SIZE, False)
    found = gaps(table, plot)
    assert found.taller_than_m == pytest.approx(4.0)  # a third of the highest tree's height
    assert found.share() == pytest.approx(1 - 12 * 0.25 / 24)
    assert gap_share(table, plot, taller_than_m=2.0) == 0.0
    assert gap_share(table, plot, taller_than_m=12.0) == 1.0
    empty = gaps(table[:0], plot)
    assert empty.area_m2 == pytest.approx([24.0])
    assert math.isnan(empty.taller_than_m)
    with pytest.raises(InputError, match="taller_than_m = -1"):
        gaps(table, plot, taller_than_m=-1)


def test_sizes_by_hand():
    # a wall of crowns along x = 2 and x = 5 leaves strips of 2 and 1 m, and 1 m at the far edge
    y = np.arange(0.25, 4, 0.5)
    table = trees_of([(x, k) for x in (1.25, 4.25) for k in y], 0.3, 10.0)
    found = gaps(table, Plot(SIZE, False))
    assert sorted(found.area_m2) == pytest.approx([4.0, 6.0, 10.0])
    assert sorted(gaps(table, Plot(SIZE, True)).area_m2) == pytest.approx([10.0, 10.0])
    sizes = found.sizes([0.0, 4.0, 7.0, 10.0])
    assert sizes["gaps"].tolist() == [0, 2, 0]  # 10 m2 begins a class that was not asked for
    assert sizes["share"].tolist() == pytest.approx([0.0, 10 / 24, 0.0])
    assert sizes["gaps_ha"].sum() == pytest.approx(2 / 0.0024)
    assert found.sizes()["share"].sum() == pytest.approx(found.share())
    assert found.share(least_m2=6.0) == pytest.approx(16 / 24)
    with pytest.raises(InputError, match="limits do not ascend"):
        found.sizes([1.0, 1.0])


def test_a_live_stand_has_crowns_of_its_own_shape():
    stand = Stand(tiny())
    for _ in range(6):
        stand.step()
    trees, plot = measure_stand(stand), plot_of(stand.scenario)
    crowns: Crowns = crowns_of(stand.arena.metamers, stand.rows)
    of_shapes = gaps(trees, plot, taller_than_m=0.0).share()
    of_discs = gaps(trees.drop(columns=REACH), plot, taller_than_m=0.0).share()
    assert of_shapes != of_discs
    octagons = crowns.radius_m * np.roll(crowns.radius_m, 1, axis=1)
    most = math.sin(math.pi / 4) / 2 * octagons.sum() / 100  # crowns that do not overlap
    assert 1 - of_shapes <= most + 0.02
