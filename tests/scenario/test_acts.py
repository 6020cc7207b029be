"""Acts in a scenario file: what they may say, and what is refused before the run."""

from __future__ import annotations

import pytest

from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.acts import Fell, Plant, Prune
from forest.scenario.summary import summary
from tests.tiny import TOML

ALL = """
[[acts]]
kind = "prune"
year = 2003
tree_id = 1
metamer = 4
[[acts]]
kind = "prune"
year = 2004
tree_ids = [1, 2]
below_m = 0.5
[[acts]]
kind = "prune"
year = 2004
tree_id = 3
side_deg = 270
within_deg = 45
from_m = 0.5
to_m = 2
[[acts]]
kind = "fell"
year = 2008
tree_ids = [1, 3]
cause = "thinning"
[[acts]]
kind = "plant"
year = 2001
x_m = [1, 2]
y_m = [3, 4]
species = "fagus_sylvatica"
"""


def test_all_kinds_are_read_and_written() -> None:
    scenario = Scenario.from_toml(TOML + ALL)
    kinds = [type(act) for act in scenario.acts]
    assert kinds == [Prune, Prune, Prune, Fell, Plant]
    assert Scenario.from_toml(scenario.to_toml()).acts == scenario.acts
    assert scenario.acts[4].names(["pinus_sylvestris"]) == ["fagus_sylvatica"] * 2
    assert scenario.digest() != Scenario.from_toml(TOML).digest()


def test_the_summary_names_acts_by_year() -> None:
    text = dict(summary(Scenario.from_toml(TOML + ALL)))["acts"]
    assert text == "plant in 2001, prune in 2003, prune in 2004, prune in 2004, fell in 2008"
    assert dict(summary(Scenario.from_toml(TOML)))["acts"] == "none"
    thinnings = [f"{{kind='fell', year=2002, tree_ids=[{i}]}}" for i in range(1, 10)]
    many = Scenario.from_toml(TOML).with_overrides([f"acts=[{', '.join(thinnings)}]"])
    assert dict(summary(many))["acts"] == ", ".join(
        ["fell in 2002"] * 5 + ["... (9 in all)", "fell in 2002"]
    )


@pytest.mark.parametrize(
    ("act", "says"),
    [
        ("year=2003, tree_ids=[1]", "acts[0]: missing key 'kind'"),
        ("kind='prun', year=2003", "acts[0]: unknown kind 'prun'; expected table with kind"),
        ("kind='fell', yeer=2003, tree_ids=[1]", "did you mean 'year'?"),
        ("kind='fell', year=2000, tree_ids=[1]", "acts[0].year: 2000 is not a year of the run"),
        ("kind='fell', year=2009, tree_ids=[1]", "expected a calendar year, 2001 to 2008"),
        ("kind='fell', year=2003, tree_ids=[]", "acts[0].tree_ids"),
        ("kind='fell', year=2003, tree_ids=[0]", "acts[0].tree_ids[0]: 0"),
        ("kind='fell', year=2003, tree_ids=[2, 2]", "tree 2 is felled by acts[0] in 2003"),
        ("kind='fell', year=2003, tree_ids=[2], cause='wind'", "harvest"),
        ("kind='prune', year=2003, below_m=1", "acts[0].tree_id: missing"),
        ("kind='prune', year=2003, tree_id=1, tree_ids=[1], below_m=1", "both given"),
        ("kind='prune', year=2003, tree_id=1", "expected one of metamer, below_m, below_sh"),
        ("kind='prune', year=2003, tree_id=1, metamer=2, below_m=1", "metamer and below_m"),
        ("kind='prune', year=2003, tree_ids=[1], metamer=2", "acts[0].metamer: a metamer is one"),
        ("kind='prune', year=2003, tree_id=1, below_m=nan", "acts[0].below_m: nan"),
        ("kind='prune', year=2003, tree_id=1, below_m=1, to_m=2", "to_m: given without side_deg"),
        ("kind='prune', year=2003, tree_id=1, side_deg=0, within_deg=181", "within_deg: 181"),
        ("kind='prune', year=2003, tree_id=1, side_deg=0, from_m=2, to_m=1", "to_m: 1 lies below"),
        ("kind='plant', year=2003, x_m=[1], y_m=[1]", "acts[0]: missing key 'species'"),
        ("kind='plant', year=2003, x_m=[1], y_m=[1, 2], species='fagus_sylvatica'", "y_m: 2 for 1"),
        ("kind='plant', year=2003, x_m=[1], y_m=[1], species='fagus'", "'fagus_sylvatica'?"),
        ("kind='plant', year=2003, x_m=[1, 2], y_m=[1, 11], species='fagus_sylvatica'",
         "acts[0].x_m[1]: (2, 11) is outside the plot"),
        ("kind='plant', year=2003, x_m=[0, 10], y_m=[1, 1], species='fagus_sylvatica'",
         "acts[0].x_m[1]: stands on the spot of x_m[0]"),
        ("kind='plant', year=2003, x_m=[1,2,3], y_m=[1,2,3], species=['fagus_sylvatica', 'x']",
         "species: 2 for 3 trees"),
    ],
)  # fmt: skip
def test_refused(act: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        Scenario.from_toml(TOML + f"acts = [{{{act}}}]")
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert says in message


@pytest.mark.parametrize(
    "later", ["kind='fell', tree_ids=[5]", "kind='prune', tree_ids=[5], below_m=1"]
)
def test_a_felled_tree_is_gone(later: str) -> None:
    felling = "{kind='fell', year=2003, tree_ids=[4, 5]}"
    with pytest.raises(InputError, match=r"acts\[0\]\.tree_ids: tree 5 is felled by acts\[1\] in"):
        Scenario.from_toml(TOML + f"acts = [{{year=2004, {later}}}, {felling}]")


def test_a_tree_is_pruned_in_the_year_in_which_it_is_felled() -> None:
    pruning = "{kind='prune', year=2003, tree_id=5, below_m=1}"
    felling = "{kind='fell', year=2003, tree_ids=[5]}"
    assert len(Scenario.from_toml(TOML + f"acts = [{felling}, {pruning}]").acts) == 2
