"""Scenarios: reading, completing, overriding and writing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forest.errors import InputError
from forest.scenario import Scenario, describe
from forest.species import load_species

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SHIPPED = [
    "finnish_pines",
    "mixed_stand",
    "paper_tree",
    "pruned_pine",
    "saxony_spruce",
    "self_thinning",
    "shaped_tree",
]


def small(**changes: Any) -> Scenario:
    """Build a small scenario in Python."""
    fields: dict[str, Any] = {
        "years": 10,
        "plot": {"size_m": [10, 10]},
        "environment": {"shadow": {}},
        "species": {"pinus_sylvestris": {}},
        "planting": {"kind": "random", "density_ha": 4000},
    }
    return Scenario(**(fields | changes))


@pytest.mark.parametrize("name", SHIPPED)
def test_round_trip(name: str, tmp_path: Path) -> None:
    scenario = Scenario.load(SCENARIOS / f"{name}.toml")
    text = scenario.to_toml()
    again = Scenario.from_toml(text, folder=tmp_path)  # nothing else is needed to read it
    assert again == scenario
    assert again.to_toml() == text
    assert again.digest() == scenario.digest()
    assert hash(again) == hash(scenario)


def test_round_trip_of_rare_tables(tmp_path: Path) -> None:
    (tmp_path / "cloud.csv").write_text("x_m,y_m,z_m\n1,2,3\n4,5,6\n")
    (tmp_path / "house.stl").write_text("solid\nendsolid\n")
    text = """
title = 'quoted "words", back\\slash, tab\t and ü'
years = 3
mode = "paper"
plot = {size_m = [10, 10]}
obstacles = [
    {kind = "box", min_m = [0, 0, 0], max_m = [1, 1, 1]},
    {kind = "mesh", file = "house.stl"},
]
climate.extreme_years = [{year = 2001, factor = 0.5}]
planting = {kind = "regular", spacing_m = [2, 2]}
[environment.markers]
envelope = [{shape = "box", center_m = [5, 5, 5], size_m = [4, 4, 4]}]
clouds = ["cloud.csv", [7, 8, 9]]
[species.my_oak]
base = "quercus_robur"
shoots.tropism_factor_by_age = [[0, 1], [20, -0.5]]
"""
    scenario = Scenario.from_toml(text, folder=tmp_path)
    markers = scenario.environment.markers
    assert markers is not None
    assert markers.clouds == ((1, 2, 3), (4, 5, 6), (7, 8, 9))
    assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_overridden_species_keeps_the_rest_and_says_so() -> None:
    scenario = small(
        species={"thin_pine": {"base": "pinus_sylvestris", "wood": {"density_kg_m3": 400}}}
    )
    (pine,) = scenario.species_list
    shipped = load_species("pinus_sylvestris")
    assert pine.name == "thin_pine"
    assert pine.wood.density_kg_m3 == 400
    assert pine.wood.twig_diameter_m == shipped.wood.twig_diameter_m
    assert pine.carbon == shipped.carbon
    assert pine.sources["wood"]["density_kg_m3"] == "set in the scenario"
    assert pine.sources["carbon"] == shipped.sources["carbon"]


def test_written_scenario_does_not_depend_on_the_shipped_species() -> None:
    scenario = small()
    text = scenario.to_toml().replace("density_kg_m3 = 422.0", "density_kg_m3 = 333.0")
    assert Scenario.from_toml(text).species_list[0].wood.density_kg_m3 == 333


def test_markers_return_unless_in_paper_mode() -> None:
    def release(**fields: Any) -> bool:
        markers = small(**fields).environment.markers
        assert markers is not None
        return markers.release

    assert release(environment={"markers": {}})
    assert not release(environment={"markers": {}}, mode="paper")
    assert release(environment={"markers": {"release": True}}, mode="paper")


def test_samples_are_chosen_in_the_last_year_by_default() -> None:
    assert small(start_year=1990).output.sample_trees.at_year == 1999


def test_overrides() -> None:
    scenario = Scenario.load(SCENARIOS / "saxony_spruce.toml")
    changed = scenario.with_overrides(
        [
            "years=3",
            "title=a plain text",
            "plot.size_m = [60, 40]",
            "species.picea_abies.carbon.sapwood_years=30",
            "climate.extreme_years=[{year = 2001, factor = 0.5}]",
        ]
    )
    assert (changed.years, changed.title, changed.plot.size_m) == (3, "a plain text", (60, 40))
    assert changed.species_list[0].carbon.sapwood_years == 30
    assert changed.climate.extreme_years[0].year == 2001
    assert changed.output.sample_trees.at_year == 2002
    assert changed.planting == scenario.planting
    assert scenario.with_overrides([]) == scenario
    assert changed.digest() != scenario.digest()


def test_overrides_reach_what_has_been_completed() -> None:
    scenario = Scenario.load(SCENARIOS / "saxony_spruce.toml")
    pines = ["planting.file=data/finnish_pines.csv", "species.pinus_sylvestris.share=2"]
    other = scenario.with_overrides(pines)
    x, _, species = other.planting_positions()
    assert len(x) == 126
    assert set(species.tolist()) == {1}
    assert len(scenario.planting_positions()[0]) == 134


def test_arrays_and_numpy_scalars_are_taken() -> None:
    scenario = small(years=np.int64(4), plot={"size_m": np.array([8.0, 6.0])})
    assert (scenario.years, scenario.plot.size_m) == (4, (8, 6))


def test_describe_lists_every_top_level_key() -> None:
    keys = [row.key for row in describe(Scenario)]
    for field in Scenario.model_fields:
        assert any(key.startswith(field) for key in keys), field
    assert len(keys) == len(set(keys))
    rows = {row.key: row for row in describe(Scenario)}
    assert rows["years"].default == "required"
    assert rows["environment.shadow.voxel_m"].unit == "m"
    assert rows["environment.shadow.b"].range == "above 1, at most 100"
    assert rows["planting(random).density_ha"].unit == "1/ha"
    assert "species.<name>.carbon.sapwood_years" in rows


def test_a_mesh_that_has_changed_makes_another_scenario(tmp_path: Path) -> None:
    mesh = tmp_path / "rock.stl"
    mesh.write_text("solid one")
    obstacles = [{"kind": "mesh", "file": str(mesh)}]
    first = small(obstacles=obstacles)
    assert Scenario.from_toml(first.to_toml()) == first
    mesh.write_text("solid two")
    assert small(obstacles=obstacles) != first
    with pytest.raises(InputError, match=r"obstacles\[0\]\.sha256: .* has changed"):
        Scenario.from_toml(first.to_toml())
