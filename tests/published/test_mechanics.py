"""Rods against exact answers: cantilevers, the elastica, cones, torsion, self-buckling.

Small deflections: any text on the strength of materials. Large deflections: the elastica under an
end load (Bisshopp & Drucker 1945) and under its own weight (Rohde 1953), recomputed by quadrature.
Self-buckling: Greenhill 1881. Lengths 1 m, E I 1 N m2 unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from forest.growth.dealing import deal
from forest.mechanics.rods import frame_new
from tests.mechanics.rod_cases import Case, chain, settled, tip_slope

SEGMENTS = 100

# P L^2 / E I: tip slope in rad, shortening, drop
END_LOAD = {
    0.5: (0.24453, 0.01592, 0.16214),
    1.0: (0.46135, 0.05643, 0.30172),
    2.0: (0.78175, 0.16064, 0.49346),
    5.0: (1.21537, 0.38763, 0.71379),
    10.0: (1.43029, 0.55500, 0.81061),
}
# q L^3 / E I
OWN_WEIGHT = {
    1.0: (0.16512, 0.00875, 0.12347),
    2.0: (0.32159, 0.03311, 0.23851),
    5.0: (0.69700, 0.15334, 0.49591),
    10.0: (1.05264, 0.34365, 0.70020),
    20.0: (1.33950, 0.55477, 0.82988),
}
# clamped at an angle above the horizontal, own weight: x, y, angle of the tip in degrees
INCLINED = {
    (30.0, 1.0): (0.91673, 0.39712, 21.213),
    (30.0, 5.0): (0.96971, -0.08780, -16.670),
    (60.0, 5.0): (0.85762, 0.46938, 17.857),
}


def _shape(case: Case) -> tuple[float, float, float]:
    """Slope, shortening and drop of the tip of a level rod."""
    assert settled(case).stable[0]
    x, _, z = case.arena.tip[-1]
    return tip_slope(case), 1.0 - float(x), -float(z)


def _inclined(degrees: float, load: float, segments: int) -> tuple[float, float, float]:
    """Tip x and z, and angle of the tip above the horizontal in degrees."""
    case = chain(segments, elevation=np.radians(degrees), weight=load)
    assert settled(case).stable[0]
    x, _, z = case.arena.tip[-1]
    return float(x), float(z), -float(np.degrees(tip_slope(case)))


@pytest.mark.parametrize("load", END_LOAD)
def test_elastica_under_an_end_load(load: float) -> None:
    assert _shape(chain(SEGMENTS, end_load=load)) == pytest.approx(END_LOAD[load], rel=0.01)


@pytest.mark.parametrize("load", OWN_WEIGHT)
def test_elastica_under_its_own_weight(load: float) -> None:
    assert _shape(chain(SEGMENTS, weight=load)) == pytest.approx(OWN_WEIGHT[load], rel=0.01)


@pytest.mark.parametrize(("degrees", "load"), INCLINED)
def test_elastica_clamped_at_an_angle(degrees: float, load: float) -> None:
    assert _inclined(degrees, load, SEGMENTS) == pytest.approx(INCLINED[degrees, load], rel=0.01)


def _assert_converges(
    shape: Callable[[int], tuple[float, ...]],
    exact: tuple[float, ...],
    digits: float | tuple[float, ...],
) -> None:
    """At least at first order as segments double, down to the digits of the table."""
    errors = [np.abs(np.subtract(shape(n), exact)) for n in (12, 24, 48, 96)]
    for coarse, fine in pairwise(errors):
        assert (fine <= np.maximum(0.5 * coarse, digits)).all()


@pytest.mark.parametrize("load", END_LOAD)
def test_elastica_under_an_end_load_converges(load: float) -> None:
    _assert_converges(lambda n: _shape(chain(n, end_load=load)), END_LOAD[load], 1.5e-5)


@pytest.mark.parametrize("load", OWN_WEIGHT)
def test_elastica_under_its_own_weight_converges(load: float) -> None:
    _assert_converges(lambda n: _shape(chain(n, weight=load)), OWN_WEIGHT[load], 1.5e-5)


@pytest.mark.parametrize(("degrees", "load"), INCLINED)
def test_elastica_clamped_at_an_angle_converges(degrees: float, load: float) -> None:
    digits = (2e-5, 2e-5, 1e-3)  # the angle is in degrees
    _assert_converges(lambda n: _inclined(degrees, load, n), INCLINED[degrees, load], digits)


def test_cantilever_of_small_deflection() -> None:
    slope, _, drop = _shape(chain(SEGMENTS, rigidity=2000.0, end_load=3.0))
    assert drop == pytest.approx(3.0 / (3.0 * 2000.0), rel=0.01)
    assert slope == pytest.approx(3.0 / (2.0 * 2000.0), rel=0.01)
    slope, _, drop = _shape(chain(SEGMENTS, rigidity=2000.0, weight=7.0))
    assert drop == pytest.approx(7.0 / (8.0 * 2000.0), rel=0.01)
    assert slope == pytest.approx(7.0 / (6.0 * 2000.0), rel=0.01)


def test_cantilever_cone_bends_to_a_circle_under_its_own_weight() -> None:
    """Constant curvature q0 L^2 / 12 E I0."""
    x = 1.0 - (np.arange(SEGMENTS) + 0.5) / SEGMENTS
    case = chain(SEGMENTS, rigidity=2000.0 * x**4, weight=7.0 * x**2)
    inner = SEGMENTS * 9 // 10  # the outermost cylinders are no cone
    assert _shape(case)[2] == pytest.approx(7.0 / (24.0 * 2000.0), rel=0.01)
    curvature = np.linalg.norm(case.rods.curvature[:inner], axis=1)
    assert curvature.mean() == pytest.approx(7.0 / (12.0 * 2000.0), rel=0.01)
    np.testing.assert_allclose(curvature, 7.0 / (12.0 * 2000.0), rtol=0.02)


def test_cantilever_cone_converges_as_segments_double() -> None:
    """Its tip slope errs by the cylinder at the very tip: 13 % at 100 segments, at first order."""
    errors = []
    for n in (50, 100, 200):
        x = 1.0 - (np.arange(n) + 0.5) / n
        slope, _, drop = _shape(chain(n, rigidity=2000.0 * x**4, weight=7.0 * x**2))
        errors.append((slope / (7.0 / 24000.0) - 1.0, drop / (7.0 / 48000.0) - 1.0))
    for coarse, fine in pairwise(errors):
        assert (np.abs(fine) < 0.55 * np.abs(coarse)).all()


def test_torsion_of_a_shaft_with_an_arm() -> None:
    """A weight at the end of a level arm twists the shaft by T L / G J."""
    n = SEGMENTS
    case = chain(n + 1, rigidity=1e6, twist_rigidity=50.0, end_load=2.0)
    case.arena.length[:] = 1.0 / n
    case.arena.length[n] = 0.5  # the arm, at right angles to the shaft
    case.arena.tip[:, 0] = np.minimum(np.arange(1, n + 2), n) / n
    case.arena.tip[n] = (1.0, 0.5, 0.0)
    frame_new(*case[:2], deal(case.trees.size), case.rods, 0, np.zeros((1, 3)), np.ones((1, 3)))
    case.rods.rigidity[:] = 1e6
    case.rods.rigidity[:n, 0] = 50.0
    settled(case)
    twist = case.rods.curvature[:n, 0].sum() / n
    assert abs(twist) == pytest.approx(2.0 * 0.5 / 50.0, rel=0.01)
    assert -case.arena.tip[n, 2] / 0.5 == pytest.approx(2.0 * 0.5 / 50.0, rel=0.01)


@pytest.mark.parametrize(
    ("taper", "critical"), [(0.0, 7.837347), (0.5, 2.0 * np.pi**2), (1.0, 30.529849)]
)
def test_column_loses_its_stability_at_greenhills_load(taper: float, critical: float) -> None:
    """rho g A0 L^3 / E I0 of the cylinder, the paraboloid and the cone; asked in one cycle."""
    x = 1.0 - (np.arange(SEGMENTS) + 0.5) / SEGMENTS
    for factor, stands in ((0.99, True), (1.01, False)):
        case = chain(
            SEGMENTS,
            elevation=0.5 * np.pi,
            rigidity=x ** (4.0 * taper),
            weight=factor * critical * x ** (2.0 * taper),
        )
        assert settled(case, most_passes=1).stable[0] == stands
