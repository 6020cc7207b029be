"""Numbers of reaction wood: the bending of a ringed rod, and Taylor-Hell 2005, eqs 8 to 19.

A rod to which thin rings with the maturation strain e0 + (D/2) cos theta are added from R1 to R2
bends by kappa = 2 D (1/R1 - 1/R2); an eccentric ring dR (1 + e cos theta) of uniform strain e0 by
d kappa / dR = 4 e0 e / R^2 (Fournier, Bailleres and Chanson 1994; beam theory).
"""

from __future__ import annotations

import numpy as np
import pytest

from forest.mechanics.righting import BETA, STRAIN
from tests.mechanics.test_wood import lay, round_rods, traits_of

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
MODULUS = 8e9
ONE_WOOD = {
    "modulus_juvenile_gpa": 8.0,
    "modulus_mature_gpa": 8.0,
    "modulus_reaction_gpa": 8.0,
}


@pytest.mark.parametrize("name", ["picea_abies", "fagus_sylvatica"])
@pytest.mark.parametrize(("first", "last", "rings"), [(0.01, 0.02, 100), (0.05, 0.06, 10)])
def test_reaction_wood_in_thin_rings_bends_by_the_formula(
    name: str, first: float, last: float, rings: int
) -> None:
    difference = 0.003
    woods = traits_of(name, ring_strain_difference=difference, ring_swell=1.0, **ONE_WOOD)
    rods = round_rods(1, first, MODULUS, frame=LEVEL)
    for radius in np.linspace(first, last, rings + 1)[1:]:
        lay(rods, radius, woods, STRAIN)
        rods.curvature[:] = rods.rest
    kappa = np.linalg.norm(rods.rest[0])
    assert kappa == pytest.approx(2 * difference * (1 / first - 1 / last), rel=0.01)


@pytest.mark.parametrize("radius", [0.005, 0.1])
@pytest.mark.parametrize("swell", [1.2, 1.9])
def test_eccentric_reaction_wood_of_uniform_strain_bends_by_the_formula(
    radius: float, swell: float
) -> None:
    strain, width = 0.001, radius / 500
    woods = traits_of(ring_strain=strain, ring_strain_difference=0.0, ring_swell=swell, **ONE_WOOD)
    rods = round_rods(1, radius, MODULUS, frame=LEVEL)
    ring = lay(rods, radius + width, woods, STRAIN)
    per_width = np.linalg.norm(rods.rest[0]) / width
    expected = 4 * strain * float(ring[0, 0]) / radius**2
    assert ring[0, 0] == pytest.approx(swell - 1)
    assert per_width == pytest.approx(expected, rel=0.01)


def test_elliptical_ring_of_reaction_wood() -> None:
    """Eqs 16 to 19 and 8 by hand: a round core of 10 mm, a ring 1.5 times as wide along U."""
    woods = traits_of(
        modulus_juvenile_gpa=6.0,
        modulus_mature_gpa=8.0,
        modulus_reaction_gpa=10.0,
        ring_swell=1.5,
        rest_share=0.25,
        shear_ratio=0.06,
    )
    woods["maturing"] = 0.0
    rods = round_rods(1, 0.01, 8e9, rest=[0.0, 0.1, 0.0], curvature=[0.0, 0.5, 0.2])
    a, b = 0.013, 0.012  # 3 mm and 2 mm wide
    lay(rods, np.sqrt(a * b), woods, BETA)
    along_a = np.pi / 4 * (a**3 * b - 0.01**4)
    along_b = np.pi / 4 * (b**3 * a - 0.01**4)
    twist = np.pi * a**3 * b**3 / (a**2 + b**2) - np.pi / 2 * 0.01**4
    ring_modulus = (10e9 + 6e9) / 2
    core = 8e9 * np.pi / 4 * 0.01**4
    ring = ring_modulus * np.array([0.06 * twist, along_a, along_b])
    whole = ring + core * np.array([2 * 0.06, 1.0, 1.0])
    np.testing.assert_allclose(rods.rigidity[0], whole, rtol=1e-5)
    ring_rest = 0.75 * np.array([0.5, 0.2]) + 0.25 * np.array([0.1, 0.0])
    expected = (core * np.array([0.1, 0.0]) + ring[1:] * ring_rest) / whole[1:]
    np.testing.assert_allclose(rods.rest[0, 1:], expected, rtol=1e-5)
