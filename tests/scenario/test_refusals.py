"""Every refusal is one line that names the place, the problem and the remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from forest.errors import InputError
from forest.scenario import Scenario

TEXT = """
years = 10
[plot]
size_m = [10, 10]
boundary = "periodic"
[environment.shadow]
[environment.canopy]
[species.picea_abies]
[species.pinus_sylvestris]
[planting]
kind = "stem_map"
file = "map.csv"
[output.sample_trees]
dbh_quantiles = [0.5]
"""
MAP = "x_m,y_m,species\n1,1,picea_abies\n2,2,pinus_sylvestris\n"
BOX = "obstacles = [{kind = 'box', min_m = [0, 0, 0], "


def refused(folder: Path, text: str = TEXT, stem_map: str | bytes = MAP) -> str:
    """Give the message of the refusal."""
    data = stem_map.encode() if isinstance(stem_map, str) else stem_map
    (folder / "map.csv").write_bytes(data)
    (folder / "stand.toml").write_text(text)
    with pytest.raises(InputError) as caught:
        Scenario.load(folder / "stand.toml")
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert message.startswith("stand.toml: ")
    return message


def test_the_text_is_right_before_it_is_spoilt(tmp_path: Path) -> None:
    (tmp_path / "map.csv").write_text(MAP)
    assert Scenario.from_toml(TEXT, folder=tmp_path).years == 10


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("years", "yeers", ["yeers", "did you mean 'years'?"]),
        ("years = 10", "", ["years: missing key", "1 to 10000"]),
        ("years = 10", "years = 0", ["years: 0", "1 to 10000"]),
        ("years = 10", "years = 10.5", ["whole number"]),
        ("years = 10", "years = '10'", ["years: '10'"]),
        ("years = 10", "years = true", ["years: True"]),
        ("years = 10", f"years = {'9' * 3000}", ["years: 999"]),
        ("years = 10", f"years = {'9' * 5000}", ["not TOML"]),
        ("years = 10", f"years = {'[' * 5000}", ["not TOML"]),
        ("years = 10", f"years = {'[' * 200}{']' * 200}", ["nested too deep"]),
        ("years = 10", f"years = 10\nsite.{'a.' * 3000}b = 1", ["nested too deep"]),
        ("years = 10", "years = 10\nself = 1", ["unknown key 'self'"]),
        ("years = 10", 'years = 10\n"a\\nb" = 1', ["unknown key"]),
        ("years = 10", f"years = 10\n{BOX}max_m = [1, 1, 0]}}]", ["obstacles[0].max_m"]),
        ("years = 10", f"years = 10\n{BOX}max_n = [1, 1, 1]}}]", ["did you mean 'max_m'?"]),
        ("years = 10", "years = 10\nobstacles = [{kind = 'mesh', file = 'a.stl'}]", ["a.stl"]),
        (
            "years = 10",
            "years = 10\nobstacles = [{kind = 'mesh', file = 'a.png'}]",
            ["'a.png' is no mesh", ".stl | .obj"],
        ),
        ("years = 10", "years = 10\nclimate.noise_sd = nan", ["climate.noise_sd: nan", "0 to 1"]),
        (
            "years = 10",
            "years = 10\nclimate.extreme_years = [{year = 1, factor = 1}, {year = 1, factor = 1}]",
            ["climate.extreme_years[1].year", "twice"],
        ),
        ("[10, 10]", "[10.5, 10]", ["plot.size_m", "for example [10, 10]"]),
        ("[10, 10]", "[10]", ["plot.size_m[1]: missing entry", "0.5 to 10000"]),
        ("[10, 10]", "[10, inf]", ["plot.size_m[1]: inf"]),
        ("[10, 10]", "[1, 1]", ["planting.file", "line 3", "outside the plot", "0 to 1"]),
        ('"periodic"', '"torus"', ["plot.boundary: 'torus'", '"periodic" | "open"']),
        ("[plot]", "plot = 3\n[other]", ["unknown key 'other'"]),
        (
            "[environment.shadow]\n[environment.canopy]",
            "[environment]",
            ["shadow, canopy, markers or rendered"],
        ),
        ("[environment.shadow]", "[environment.shadw]", ["did you mean 'shadow'?"]),
        ("[environment.shadow]", "[environment.shadow]\nb = 1", ["shadow.b: 1", "above 1"]),
        ("[environment.shadow]", "[environment.shadow]\nvoxel_m = 0.3", ["canopy.voxel_m", "0.9"]),
        ("[species.picea_abies]", "[species.picea_abis]", ["did you mean 'picea_abies'?"]),
        ("[species.picea_abies]", "[species.picea_abies]\nbase = 3", ["species.picea_abies.base"]),
        ("[species.picea_abies]", "[species.picea_abies]\nname = 'x'", ["picea_abies.name"]),
        ("[species.picea_abies]", "[species.picea_abies]\nwood = 3", ["picea_abies.wood: 3"]),
        ("[species.picea_abies]", "[species.picea_abies]\nsources = 3", ["picea_abies.sources: 3"]),
        (
            "[species.picea_abies]",
            "[species.picea_abies.carbon]\nlight_use = 1",
            ["species.picea_abies.carbon.light_use", "did you mean 'light_use_efficiency_kg_m2'?"],
        ),
        (
            "[species.picea_abies]",
            "[species.picea_abies.shoots]\ntropism_factor_by_age = [[1, 1], [1, 2]]",
            ["species.picea_abies.shoots.tropism_factor_by_age", "ascending"],
        ),
        (
            "[species.picea_abies]",
            "[species.picea_abies.shoots]\ntropism_direction = [0, 0, 0]",
            ["shoots.tropism_direction"],
        ),
        (
            "[species.picea_abies]",
            f"[species.picea_abies.bud_fate]\napical_control_until_age_years = {[5] * 9}",
            ["bud_fate.apical_control_until_age_years", "at most 8"],
        ),
        ("stem_map", "stemmap", ["unknown kind 'stemmap'", '"stem_map"']),
        ('kind = "stem_map"', "", ["missing key 'kind'"]),
        ("map.csv", "mop.csv", ["planting.file: no such file"]),
        ('"map.csv"', '"."', ["planting.file", "folder"]),
        ('"map.csv"', '"map.csv"\nspecies = "pine"', ["planting.species: unknown species 'pine'"]),
        ("[0.5]", "[1.5]", ["output.sample_trees.dbh_quantiles[0]: 1.5", "0 to 1"]),
        ("[0.5]", "[0.5]\nat_year = 2010", ["at_year: 2010", "2000 to 2009"]),
        ("[0.5]", "[0.5]\nids = [1, 3]", ["sample_trees.ids: no tree 3", "expected 1 to 2"]),
        (
            "[species.picea_abies]",
            "[species.picea_abies.architecture]\ninternode_factor_by_order = [[0, 1], [2, 0]]",
            ["species.picea_abies.architecture.internode_factor_by_order[1][1]: 0", "0.05"],
        ),
        (
            'kind = "stem_map"\nfile = "map.csv"',
            'kind = "explicit"\ntrees = [{x_m = 1, y_m = 1}]',
            ["planting.trees[0]: missing key 'species'"],
        ),
        (
            'kind = "stem_map"\nfile = "map.csv"',
            'kind = "explicit"\ntrees = [{x_m = 1, y_m = 11, species = "picea_abies"}]',
            ["planting.trees[0]", "outside the plot"],
        ),
    ],
)
def test_scenario(tmp_path: Path, old: str, new: str, parts: list[str]) -> None:
    assert old in TEXT
    message = refused(tmp_path, TEXT.replace(old, new, 1))
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("stem_map", "parts"),
    [
        ("", ["empty", "x_m, y_m"]),
        ("x_m,y_m\n", ["no tree"]),
        ("x,y\n1,1\n", ["line 1", "no column 'x_m'"]),
        ("x_m,y_m,x_m\n1,1,1\n", ["column twice"]),
        ("x_m,y_m\n1,1\n", ["line 2", "column 'species'"]),
        ("x_m,y_m,species\n1,1,picea\n", ["line 2", "did you mean 'picea_abies'?"]),
        (MAP + "3,nan,picea_abies\n", ["line 4", "'y_m'", "'nan'"]),
        (MAP + "1e999,3,picea_abies\n", ["line 4", "'x_m'"]),
        (MAP + "3,,picea_abies\n", ["line 4", "'y_m'"]),
        (MAP + "3,3\n", ["line 4", "2 columns", "expected 3"]),
        (MAP + "-1,3,picea_abies\n", ["line 4", "(-1, 3)", "outside the plot"]),
        (MAP + "1.005,1,picea_abies\n", ["line 4", "spot of line 2"]),
        (MAP + "9.999,5,picea_abies\n0,5,picea_abies\n", ["line 5", "spot of line 4"]),
        (MAP + '"3,3\n', ["line 4", "not CSV"]),
        (b"\xff\xfe" + MAP.encode(), ["UTF-8"]),
    ],
)
def test_stem_map(tmp_path: Path, stem_map: str | bytes, parts: list[str]) -> None:
    message = refused(tmp_path, stem_map=stem_map)
    assert message.startswith("stand.toml: planting.file: ")
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("yeers=3", "did you mean 'years'?"),
        ("plot.sizem=3", "did you mean 'size_m'?"),
        ("years=three", "years: 'three'"),
        ("years=1\nseed=2", "years: '1"),
        ("years", "expected key.path=value"),
        ("plot..size_m=1", "expected key.path=value"),
        ("years.first=1", "'years' is not a table"),
        ("site." + "a." * 3000 + "b=1", "nested too deep"),
        ("plot=open", "plot: 'open'"),
    ],
)
def test_overrides(tmp_path: Path, override: str, part: str) -> None:
    (tmp_path / "map.csv").write_text(MAP)
    scenario = Scenario.from_toml(TEXT, folder=tmp_path)
    with pytest.raises(InputError) as caught:
        scenario.with_overrides([override])
    assert str(caught.value).startswith("--set")
    assert part in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_periodic_plot_must_fit_the_shadow_where_there_is_no_canopy() -> None:
    with pytest.raises(InputError, match=r"for example \[1.2, 1.2\]"):
        Scenario(
            years=1,
            plot={"size_m": [1.1, 1.2], "boundary": "periodic"},
            environment={"shadow": {}},
            species={"picea_abies": {}},
            planting={"kind": "random", "density_ha": 1},
        )


def test_a_grid_that_fits_no_memory_is_refused() -> None:
    with pytest.raises(InputError, match=r"environment\.shadow\.voxel_m: 0\.2 is too fine"):
        Scenario(
            years=1,
            plot={"size_m": [10000, 10000]},
            environment={"shadow": {}},
            species={"picea_abies": {}},
            planting={"kind": "random", "density_ha": 1},
        )


@pytest.mark.parametrize("name", ["none.toml", ".", "a\0b.toml", "stand.toml/deeper"])
def test_files_that_cannot_be_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "stand.toml").write_text(TEXT)
    with pytest.raises(InputError) as caught:
        Scenario.load(tmp_path / name)
    assert len(str(caught.value).splitlines()) == 1


def test_text_that_is_not_utf8(tmp_path: Path) -> None:
    (tmp_path / "stand.toml").write_bytes(b"\xff\x00\x80")
    with pytest.raises(InputError, match="not UTF-8"):
        Scenario.load(tmp_path / "stand.toml")


@pytest.mark.parametrize(
    ("mechanics", "parts"),
    [
        ("wind_growth=true", ["mechanics.wind_m_s", "above 0"]),
        ("wind_m_s=9, wind_growth=true", ["mechanics.wind_growth", 'mode = "mass_balance"']),
    ],
)
def test_wind_growth_needs_wind_and_dry_mass(
    tmp_path: Path, mechanics: str, parts: list[str]
) -> None:
    message = refused(tmp_path, f'mode = "paper"\nmechanics = {{ {mechanics} }}\n{TEXT}')
    assert all(part in message for part in parts)
