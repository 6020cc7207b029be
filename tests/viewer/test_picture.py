"""Where a point of a page lies in the picture that is fitted into it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.viewer.picture import place_in

_SIDE = st.integers(20, 4000)
_SHARE = st.floats(0.0, 1.0)


@given(_SIDE, _SIDE, _SIDE, _SIDE, _SHARE, _SHARE)
def test_a_point_of_the_picture_is_found_where_it_is_drawn(
    page_w: int, page_h: int, wide: int, high: int, across: float, down: float
) -> None:
    # As browsers lay out `object-fit: contain`: one scale, in the middle, nothing cut off.
    scale = page_w / wide if page_w * high < page_h * wide else page_h / high
    x = page_w / 2 + (across - 0.5) * wide * scale
    y = page_h / 2 + (down - 0.5) * high * scale
    assert -1e-6 <= x <= page_w + 1e-6 and -1e-6 <= y <= page_h + 1e-6
    place = place_in(x, y, (page_w, page_h), (wide, high))
    assert place == pytest.approx((across, down), abs=1e-9)


def test_margins_lie_beside_the_picture() -> None:
    assert place_in(10, 50, (400, 100), (100, 100))[0] < 0.0
    assert place_in(50, 390, (100, 400), (100, 100))[1] > 1.0
