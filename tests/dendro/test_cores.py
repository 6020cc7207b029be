"""Cores through and past the pith of round and eccentric stems."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.dendro import bore, core, radial_widths
from forest.dendro.stems import StemRings, stem_rings
from forest.errors import InputError
from tests.reference.cores import walk

from .ringing import ring_frame


def one_stem(width_mm, **more) -> StemRings:
    """The rings of tree 3 from 2001 on, as they come out of their frame."""
    (stem,) = stem_rings(ring_frame(3, 2001, width_mm, **more))
    return stem


def test_through_the_pith_of_a_round_stem():
    taken = bore(one_stem([4, 2, 0, 1]), 77.0)
    assert taken.width_mm.tolist() == [4, 2, 0, 1]
    assert taken.year.tolist() == [2001, 2002, 2003, 2004]
    assert (taken.first_cambial_age, taken.pith_offset, taken.miss_mm) == (1, 0, 0.0)
    assert taken.estimated_pith_offset == 0


def test_a_chord_past_the_pith_by_hand():
    # Outlines of radius 5, 13 and 20; the bore passes the pith at 12 = 20 sin(aim).
    stem = one_stem([5, 8, 7])
    taken = bore(stem, 10.0, math.degrees(math.asin(12 / 20)))
    assert taken.miss_mm == pytest.approx(12.0)
    assert taken.year.tolist() == [2003]  # the second ring is entered, not passed
    assert taken.width_mm == pytest.approx([16.0 - 5.0])
    assert (taken.first_cambial_age, taken.pith_offset) == (3, 2)
    assert taken.estimated_pith_offset == round(13 / 11)


def test_a_bore_that_stays_in_the_last_ring_is_empty():
    taken = bore(one_stem([5, 8, 7]), 10.0, 60.0)
    assert len(taken.year) == len(taken.width_mm) == 0
    assert taken.pith_offset == 3


def test_the_pith_is_no_point():
    stem = one_stem([10, 10])
    near, past = (bore(stem, 0.0, math.degrees(math.asin(m / 20))) for m in (0.9, 1.1))
    assert (near.pith_offset, near.width_mm.tolist()) == (0, [10, 10])
    assert past.pith_offset == 1


def test_thick_and_thin_side_of_an_eccentric_stem():
    stem = one_stem([4, 2, 1], eccentricity=[0.5, 0, 0.25], thick_side_deg=30.0)
    assert bore(stem, 30.0).width_mm == pytest.approx([6, 2, 1.25])
    assert bore(stem, 210.0).width_mm == pytest.approx([2, 2, 0.75])
    assert radial_widths(stem, 30.0) == pytest.approx([6, 2, 1.25])
    assert radial_widths(stem, 120.0) == pytest.approx([4, 2, 1])


rings = st.lists(
    st.tuples(
        st.sampled_from([0.0, 1.5, 3.0, 6.5]),
        st.sampled_from([0.0, 0.2, 0.6]),
        st.integers(0, 7).map(lambda k: 45.0 * k),
    ),
    min_size=1,
    max_size=6,
).filter(lambda some: some[0][0] > 0.0)


# None of them touches a ring just so: there the walk would not see it.
aims = st.integers(-40, 40).map(lambda k: k + 0.37)


def stem_of(some):
    width, e, side = zip(*some, strict=True)
    return one_stem(width, eccentricity=e, thick_side_deg=side)


@settings(max_examples=25, deadline=None)
@given(rings, st.integers(0, 359), aims)
def test_the_core_is_what_a_walk_along_the_bore_passes(some, azimuth, aim):
    step = 0.01
    taken = bore(stem_of(some), azimuth, aim)
    if taken.miss_mm == 0.0:
        assert taken.pith_offset == 0
    else:
        walked = walk(some, azimuth, aim, step)[::-1]
        assert len(taken.width_mm) == len(walked)
        assert taken.width_mm == pytest.approx(walked, abs=2 * step)


@settings(max_examples=25, deadline=None)
@given(rings, st.integers(0, 359))
def test_radial_widths_hold_to_first_order(some, azimuth):
    gentle = [(w, 0.02 * e, a) for w, e, a in some]
    stem = stem_of(gentle)
    assert bore(stem, azimuth).width_mm == pytest.approx(
        radial_widths(stem, azimuth), abs=30 * 0.02**2
    )


@settings(max_examples=25, deadline=None)
@given(rings, st.integers(0, 359), st.integers(-80, 80))
def test_a_core_accounts_for_every_ring(some, azimuth, aim):
    taken = bore(stem_of(some), azimuth, aim)
    assert taken.pith_offset + len(taken.width_mm) == len(some)
    assert np.all(taken.width_mm >= 0.0)
    assert taken.miss_mm == pytest.approx(bore(stem_of(some), azimuth, -aim).miss_mm)


def test_the_borer_is_aimed_with_an_error_that_hangs_on_the_place_alone():
    both = ring_frame(3, 2001, [5] * 40)
    one, again = (core(both, 3, 360.0 + 40.0, aim_sd_deg=5, seed=2) for _ in range(2))
    assert one.aim_deg == again.aim_deg == core(both, 3, 40.0, aim_sd_deg=5, seed=2).aim_deg
    assert core(both, 3, 40.0).aim_deg == 0.0
    aims = [core(both, 3, a, aim_sd_deg=5, seed=2).aim_deg for a in range(360)]
    assert np.std(aims) == pytest.approx(5.0, rel=0.15)
    assert np.mean(aims) == pytest.approx(0.0, abs=1.0)


def test_the_missing_rings_of_an_even_stem_are_estimated_well():
    stem = one_stem([2.0] * 50)
    for aim in (3.0, 6.0, 10.0):
        taken = bore(stem, 0.0, aim)
        assert taken.pith_offset > 1
        assert 0.5 * taken.pith_offset <= taken.estimated_pith_offset <= taken.pith_offset


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tree_id": 4}, "tree 4 has no rings; expected one of 1 trees with rings, 3 to 3"),
        ({"stem_height_m": 5.0}, "no rings at 5 m; expected a height on record: 1.3 m"),
        ({"aim_sd_deg": 31.0}, "aim_sd_deg is 31; expected 0 to 30"),
        ({"azimuth_deg": math.nan}, "azimuth nan"),
    ],
)
def test_refused(change, message):
    with pytest.raises(InputError, match=message):
        core(**{"rings": ring_frame(3, 2001, [1.0]), "tree_id": 3, "azimuth_deg": 0.0} | change)
