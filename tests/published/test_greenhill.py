"""Exact columns: self-buckling (Greenhill 1881) and the first bending frequency."""

from __future__ import annotations

import numpy as np
import pytest

from forest.mechanics.stability import Stability, stability
from forest.mechanics.stems import GRAVITY
from tests.mechanics.stem_cases import SPECIES, pole, tapered

_BASE_M, _LENGTH_M = 0.1, 12.0
_DENSITY, _MODULUS = float(SPECIES.green_density[0]), float(SPECIES.modulus[0])
_AREA = np.pi * _BASE_M**2
_RIGIDITY = _MODULUS * np.pi / 4.0 * _BASE_M**4
_WEIGHT = _DENSITY * GRAVITY * _AREA

# Shape: power of r ~ x^n, rho g A0 L^3 / (E I0), C of L = C (E / rho g)^(1/3) d0^(2/3), and c of
# omega = c sqrt(E I0 / (rho A0 L^4)).
SHAPES = {
    "cylinder": (0.0, 7.837347, 0.788285, 3.51602),
    "paraboloid": (0.5, 19.739209, 1.072515, 6.29851),
    "cone": (1.0, 30.529849, 1.240323, 8.71926),
}
shapes = pytest.mark.parametrize("shape", SHAPES)


def _measured(shape: str, n: int) -> Stability:
    return stability(*pole(tapered(n, SHAPES[shape][0], _BASE_M), _LENGTH_M), SPECIES)


def _errors(measure: str, shape: str, sizes: tuple[int, ...]) -> np.ndarray:
    found = []
    for n in sizes:
        out = _measured(shape, n)
        if measure == "buckling":
            exact = SHAPES[shape][1] * _RIGIDITY / (_WEIGHT * _LENGTH_M**3)
            found.append(out.safety_factor[0] / exact - 1.0)
        else:
            omega = SHAPES[shape][3] * np.sqrt(_RIGIDITY * GRAVITY / (_WEIGHT * _LENGTH_M**4))
            found.append(out.frequency_hz[0] * 2.0 * np.pi / omega - 1.0)
    return np.abs(found)


@shapes
def test_greenhill_constants(shape: str) -> None:
    assert _errors("buckling", shape, (100,)) < 0.01


@shapes
def test_greenhill_critical_heights(shape: str) -> None:
    stiff = _MODULUS / (_DENSITY * GRAVITY)
    height = SHAPES[shape][2] * stiff ** (1.0 / 3.0) * (2.0 * _BASE_M) ** (2.0 / 3.0)
    assert _measured(shape, 100).critical_height_m[0] == pytest.approx(height, rel=0.01)


@shapes
def test_first_bending_frequencies(shape: str) -> None:
    assert _errors("frequency", shape, (100,)) < 0.01


@pytest.mark.parametrize("measure", ["buckling", "frequency"])
@shapes
def test_greenhill_columns_converge(shape: str, measure: str) -> None:
    """Halving the segments halves the error at least."""
    errors = _errors(measure, shape, (64, 128, 256))
    assert np.all(errors[1:] < 0.5 * errors[:-1] + 2e-6)


def test_greenhill_column_at_its_critical_height() -> None:
    """A column as high as it can be has the safety factor 1."""
    stiff = _MODULUS / (_DENSITY * GRAVITY)
    height = 0.788285 * stiff ** (1.0 / 3.0) * (2.0 * _BASE_M) ** (2.0 / 3.0)
    out = stability(*pole(tapered(100, 0.0, _BASE_M), height), SPECIES)
    assert out.safety_factor[0] == pytest.approx(1.0, rel=1e-3)
