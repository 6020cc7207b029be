"""The densest stands: Reineke's index of pure stands as published, trees per ha."""

from __future__ import annotations

import pytest

from forest.measure.density import reineke_sdi
from forest.species import load_species

#: Birch has the value of paper birch.
PUBLISHED = {
    "picea_abies": 1018.0,
    "pinus_sylvestris": 1008.0,
    "fagus_sylvatica": 899.0,
    "betula_pendula": 1152.0,
}

#: Koivisto: Scots pine, Finland, Myrtillus type, natural normal stands; age: N per ha, Dq in cm.
KOIVISTO = {40: (2700, 11.2), 60: (1415, 17.2), 80: (940, 22.0)}


@pytest.mark.parametrize("name", PUBLISHED)
def test_shipped_species_have_the_published_maximum(name: str) -> None:
    assert load_species(name).mensuration.max_sdi == PUBLISHED[name]


def test_natural_stands_lie_below_it() -> None:
    """Fully stocked natural pine stands hold 65 to 80 % of the greatest density."""
    most = load_species("pinus_sylvestris").mensuration.max_sdi
    for n, dq in KOIVISTO.values():
        assert 0.65 < float(reineke_sdi(n, dq)) / most < 0.8
