"""`[regeneration]` in a scenario: what it says, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from forest.errors import InputError
from forest.scenario import Scenario

BASE: dict[str, Any] = {
    "years": 5,
    "plot": {"size_m": [10, 10]},
    "environment": {"shadow": {}, "canopy": {}},
    "species": {"betula_pendula": {}, "picea_abies": {}},
    "planting": {"kind": "random", "density_ha": 500},
    "regeneration": {"seed_rain": {"picea_abies": 5.0}},
}


def _with(**changes: Any) -> Scenario:
    return Scenario(**{**BASE, **changes})


def test_it_is_read_and_written() -> None:
    scenario = _with()
    assert scenario.regeneration is not None
    assert scenario.regeneration.seed_rain == {"picea_abies": 5.0}
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    assert Scenario(**{k: v for k, v in BASE.items() if k != "regeneration"}).regeneration is None
    bare = _with(planting={"kind": "explicit", "trees": []})
    assert len(bare.planting_positions()[0]) == 0
    assert Scenario.from_toml(bare.to_toml()) == bare


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"environment": {"shadow": {}}}, ["regeneration", "environment.canopy"]),
        ({"mode": "paper"}, ["regeneration", "mass_balance"]),
        (
            {"regeneration": {"seed_rain": {"picea_abie": 1.0}}},
            ["regeneration.seed_rain", "did you mean 'picea_abies'"],
        ),
        ({"regeneration": {"seed_rain": {"picea_abies": -1.0}}}, ["regeneration.seed_rain"]),
        ({"regeneration": {"cell_m": 0.5}}, ["regeneration.cell_m", "canopy.voxel_m = 1"]),
        ({"regeneration": {"cell": 2.0}}, ["unknown key 'cell'", "cell_m"]),
        (
            {"planting": {"kind": "explicit", "trees": []}, "regeneration": None},
            ["planting.trees", "regeneration.seed_rain"],
        ),
        (
            {"planting": {"kind": "explicit", "trees": []}, "regeneration": {}},
            ["regeneration.seed_rain"],
        ),
    ],
)
def test_refusals(changes: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(InputError) as refused:
        _with(**changes)
    assert "\n" not in str(refused.value)
    for word in words:
        assert word in str(refused.value)
