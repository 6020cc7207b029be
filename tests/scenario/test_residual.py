"""What a scenario may say of residual trees, what it may not, and the script that shows one."""

from __future__ import annotations

import importlib
from pathlib import Path

import pandas as pd
import pytest

from forest.errors import InputError
from forest.scenario import Scenario
from tests.test_bad_input import refused
from tests.tiny import TOML, tiny

TREES = """
[[residual_trees]]
name = "old"
x_m = 5
y_m = 5
species = "quaking_aspen"
height_m = 8
[[residual_trees]]
name = "edge"
x_m = 0.5
y_m = 9
species = "black_tupelo"
height_m = 5
like = "fagus_sylvatica"
[[acts]]
kind = "fell"
year = 2004
residual = ["old"]
"""
AGAIN = '[[acts]]\nkind = "fell"\nyear = 2006\nresidual = "old"\n'

BAD = [
    ("x_m = 5", "x_m = 50", "residual_trees[0]: (50, 5) is outside the plot"),
    ("x_m = 5", "xm = 5", "residual_trees[0].xm: unknown key 'xm', did you mean 'x_m'?"),
    ("quaking_aspen", "quaking_aspin", "residual_trees[0].species: unknown parametric species"),
    ("quaking_aspen", "quaking_aspin", "did you mean 'quaking_aspen'?"),
    ("quaking_aspen", "mine.toml", "residual_trees[0].species: mine.toml: no such file"),
    ("quaking_aspen", "broken.toml", "residual_trees[0].species: broken.toml: level: "),
    ("height_m = 8", "height_m = 0.1", "residual_trees[0].height_m: 0.1 is not allowed"),
    ("height_m = 8", "height_m = 800", "expected number, 0.5 to 150"),
    ("height_m = 8", "", "residual_trees[0].height_m: missing key 'height_m'"),
    ("height_m = 8", "height_m = 8\ndbh_cm = -1", "residual_trees[0].dbh_cm: -1"),
    ("height_m = 8", "height_m = 8\ndbh_cm = 201", "dbh_cm: 201 cm is no trunk of a tree of 8 m"),
    ("height_m = 8", "height_m = nan", "residual_trees[0].height_m: nan"),
    ("height_m = 8", "height_m = 8\ncrown_lai = 99", "residual_trees[0].crown_lai: 99"),
    ("height_m = 8", "height_m = 8\nseed = -1", "residual_trees[0].seed: -1"),
    ('"edge"', '"old"', "residual_trees[1].name: 'old' is the name of residual_trees[0]"),
    ("x_m = 0.5\ny_m = 9", "x_m = 5\ny_m = 5", "residual_trees[1]: stands on the spot of"),
    ("fagus_s", "fagus_z", "residual_trees[1].like: unknown species 'fagus_zylvatica', did you"),
    ('["old"]', '["odl"]', "acts[0].residual: no residual tree 'odl', did you mean 'old'?"),
    ('residual = ["old"]', "", "acts[0].tree_ids: missing; expected tree_ids, marked or residual"),
    ('["old"]\n', f'["old"]\n{AGAIN}', "acts[1].residual: 'old' is felled by acts[0] in 2004"),
]


def test_the_text_is_right_before_it_is_spoilt(tmp_path: Path) -> None:
    scenario = tiny()
    path = tmp_path / "right.toml"
    path.write_text(TOML + TREES)
    right = type(scenario).load(path)
    assert [tree.name for tree in right.residual_trees] == ["old", "edge"]
    assert right.acts[0].residual == ("old",)  # type: ignore[union-attr]


@pytest.mark.parametrize(("old", "new", "says"), BAD)
def test_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in TREES
    (tmp_path / "broken.toml").write_text("level = 3\n")
    path = tmp_path / "wrong.toml"
    path.write_text(TOML + TREES.replace(old, new, 1))
    refused(tmp_path, "run", path, "--out", tmp_path / "run.h5", says=says)


@pytest.mark.parametrize("x_m", [5.0, 5.009])
def test_no_tree_is_planted_on_a_residual_stem(x_m: float) -> None:
    old = 'residual_trees=[{name="a", x_m=5, y_m=5, species="quaking_aspen", height_m=5}]'
    kinds = {
        "explicit": f"{{x_m=1, y_m=1}}, {{x_m={x_m}, y_m=5}}",
        "inventory": f"{{x_m=1, y_m=1, height_m=1}}, {{x_m={x_m}, y_m=5, height_m=1}}",
    }
    for kind, trees in kinds.items():
        one = ["species={fagus_sylvatica={}}", "output.sample_trees.ids=[]"]
        one.append(f'planting={{kind="{kind}", trees=[{trees}]}}')
        says = r"planting.trees\[1\]: stands on the spot of residual_trees\[0\]"
        with pytest.raises(InputError, match=says):
            tiny(old, *one)
        tiny(old.replace("y_m=5", "y_m=4.98"), *one)


def test_each_tree_has_a_seed_of_its_own() -> None:
    """Its number in the list, unless it is given; a stored scenario says which."""
    tree = '{{name="{}", x_m={}, y_m=5, species="quaking_aspen", height_m=5{}}}'
    given = ["", "", ", seed=1"]
    trees = ", ".join(tree.format(f"t{k}", k, more) for k, more in enumerate(given))
    scenario = tiny(f"residual_trees=[{trees}]")
    assert [one.seed for one in scenario.residual_trees] == [1, 2, 1]
    assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_rendered_light_is_refused() -> None:
    tree = 'residual_trees=[{name="a", x_m=1, y_m=1, species="quaking_aspen", height_m=5}]'
    with pytest.raises(InputError, match="residual_trees: rendered light does not see them"):
        tiny("environment={rendered={}}", tree)


@pytest.mark.parametrize("seed", [1, 2])
def test_pines_below_an_oak(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    seed: int,
) -> None:
    """A smaller and younger plantation than the script's: less below the oak, more once it fell."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "scenarios")
    script = importlib.import_module("retained_oak")
    small = [
        "plot.size_m=[20, 20]",
        "years=16",
        'acts=[{kind="fell", year=2009, residual="oak"}]',
        'residual_trees=[{name="oak", x_m=10, y_m=10, species="quaking_aspen", height_m=15, '
        "crown_lai=6}]",
    ]
    words = ["--out", str(tmp_path), "--seed", str(seed), *(f"--set={key}" for key in small)]
    script.main(words)
    assert "pines by distance from the oak" in capsys.readouterr().out
    assert (tmp_path / "retained_oak.png").read_bytes().startswith(b"\x89PNG")
    table = pd.read_csv(tmp_path / "retained_oak.csv")
    table = table.set_index(["plot", "year", "ring_m"]).sort_index()
    inner, outer = "0-2.5", "7.5-10"
    half = table.loc[("oak kept", 2008)].height_m
    assert half[inner] < 0.7 * half[outer]
    assert table.loc[("no oak", 2008, inner), "height_m"] > half[inner] / 0.7
    kept, felled = (table.loc[(name, 2016, inner)] for name in ("oak kept", "oak felled"))
    assert felled.growth_m > 1.3 * kept.growth_m
    assert felled.height_m > 1.2 * kept.height_m
