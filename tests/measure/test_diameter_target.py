"""Target diameter distributions: by hand, their laws, and the overlap with a stand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.measure.diameter_target import reverse_j, rotated_sigmoid, stand_as_target

_dbh = st.lists(st.floats(0.1, 119.0), min_size=1, max_size=40)


@settings(max_examples=25, deadline=None)
@given(st.floats(1.01, 2.5), st.floats(1.0, 60.0), st.integers(1, 20), st.sampled_from([2.0, 5.0]))
def test_reverse_j_has_its_basal_area_and_quotient(q, ground, classes, width):
    target = reverse_j(q, ground, 5.0 + classes * width, class_cm=width)
    assert len(target.n_ha) == classes
    assert target.basal_area_m2ha.sum() == pytest.approx(ground)
    assert target.n_ha[:-1] == pytest.approx(q * target.n_ha[1:])
    middles = 0.5 * (target.limits_cm[1:] + target.limits_cm[:-1])
    each = [math.pi / 4 * (d / 100) ** 2 for d in middles]
    by_hand = sum(n * g for n, g in zip(target.n_ha, each, strict=True))
    assert by_hand == pytest.approx(ground)


def test_rotated_sigmoid_falls_less_in_the_middle():
    target = rotated_sigmoid(1.5, 1.0, (20.0, 40.0), 30.0, 60.0, least_cm=0.0, class_cm=10.0)
    assert target.n_ha[:-1] / target.n_ha[1:] == pytest.approx([1.5, 1.5, 1.0, 1.5, 1.5])
    assert target.basal_area_m2ha.sum() == pytest.approx(30.0)
    plain = rotated_sigmoid(1.5, 1.5, (20.0, 40.0), 30.0, 60.0)
    assert plain.n_ha == pytest.approx(reverse_j(1.5, 30.0, 60.0).n_ha)


@settings(max_examples=25, deadline=None)
@given(_dbh, _dbh, st.floats(0.01, 2.0))
def test_overlap_equals_the_count_class_by_class(one, other, hectares):
    """Of two stands of one area the smaller count of each class is common."""
    limits = list(range(0, 130, 10))
    target = stand_as_target(other, hectares, limits)
    got = target.agreement(one, hectares)
    common = 0
    for low in limits[:-1]:
        counts = [sum(low <= d < low + 10 for d in dbh) for dbh in (one, other)]
        common += min(counts)
    assert got.overlap_n == pytest.approx(2 * common / (len(one) + len(other)))
    assert 0.0 <= got.overlap_g <= 1.0 + 1e-12
    assert got.overlap == pytest.approx(math.sqrt(got.overlap_n * got.overlap_g))
    assert stand_as_target(one, hectares, limits).agreement(one, hectares) == pytest.approx(
        (1, 1, 1)
    )
    back = stand_as_target(one, hectares, limits).agreement(other, hectares)
    assert back == pytest.approx(got)


def test_classes_by_hand():
    target = stand_as_target([12.0, 12.0, 22.0], 0.1, [10.0, 20.0, 30.0])
    table = target.classes([5.0, 15.0, 20.0, 29.0, 31.0, math.nan], 0.1)
    assert table["n_ha"].tolist() == pytest.approx([10, 20, 10])
    assert table["target_n_ha"].tolist() == pytest.approx([20, 10, 0])
    assert table["surplus_n_ha"].tolist() == pytest.approx([-10, 10, 10])
    assert table["to_cm"].tolist() == [20, 30, np.inf]
    assert table["basal_area_m2ha"][1] == pytest.approx(math.pi / 4e4 * (20**2 + 29**2) / 0.1)
    assert target.agreement([5.0], 0.1) == (0.0, 0.0, 0.0)
    # 20 of 70 trees per ha are common: 10 in each class, counted for both
    assert target.agreement([15.0, 20.0, 29.0, 31.0], 0.1).overlap_n == pytest.approx(40 / 70)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: reverse_j(0.0, 30, 60), "q = 0.0; expected above 0"),
        (lambda: reverse_j(1.3, -1, 60), "basal_area_m2ha = -1"),
        (lambda: reverse_j(1.3, 30, 62), "do not fill 5 to 62 cm"),
        (lambda: reverse_j(1.3, 30, 5), "from 5 to 5 cm"),
        (lambda: rotated_sigmoid(1.3, 1.1, (30, 20), 30, 60), r"middle_cm = \[30, 20\]"),
        (lambda: stand_as_target([4.0], 1.0, [10, 20]), "no tree of these diameters"),
        (lambda: stand_as_target([4.0], 0.0, [0, 20]), "hectares = 0.0"),
        (lambda: stand_as_target([4.0], 1.0, [20, 10]), "limits do not ascend"),
    ],
)
def test_what_is_refused(make, says):
    with pytest.raises(InputError, match=says):
        make()
