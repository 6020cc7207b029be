"""The shipped species: every parameter with a value in the file and a source."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from forest.errors import InputError
from forest.species import Species, describe, load_species, shipped_table, species_names
from forest.species.model import SECTIONS

SHIPPED = [
    "betula_pendula",
    "fagus_sylvatica",
    "generic_deciduous",
    "picea_abies",
    "pinus_sylvestris",
    "quercus_robur",
]


def test_names() -> None:
    assert species_names() == SHIPPED


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_file_is_complete(name: str) -> None:
    table = shipped_table(name)
    species = load_species(name)
    assert species.name == name
    for section, model in SECTIONS.items():
        always = {k for k, field in model.model_fields.items() if field.default is not None}
        assert set(table[section]) == always, section
        for key in always:
            assert species.sources[section][key], f"{section}.{key} has no source"


def test_unknown_species_names_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'pinus_sylvestris'"):
        load_species("pinus_silvestris")


def test_species_are_frozen() -> None:
    spruce = load_species("picea_abies")
    with pytest.raises(ValidationError):
        spruce.wood.density_kg_m3 = 400.0  # type: ignore[misc]


@pytest.mark.parametrize("sources", [{"carbn": {}}, {"carbon": {"sapwood": "x"}}])
def test_sources_name_real_parameters(sources: dict[str, dict[str, str]]) -> None:
    with pytest.raises(ValidationError, match=r"sapwood|carbn"):
        Species(name="x", sources=sources)


def test_describe_explains_every_parameter() -> None:
    rows = {row.key: row for row in describe(Species)}
    for section, model in SECTIONS.items():
        for key in model.model_fields:
            row = rows[f"{section}.{key}"]
            assert row.description
            assert row.type
    row = rows["architecture.branching_angle_deg"]
    assert (row.type, row.unit, row.default, row.range) == ("number", "degree", "45.0", "0 to 150")
    assert rows["name"].default == "required"
