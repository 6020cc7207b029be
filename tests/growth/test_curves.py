"""User-drawn curves against their slow twin."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.curves import curve
from tests.reference.curves import value_at

number = st.floats(-5, 5, allow_nan=False, width=32)


@given(st.lists(number, max_size=5, unique=True), st.data())
def test_curve(xs: list[float], data: st.DataObject) -> None:
    xs = sorted(xs)
    ys = data.draw(st.lists(number, min_size=len(xs), max_size=len(xs)))
    points = list(zip(xs, ys, strict=True))
    curve_n = np.array([[1, len(xs)]])
    curve_x, curve_y = np.full((1, 2, 6), 7.0), np.full((1, 2, 6), 7.0)
    curve_x[0, 1, : len(xs)] = xs
    curve_y[0, 1, : len(ys)] = ys
    for x in [*xs, data.draw(number), -9.0, 9.0]:
        got = curve(curve_n, curve_x, curve_y, 0, 1, x)
        np.testing.assert_allclose(got, value_at(points, x), rtol=1e-5, atol=1e-9)
