"""Seedlings survive at 1 to 3 % of full light (tolerant), 10 to 30 % (intermediate), up to 60 %."""

from __future__ import annotations

import numpy as np
import pytest

from forest.dynamics.regeneration.cohorts import survival
from forest.species import load_species

#: Least light at which they live for some years, as a share of full light.
RANGES = {
    "fagus_sylvatica": (0.01, 0.03),
    "picea_abies": (0.01, 0.03),
    "quercus_robur": (0.10, 0.30),
    "betula_pendula": (0.10, 0.60),
    "pinus_sylvestris": (0.10, 0.60),
}


@pytest.mark.parametrize("name", RANGES)
def test_light_at_which_half_survive_five_years(name: str) -> None:
    of = load_species(name).regeneration
    light = np.linspace(0.001, 1.0, 2000)
    alive = np.array([survival(x, of.survival_light_half, of.survival_max) ** 5 for x in light])
    assert (np.diff(alive) > 0).all()
    half = float(light[np.argmax(alive > 0.5)])
    low, high = RANGES[name]
    assert low <= half <= high
