"""Gaps take exactly the trees inside, on a periodic plot those of all images."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.management.regions import inside
from forest.measure.stand import Plot
from forest.scenario.regions import Circle, Ellipse, Polygon, Rectangle, Region, Strip
from tests.reference import thinning as slow

SIZE = (20.0, 12.0)

places = st.tuples(st.floats(0, 20), st.floats(0, 12))
lengths = st.floats(0.5, 20)
azimuths = st.floats(-360, 360)


def turned(x: float, y: float, azimuth: float) -> complex:
    """Give a point in the frame of an azimuth."""
    return complex(x, y) * complex(
        math.cos(math.radians(-azimuth)), math.sin(math.radians(-azimuth))
    )


@st.composite
def shapes(draw: st.DrawFn) -> tuple[Region, Callable[[float, float], float]]:
    """A shape and a function that is below 1 inside, above 1 outside."""
    x, y = draw(places)
    a, b, azimuth = draw(lengths), draw(lengths), draw(azimuths)

    def local(px: float, py: float) -> tuple[float, float]:
        at = turned(px - x, py - y, azimuth)
        return at.real / (a / 2), at.imag / (b / 2)

    kind = draw(st.sampled_from(["circle", "ellipse", "rectangle", "polygon"]))
    if kind == "circle":
        return Circle(x_m=x, y_m=y, radius_m=a), lambda px, py: math.hypot(px - x, py - y) / a
    if kind == "ellipse":
        shape = Ellipse(x_m=x, y_m=y, size_m=(a, b), azimuth_deg=azimuth)
        return shape, lambda px, py: math.hypot(*local(px, py))
    if kind == "rectangle":
        shape = Rectangle(x_m=x, y_m=y, size_m=(a, b), azimuth_deg=azimuth)
        return shape, lambda px, py: max(map(abs, local(px, py)))
    signs = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    corners = [turned(i * a / 2, j * b / 2, -azimuth) + complex(x, y) for i, j in signs]
    polygon = Polygon(points_m=tuple((c.real, c.imag) for c in corners))
    return polygon, lambda px, py: max(map(abs, local(px, py)))


@settings(max_examples=80, deadline=None)
@given(shapes(), st.lists(places, max_size=20), st.booleans())
def test_exactly_what_is_inside(
    shape: tuple[Region, Callable[[float, float], float]],
    spots: list[tuple[float, float]],
    periodic: bool,
) -> None:
    region, measure = shape
    x, y = (np.array([spot[k] for spot in spots], np.float64) for k in (0, 1))
    found = inside(region, x, y, Plot(SIZE, periodic))
    for (px, py), here in zip(spots, found, strict=True):
        surely = slow.inside(lambda a, b: measure(a, b) < 1 - 1e-9, px, py, SIZE, periodic)
        perhaps = slow.inside(lambda a, b: measure(a, b) < 1 + 1e-9, px, py, SIZE, periodic)
        assert surely <= here <= perhaps


def test_a_hollow_polygon() -> None:
    corners = ((0, 0), (10, 0), (10, 10), (8, 10), (8, 2), (0, 2))
    region = Polygon(points_m=tuple((float(a), float(b)) for a, b in corners))
    x, y = np.array([1.0, 5.0, 9.0, 9.0, 5.0]), np.array([1.0, 5.0, 5.0, 11.0, 1.0])
    found = inside(region, x, y, Plot((20.0, 20.0), False))
    assert found.tolist() == [True, False, True, False, True]


@pytest.mark.parametrize("azimuth", [0.0, 90.0])
def test_a_road_across_the_seam(azimuth: float) -> None:
    """A strip at the edge of a periodic plot takes both sides of the seam, from end to end."""
    road = Strip(x_m=0.5, y_m=0.5, width_m=4.0, azimuth_deg=azimuth)
    grid = np.arange(0.25, 10, 0.5)
    along, across = (part.ravel() for part in np.meshgrid(grid, grid))
    x, y = (along, across) if azimuth == 0 else (across, along)
    found = inside(road, x, y, Plot((10.0, 10.0), True))
    assert (found == ((across < 2.5) | (across > 8.5))).all()
    open_plot = inside(road, x, y, Plot((10.0, 10.0), False))
    assert (open_plot == (across < 2.5)).all()
