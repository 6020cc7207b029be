"""Rules of thinning: against their twins, and what each promises whatever the stand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.management import thinning
from forest.management.thinning import Census
from forest.measure.stand import Plot
from tests.reference import thinning as slow
from tests.reference.thinning import Tree

SIZE = (20.0, 12.0)
MAX_SDI = np.array([900.0, 1100.0])
QUANTITIES = ("n_ha", "basal_area_m2ha", "sdi", "relative_density")


@st.composite
def forests(draw: st.DrawFn) -> list[Tree]:
    """Some trees; equal dbh and height happen, and trees without a dbh."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = draw(st.integers(0, 40))
    ids = rng.choice(10 * n + 1, n, replace=False) + 1
    return [
        Tree(
            int(ids[k]),
            int(rng.integers(0, 2)),
            float(rng.uniform(0, SIZE[0])),
            float(rng.uniform(0, SIZE[1])),
            None if rng.random() < 0.2 else float(rng.integers(10, 400)) / 10,
            float(rng.integers(5, 200)) / 10,
        )
        for k in range(n)
    ]


def shares(most: float) -> st.SearchStrategy[float]:
    """Shares by thousandths, so that none lies within rounding of a step."""
    return st.integers(0, round(1000 * most)).map(lambda n: n / 1000)


def census_of(trees: list[Tree]) -> Census:
    def each(values: list[Any], dtype: Any) -> Any:
        return np.array(values, dtype)

    return Census(
        each([t.tree_id for t in trees], np.int32),
        each([t.species for t in trees], np.int16),
        each([t.x for t in trees], np.float64),
        each([t.y for t in trees], np.float64),
        each([np.nan if t.dbh is None else t.dbh for t in trees], np.float64),
        each([t.height for t in trees], np.float64),
    )


@settings(max_examples=60, deadline=None)
@given(
    forests(),
    st.sampled_from(QUANTITIES),
    st.sampled_from(["below", "above"]),
    shares(1.2),
    st.booleans(),
)
def test_thinning_to_a_target(
    trees: list[Tree], quantity: str, method: str, share: float, one_species: bool
) -> None:
    """The same trees as one by one; the target met within one tree; the thinnest or thickest."""
    census, hectares = census_of(trees), Plot(SIZE, True).hectares
    of = [t for t in trees if not one_species or t.species == 0]
    counted = np.array([t in of for t in trees], np.bool_)
    whole = slow.density(of, quantity, hectares, MAX_SDI)
    rows = np.flatnonzero(counted)
    sign = 1 if method == "below" else -1
    order = census.from_thin_to_thick(rows) if sign > 0 else census.from_thick_to_thin(rows)
    twin = sorted(
        of, key=lambda t: (sign * slow.thickness(t)[0], sign * slow.thickness(t)[1], t.tree_id)
    )
    limit = share * whole
    target = (quantity, limit)
    gone = thinning.thin_to(order, counted, census, target, hectares, MAX_SDI)
    ids = census.tree_id[gone].tolist()
    assert ids == slow.thin(of, twin, quantity, limit, hectares, MAX_SDI)

    left = [t for t in of if t.tree_id not in ids]
    close = 1e-8 * whole
    assert slow.density(left, quantity, hectares, MAX_SDI) <= limit + close
    if ids:
        (last,) = (t for t in of if t.tree_id == ids[-1])
        assert slow.density([*left, last], quantity, hectares, MAX_SDI) > limit - close
        taken = [slow.thickness(t) for t in of if t.tree_id in ids]
        kept = [slow.thickness(t) for t in left if t.dbh is not None or quantity == "n_ha"]
        if kept:
            assert max(taken) <= min(kept) if sign > 0 else min(taken) >= max(kept)


@settings(max_examples=25, deadline=None)
@given(forests(), shares(1.0))
def test_shares_that_go(trees: list[Tree], share: float) -> None:
    """A share of trees or basal area is the target of what is left."""
    census, hectares = census_of(trees), Plot(SIZE, True).hectares
    every = np.ones(len(trees), np.bool_)
    order = census.from_thin_to_thick(np.arange(len(trees)))
    for key, quantity in (("share_n", "n_ha"), ("share_g", "basal_area_m2ha")):
        limit = (1 - share) * slow.density(trees, quantity, hectares, MAX_SDI)
        some = thinning.thin_to(order, every, census, (key, share), hectares, MAX_SDI)
        same = thinning.thin_to(order, every, census, (quantity, limit), hectares, MAX_SDI)
        assert some.tolist() == same.tolist()


