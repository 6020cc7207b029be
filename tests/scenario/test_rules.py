"""Management in a scenario file: what rules and times may say, and what is refused."""

from __future__ import annotations

import pytest

from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.acts import Prune
from forest.scenario.cuttings import Harvest, Thin
from forest.scenario.summary import summary
from tests.tiny import TOML

BELOW = "kind='thin', method='below', n_ha=500"
CIRCLE = "kind='circle', x_m=5, y_m=5, radius_m=2"


def _read(act: str) -> Scenario:
    return Scenario.from_toml(TOML + f"acts = [{{{act}}}]")


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (f"{BELOW}, year=2003", "thin from below to n_ha 500 in 2003"),
        (
            "kind='thin', method='above', species=['pinus_sylvestris'], share_g=0.2, every_years=3",
            "thin of pinus_sylvestris from above by share_g 0.2 every 3 years",
        ),
        (
            "kind='thin', method='selective', crop_trees_ha=200, when='relative_density > 0.6', "
            "from_year=2002, until_year=2007, wait_years=2, at_most=3",
            "thin around 200 crop trees/ha when relative_density > 0.6 "
            "(from 2002, until 2007, 2 years apart, at most 3 times)",
        ),
        (
            "kind='harvest', method='gap', years=[2002, 2005], gap={" + CIRCLE + "}",
            "harvest in a gap (circle) in 2002, 2005",
        ),
        (
            "kind='harvest', method='shelterwood', keep_share=0.3, when='age>=5', "
            "when_species='fagus_sylvatica'",
            "harvest but for a shelterwood of 30 % of G when age>=5 of fagus_sylvatica",
        ),
        (
            "kind='prune', year=2004, thickest_ha=100, below_m=3",
            "prune the 100 thickest/ha in 2004",
        ),
        ("kind='plant', year=2004, pattern='random', density_ha=50", "plant 50/ha in 2004"),
        (
            "kind='plant', year=2004, pattern='regular', spacing_m=[2, 1.5], "
            "within={kind='polygon', points_m=[[1, 1], [4, 1], [4, 4]]}",
            "plant every 2 x 1.5 m in 2004",
        ),
    ],
)
def test_rules_are_read_told_and_written(act: str, words: str) -> None:
    scenario = _read(act)
    assert dict(summary(scenario))["acts"] == words
    assert Scenario.from_toml(scenario.to_toml()).acts == scenario.acts
    assert isinstance(scenario.acts[0], Thin | Harvest | Prune) or scenario.acts[0].kind == "plant"


@pytest.mark.parametrize(
    ("act", "says"),
    [
        (BELOW, "acts[0]: no time given; expected one of year, years, every_years, when"),
        (f"{BELOW}, year=2003, when='n_ha > 1'", "year and when exclude each other"),
        (f"{BELOW}, year=2003, wait_years=3", "acts[0].wait_years: given beside year"),
        (f"{BELOW}, years=[2003, 2010]", "acts[0].years[1]: 2010 is not a year of the run"),
        (f"{BELOW}, every_years=0", "acts[0].every_years: 0"),
        (f"{BELOW}, every_years=5, from_year=2009", "acts[0].from_year: no year of the run"),
        (f"{BELOW}, when='n_ha>1', from_year=2005, until_year=2004", "until_year: 2004 lies bef"),
        (f"{BELOW}, when='sdi above 900'", "acts[0].when: 'sdi above 900' is no trigger; expected"),
        (f"{BELOW}, when='sdi > 1e'", "'sdi > 1e' is no trigger"),
        (f"{BELOW}, when='n_ha > 1e999'", "acts[0].when: 'n_ha > 1e999' is no trigger"),
        (
            "kind='harvest', method='gap', year=2003, "
            "gap={kind='polygon', points_m=[[1, 1], [2, 2], [4, 4]]}",
            "acts[0].gap.points_m: has no area; expected corners that do not all lie on one line",
        ),
        (f"{BELOW}, when='sdj > 900'", "acts[0].when: unknown quantity 'sdj', did you mean 'sdi'?"),
        (f"{BELOW}, when='sdi > 900', when_species='oak'", "when_species: unknown species 'oak'"),
        ("kind='thin', year=2003, method='below'", "acts[0]: no target given"),
        (f"{BELOW}, year=2003, sdi=300", "n_ha and sdi exclude each other"),
        (f"{BELOW}, year=2003, every_row=2", "every_row: does not belong to method 'below'"),
        (f"{BELOW}, year=2003, species='fagus'", "acts[0].species[0]: unknown species 'fagus'"),
        (f"{BELOW}, year=2003, min_dbh_cm=5, max_dbh_cm=4", "max_dbh_cm: 4 lies below"),
        ("kind='thin', year=2003, method='geometric'", "neither rows nor strips"),
        ("kind='thin', year=2003, method='geometric', every_row=2", "acts[0].row_spacing_m: the"),
        ("kind='thin', year=2003, method='geometric', strip_width_m=2", "key 'strip_spacing_m'"),
        ("kind='thin', year=2003, method='geometric', strip_width_m=2, strip_spacing_m=2",
         "strip_spacing_m: 2 leaves nothing"),
        ("kind='thin', year=2003, method='selective'", "missing key 'crop_trees_ha'"),
        ("kind='harvest', year=2003, method='clear'", "acts[0].method: 'clear' is not allowed"),
        ("kind='harvest', year=2003, method='diameter_limit'", "missing key 'limit_cm'"),
        ("kind='harvest', year=2003, method='clearcut', limit_cm=3", "limit_cm: does not belong"),
        ("kind='harvest', year=2003, method='gap', gap={kind='circle', x_m=1, y_m=1}",
         "acts[0].gap.radius_m: missing"),
        ("kind='harvest', year=2003, method='gap', gap={kind='ring', x_m=1, y_m=1}",
         "acts[0].gap: unknown kind 'ring'; expected table with kind = "),
        ("kind='harvest', year=2003, method='gap', gap={kind='circle', x_m=50, y_m=5, radius_m=2}",
         "acts[0].gap: lies beside the plot"),
        ("kind='harvest', year=2003, method='gap', gap={kind='circle', x_m=5, y_m=5, radius_m=20}",
         "acts[0].gap: is much larger than the plot"),
        ("kind='prune', year=2003, below_m=1, all_trees=true, tree_id=3", "are both given"),
        ("kind='prune', year=2003, below_m=1, tree_id=3, min_dbh_cm=3", "given beside tree_id"),
        ("kind='prune', year=2003, all_trees=true, below_share=1.5", "below_share: 1.5"),
        ("kind='plant', year=2003", "acts[0].x_m: missing; expected positions, or a pattern"),
        ("kind='plant', year=2003, x_m=[1], y_m=[1], clear_m=3", "clear_m: given without"),
        ("kind='plant', year=2003, pattern='random', spacing_m=[1, 1]", "missing key 'density_ha'"),
        ("kind='plant', year=2003, pattern='random', density_ha=1e4, min_distance_m=2", "2 m ap"),
        ("kind='plant', year=2003, pattern='regular', spacing_m=[1, 1], shares=[1]",
         "shares: 1 for 0 species"),
    ],
)  # fmt: skip
def test_refused(act: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        _read(act)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert says in message


def test_a_tree_felled_twice_by_a_list_of_years() -> None:
    with pytest.raises(InputError, match=r"acts\[0\]\.tree_ids: tree 4 is felled by acts\[0\] in"):
        _read("kind='fell', years=[2003, 2005], tree_ids=[4]")