@settings(max_examples=25, deadline=None)
@given(forests(), st.integers(0, 2**32))
def test_random_order_hangs_on_trees_alone(trees: list[Tree], seed: int) -> None:
    """Rows in another order, or without some trees: the others keep their order."""
    census = census_of(trees)
    rows = np.arange(len(trees))
    order = census.at_random(rows, seed, 1, 5)
    assert sorted(order) == rows.tolist()
    assert census.at_random(rows[::-1], seed, 1, 5).tolist() == order.tolist()
    some = census.at_random(rows[::2], seed, 1, 5)
    assert some.tolist() == [row for row in order if row % 2 == 0]


def test_random_thinning_is_even() -> None:
    """Of 1000 trees of ten sizes, a half taken at random leaves about a half of each size."""
    n = 1000
    size = np.arange(n) % 10
    census = Census(*(np.arange(n),) * 2, *(np.zeros(n),) * 2, size + 1.0, size + 2.0)
    gone = census.at_random(np.arange(n), 1, 1, 1)[: n // 2]
    assert np.all(np.abs(np.bincount(size[gone]) - 50) < 20)
    other = census.at_random(np.arange(n), 1, 1, 2)[: n // 2]
    assert 150 < len(np.intersect1d(gone, other)) < 350


@settings(max_examples=25, deadline=None)
@given(
    st.integers(1, 12), st.integers(1, 12), st.integers(1, 5), st.integers(1, 9), st.floats(0.1, 3)
)
def test_whole_rows_go(rows: int, columns: int, every: int, first: int, spacing: float) -> None:
    number = np.repeat(np.arange(rows), columns)
    gone = thinning.rows_of_trees((number + 0.5) * spacing, spacing, every, first)
    by_row = gone.reshape(rows, columns)
    assert (by_row.all(axis=1) == by_row.any(axis=1)).all()
    assert np.flatnonzero(by_row[:, 0]).tolist() == list(range(first - 1, rows, every))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0, 100), max_size=30), st.floats(0.1, 5), st.floats(5.1, 20))
def test_strips(places: list[float], width: float, spacing: float) -> None:
    across = np.array(places, np.float64)
    gone = thinning.strips_of_trees(across, width, spacing)
    for place, goes in zip(places, gone, strict=True):
        away = min(abs(place - (k + 0.5) * spacing) for k in range(25))
        if abs(away - width / 2) > 1e-9:
            assert goes == (away < width / 2)


@settings(max_examples=60, deadline=None)
@given(forests(), st.integers(0, 8), st.floats(0, 8), st.integers(1, 4), st.booleans())
def test_crop_trees_and_their_competitors(
    trees: list[Tree], count: int, spacing: float, strongest: int, periodic: bool
) -> None:
    census, plot = census_of(trees), Plot(SIZE, periodic)
    order = census.from_thick_to_thin(np.flatnonzero(~np.isnan(census.dbh_cm)))
    crop = thinning.spaced(order, census, plot, spacing, count=count)
    thick = [t for t in trees if t.dbh is not None]
    twins = slow.crop_trees(thick, count, spacing, SIZE, periodic)
    assert census.tree_id[crop].tolist() == [t.tree_id for t in twins]
    for k, a in enumerate(twins):
        assert all(slow.distance(a, b, SIZE, periodic) >= spacing for b in twins[:k])
    everyone = np.ones(len(trees), np.bool_)
    gone = thinning.competitors(crop, census, everyone, plot, strongest, 5.0)
    assert set(census.tree_id[gone]) == slow.pressing(twins, trees, strongest, 5.0, SIZE, periodic)
    assert not set(gone) & set(crop)
    for fewer in range(1, strongest):  # those of fewer competitors go first
        first = thinning.competitors(crop, census, everyone, plot, fewer, 5.0)
        assert gone[: len(first)].tolist() == first.tolist()


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_seed_trees_stop_at_their_basal_area(share: float) -> None:
    dbh = np.array([30.0, 10.0, 20.0, 20.0])
    census = Census(np.arange(4), np.zeros(4, int), np.arange(4.0), np.zeros(4), dbh, dbh)
    order = census.from_thick_to_thin(np.arange(4))
    enough = share * float(census.basal_area_m2.sum())
    kept = thinning.spaced(order, census, Plot(SIZE, False), 0.0, basal_area_m2=enough)
    assert kept.tolist() == {0.0: [], 0.3: [0], 1.0: [0, 2, 3, 1]}[share]
