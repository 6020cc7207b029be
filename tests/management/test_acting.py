"""Management of a growing stand: rules and triggers, by file and by hand, on record and resumed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from forest.errors import ActError, InputError
from forest.record.schema import ACT_KINDS, CAUSES, EVENT_KINDS, STAND
from forest.scenario import Scenario
from forest.scenario.timing import QUANTITIES
from forest.simulation import simulate
from forest.stand import Stand
from forest.yearbook import YearRecord
from tests.tiny import YEARS, assert_same_runs, assert_same_state, assert_same_years, steps, tiny

GAP = "{kind='circle', x_m=0, y_m=5, radius_m=3}"
THIN = "{kind='thin', year=2005, method='below', share_n=0.3}"
RULES = {
    "below": "{kind='thin', year=2005, method='below', n_ha=700}",
    "above": "{kind='thin', year=2005, method='above', share_n=0.4, species='fagus_sylvatica'}",
    "random": "{kind='thin', year=2005, method='random', n_ha=600}",
    "rows": "{kind='thin', year=2005, method='geometric', every_row=2, row_spacing_m=2.5}",
    "strips": "{kind='thin', year=2005, method='geometric', strip_width_m=2, strip_spacing_m=5}",
    "crop": "{kind='thin', year=2007, method='selective', crop_trees_ha=200, crop_spacing_m=3}",
    "crop to a target": "{kind='thin', year=2007, method='selective', crop_trees_ha=100, "
    "share_n=0.3, within_m=20}",
    "limit": "{kind='harvest', year=2007, method='diameter_limit', limit_cm=1.5}",
    "shelterwood": "{kind='harvest', year=2007, method='shelterwood', keep_share=0.4}",
    "clearcut": "{kind='harvest', year=2005, method='clearcut', species='pinus_sylvestris'}",
    "gap": f"{{kind='harvest', year=2005, method='gap', gap={GAP}}}",
    "lift": "{kind='prune', year=2007, thickest_ha=300, below_share=0.4}",
    "all": "{kind='prune', every_years=2, from_year=2004, all_trees=true, below_m=0.3}",
    "fill": "{kind='plant', year=2005, pattern='random', density_ha=800, clear_m=1.5}",
    "rows between": "{kind='plant', years=[2004, 2006], pattern='regular', spacing_m=[2, 2], "
    "species=['fagus_sylvatica', 'pinus_sylvestris'], shares=[1, 3], clear_m=0.5}",
    "trigger": "{kind='thin', when='n_ha > 500', method='below', share_n=0.2, wait_years=2, "
    "at_most=2, from_year=2003}",
}


def with_acts(*acts: str, settings: tuple[str, ...] = ()) -> Scenario:
    return tiny(f"acts=[{', '.join(acts)}]", *settings)


def removed(records: list[YearRecord]) -> dict[int, list[int]]:
    """Give the ids of the felled trees by year."""
    found: dict[int, list[int]] = {}
    for record in records:
        events = record.tables["events"]
        felled = events["kind"] == EVENT_KINDS.index("felled")
        if felled.any():
            found[record.year] = sorted(events["tree_id"][felled].tolist())
    return found


def test_triggers_ask_columns_of_the_stand() -> None:
    """All that a trigger may ask is in the stand table, but for what the year brought."""
    flows = {"recruits_ha", "deaths_ha", "removed_ha", "removed_volume_m3ha", "floor_light"}
    names = {column.name for column in STAND.columns} - {"year", "species"} - flows
    assert set(QUANTITIES) == names | {"relative_density", "age"}


@pytest.mark.parametrize("rule", RULES)
def test_stopped_and_gone_on(rule: str) -> None:
    """Restored in any year, the stand goes on to the same bits, triggers and treatments too."""
    scenario = with_acts(RULES[rule])
    whole = Stand(scenario)
    records = [*steps(whole, 4)]
    middle = Stand.restore(scenario, *whole.state())
    records += steps(whole, 2)
    late = Stand.restore(scenario, *whole.state())
    records += steps(whole, 2)
    assert_same_years(records[4:], steps(middle, 4))
    assert_same_years(records[6:], steps(late, 2))
    assert_same_state(whole, middle)
    assert any("treatments" in record.tables for record in records)


def by_hand(act: str) -> list[YearRecord]:
    """Do an act of the table by hand in its year."""
    import tomllib

    keys: dict[str, Any] = tomllib.loads(f"act = {act}")["act"]
    stand = Stand(tiny())
    kind, year = keys.pop("kind"), keys.pop("year")
    records = steps(stand, year - 2001)
    getattr(stand, kind)(**keys)
    return records + steps(stand, YEARS - len(records))


@pytest.mark.parametrize("rule", [name for name, act in RULES.items() if " year=" in act])
def test_the_same_by_hand(rule: str) -> None:
    records, others = steps(Stand(with_acts(RULES[rule])), YEARS), by_hand(RULES[rule])
    for some, act in ((records, 0), (others, -1)):
        for record in some:
            if "treatments" in record.tables:
                assert set(record.tables["treatments"].pop("act")) == {act}
    assert_same_years(records, others)


def test_targets_are_met_and_ids_told() -> None:
    stand = Stand(tiny())
    steps(stand, 4)
    before = stand.trees
    gone = stand.thin(method="below", n_ha=700)
    assert len(stand.trees) == 7
    small = before.sort_values(["dbh_cm", "height_m"], na_position="first").tree_id[:3]
    assert sorted(gone) == sorted(small)
    assert stand.thin(method="below", n_ha=700) == []
    around = np.hypot(np.minimum(before.x_m, 10 - before.x_m), before.y_m - 5) <= 3
    inside = set(before.tree_id[around]) & set(stand.trees.tree_id)
    gap = {"kind": "circle", "x_m": 10.0, "y_m": 5.0, "radius_m": 3.0}
    assert set(stand.harvest(method="gap", gap=gap)) == inside != set()
    pines = stand.trees.query("species == 'pinus_sylvestris'").tree_id
    clearcut = stand.harvest(method="clearcut", species="pinus_sylvestris")
    assert clearcut == pines.tolist() != []
    (record,) = steps(stand, 1)
    events = record.tables["events"]
    causes = [CAUSES[code] for code in events["cause"][events["kind"] == 3]]
    assert causes == ["thinning"] * 3 + ["harvest"] * (len(inside) + len(clearcut))


def test_tending_leaves_its_trees() -> None:
    """Young trees felled and left are dead wood on the ground; thinned ones are taken away."""
    for cause, left in (("thinning", False), ("tending", True)):
        stand = Stand(tiny("mortality={snags=true}"))
        steps(stand, 6)
        gone = stand.thin(method="above", share_n=0.3, cause=cause)
        (record,) = steps(stand, 1)
        assert (record.tables["deadwood"]["input_tha"].sum() > 0.0) == left
        events = record.tables["events"]
        causes = events["cause"][np.isin(events["tree_id"], gone)]
        assert [CAUSES[code] for code in causes] == [cause] * 3


def test_crop_trees_stay_until_the_target() -> None:
    """Three of ten trees go, those that press the thickest most; it stays."""
    stand = Stand(tiny())
    steps(stand, 7)
    trees = stand.trees.sort_values("dbh_cm", ascending=False).dropna(subset="dbh_cm")
    assert len(trees) > 4
    gone = stand.thin(method="selective", crop_trees_ha=100, share_n=0.3, within_m=20)
    assert len(gone) == 3
    assert trees.tree_id.iloc[0] in stand.trees.tree_id.to_numpy()


def test_nothing_is_left() -> None:
    """After a clear-cut the years go on, triggers are asked, and seedlings can come."""
    later = "{kind='plant', when='n_ha < 1', pattern='regular', spacing_m=[5, 5], wait_years=3}"
    records = steps(Stand(with_acts("{kind='harvest', year=2003, method='clearcut'}", later)), 5)
    count = [len(record.tables["trees"]["tree_id"]) for record in records]
    assert count == [10, 10, 0, 4, 4]


def test_planting_keeps_clear_of_stems() -> None:
    stand = Stand(tiny())
    steps(stand, 3)
    old = stand.trees
    within = {"kind": "rectangle", "x_m": 5, "y_m": 5, "size_m": [6, 6]}
    new = stand.plant(
        pattern="regular", spacing_m=[1, 1], clear_m=1.2, species="fagus_sylvatica", within=within
    )
    young = stand.trees[stand.trees.tree_id.isin(new)]
    assert 0 < len(young) < 36
    assert set(young.species) == {"fagus_sylvatica"}
    assert young.x_m.between(2, 8).all() and young.y_m.between(2, 8).all()
    for x, y in zip(young.x_m, young.y_m, strict=True):
        away = [np.minimum(abs(p - q), 10 - abs(p - q)) for p, q in ((old.x_m, x), (old.y_m, y))]
        assert np.hypot(*away).min() >= 1.2
    first = stand.plant(pattern="random", density_ha=600, clear_m=0.0)
    second = stand.plant(pattern="random", density_ha=600, clear_m=0.0)
    assert len(first) == len(second) == 6
    places = stand.trees.set_index("tree_id")[["x_m", "y_m"]]
    assert not np.isin(places.loc[first].x_m, places.loc[second].x_m).any()


def test_lift_pruning_by_share() -> None:
    """The thickest lose what stands below a share of each one's height; others lose nothing."""
    stand = Stand(tiny())
    steps(stand, 7)
    trees = stand.trees.sort_values(["dbh_cm", "height_m"], ascending=False)
    thick = trees.dropna(subset="dbh_cm").tree_id[:2].tolist()
    assert stand.prune(thickest_ha=200, below_share=0.5) > 0
    after = stand.trees.set_index("tree_id")
    columns = ["tree_id", "height_m", "crown_base_m"]
    for tree_id, height, base in trees[columns].itertuples(index=False):
        now = after.crown_base_m[tree_id]
        if tree_id in thick:
            assert now >= 0.5 * height > base
        else:
            assert now == base
    assert stand.prune([thick[0], thick[1]], below_share=0.5) == 0


def test_a_trigger_waits_and_counts() -> None:
    """Of ten trees: in 2003 two go; 2004 waits; in 2005 two of eight; then it has fired twice."""
    records = steps(Stand(with_acts(RULES["trigger"])), YEARS)
    assert {year: len(ids) for year, ids in removed(records).items()} == {2003: 2, 2005: 2}


@pytest.mark.parametrize(
    ("trigger", "years"),
    [
        ("when='age >= 5', at_most=1", [2006]),
        ("when='n_ha > 1000'", []),
        ("when='n_ha >= 1000', until_year=2002, wait_years=5", [2001]),
        ("when='qmd_cm < 1000', wait_years=100", None),
        ("when='n_ha < 1000', when_species='fagus_sylvatica', wait_years=4", [2001, 2005]),
        ("when='n_ha < 1000', when_species='fagus_sylvatica', from_year=2008", [2008]),
    ],
)
def test_when_a_trigger_fires(trigger: str, years: list[int] | None) -> None:
    """A pruning that cuts nothing is on record all the same; without a dbh there is no mean."""
    act = f"{{kind='prune', all_trees=true, below_m=0.001, {trigger}}}"
    records = steps(Stand(with_acts(act)), YEARS)
    fired = [record.year for record in records if "treatments" in record.tables]
    if years is None:
        first_dbh = next(r.year for r in records if not np.isnan(r.tables["stand"]["qmd_cm"][-1]))
        assert fired == [first_dbh + 1]
    else:
        assert fired == years


def test_acts_of_a_year_see_what_is_left() -> None:
    """A harvest, a thinning of the rest, then seedlings in the room of what went."""
    acts = (
        "{kind='plant', year=2004, pattern='regular', spacing_m=[2, 2], clear_m=0.9}",
        "{kind='harvest', year=2004, method='clearcut', species='pinus_sylvestris'}",
        "{kind='thin', year=2004, method='random', share_n=0.5}",
        "{kind='fell', year=2004, tree_ids=[1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}",
    )
    stand = Stand(with_acts(*acts))
    records = steps(stand, 4)
    table = pd.DataFrame(records[-1].tables["treatments"])
    whole = table[table.species == 2]
    assert whole.act.tolist() == [1, 1, 2, 2, 3, 3, 0, 0]
    assert [ACT_KINDS[k] for k in whole.kind[::2]] == ["harvest", "thin", "fell", "plant"]
    before, after = whole[whole.stage == 0], whole[whole.stage == 1]
    assert before.n_ha.tolist()[1:] == after.n_ha.tolist()[:-1]
    assert (before.n_ha.to_numpy() - after.n_ha.to_numpy())[:3] == pytest.approx(
        after.removed_ha.to_numpy()[:3]
    )
    assert after.removed_ha.sum() == 1000.0
    assert after.n_ha.tolist()[-2:] == [0.0, 2500.0]
    parts = table[table.species < 2].groupby(["number", "stage"])
    for name in ("n_ha", "basal_area_m2ha", "volume_m3ha", "removed_volume_m3ha"):
        assert parts[name].sum().to_numpy() == pytest.approx(whole[name].to_numpy())


def test_before_and_after_follow_the_years() -> None:
    """Before the first act the stand is last year's; what went is in the stand table too."""
    records = steps(Stand(with_acts(RULES["shelterwood"])), YEARS)
    last, year = records[5].tables["stand"], records[6].tables
    treatments = year["treatments"]
    before, after = (treatments["stage"] == stage for stage in (0, 1))
    for name in ("n_ha", "basal_area_m2ha", "sdi", "volume_m3ha", "lai", "mingling"):
        np.testing.assert_array_equal(treatments[name][before], last[name])
    for name in ("removed_ha", "removed_volume_m3ha"):
        np.testing.assert_array_equal(treatments[name][after], year["stand"][name])
    left = treatments["basal_area_m2ha"][after][-1] / treatments["basal_area_m2ha"][before][-1]
    assert 0.4 <= left < 1


@pytest.mark.usefixtures("three_threads")
def test_treatments_on_file_and_resumed(tmp_path: Path) -> None:
    """A run that another act stops goes on without it, and triggers have not forgotten."""
    act = RULES["trigger"].replace("at_most=2", "at_most=3")
    out, wrong = tmp_path / "run.h5", "{kind='fell', year=2006, tree_ids=[99]}"
    later = "{kind='harvest', when='age > 100', method='clearcut', from_year=2007}"
    with pytest.raises(ActError, match="99"):
        simulate(with_acts(wrong, act), out)
    with (
        simulate(with_acts(act, later), out, resume=True) as run,
        simulate(with_acts(act), tmp_path / "whole.h5") as whole,
    ):
        treatments = run.treatments
        assert (
            treatments[treatments.species == "all"].year.tolist()
            == [2003] * 2 + [2005] * 2 + [2007] * 2
        )
        assert set(treatments[treatments.year < 2006].act) == {1}
        assert set(treatments.stage) == {"before", "after"}
        for table in set(run.tables) - {"treatments"}:
            pd.testing.assert_frame_equal(run.read(table), whole.read(table), check_exact=True)
        columns = treatments.columns.drop("act")
        pd.testing.assert_frame_equal(treatments[columns], whole.treatments[columns])
    with pytest.raises(InputError, match="different scenario"):
        simulate(with_acts(act.replace("500", "400"), settings=("years=9",)), out, resume=True)
    with (
        simulate(with_acts(act), tmp_path / "again.h5", threads=2) as again,
        simulate(with_acts(act), tmp_path / "whole.h5", resume=True) as whole,
    ):
        assert_same_runs(again, whole)


def test_rows_of_a_regular_planting() -> None:
    """Rows are those of the planting; every third of them goes, whole."""
    planting = "planting={kind='regular', spacing_m=[2, 1]}"
    rule = "{kind='thin', year=2002, method='geometric', every_row=3, first_row=1, rows_along='y'}"
    stand = Stand(with_acts(rule, settings=(planting,)))
    steps(stand, 2)
    assert sorted(set(stand.trees.x_m)) == [3.0, 5.0, 9.0]
    assert stand.trees.x_m.value_counts().tolist() == [10, 10, 10]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda s: s.thin(method="below"), "Stand.thin: no target given; expected one of n_ha"),
        (lambda s: s.thin(method="belo", n_ha=3), "Stand.thin: method: 'belo' is not allowed"),
        (lambda s: s.thin(method="below", n_ha=3, species="fagus"), "'fagus_sylvatica'?"),
        (lambda s: s.thin(method="geometric", every_row=2), "Stand.thin: row_spacing_m: the scen"),
        (lambda s: s.harvest(method="gap"), "Stand.harvest: missing key 'gap'"),
        (lambda s: s.harvest(methd="gap"), "did you mean 'method'?"),
        (
            lambda s: s.harvest(method="gap", gap={"kind": "circel", "x_m": 1, "y_m": 1}),
            "unknown kind 'circel'",
        ),
        (lambda s: s.prune(below_m=2), "Stand.prune: tree_id: missing"),
        (lambda s: s.prune([1, 99], below_m=2), "no living tree has the id 99"),
        (lambda s: s.prune("a", below_m=2), "Stand.prune: 'a' is no list"),
        (lambda s: s.prune([1, "a"], below_m=2), "Stand.prune: 'a' is no tree id"),
        (lambda s: s.prune(99, below_m=2), "Stand.prune: no living tree has the id 99"),
        (lambda s: s.fell(3), "Stand.fell: 3 is no list; expected a list of ids of living trees"),
        (lambda s: s.fell([1.5]), "Stand.fell: 1.5 is no tree id; expected whole numbers"),
        (lambda s: s.fell([999]), "Stand.fell: no living tree has the id 999"),
        (lambda s: s.prune(all_trees=True, species="x", below_m=2), "unknown species 'x'"),
        (lambda s: s.plant(pattern="regular"), "Stand.plant: missing key 'spacing_m'"),
        (lambda s: s.plant(pattern="random", density_ha=9, species="oak"), "unknown species 'oak'"),
        (lambda s: s.plant([1.0], [1.0]), "Stand.plant: no species given; expected one of"),
        (lambda s: s.plant([1.0], species="fagus_sylvatica"), "Stand.plant: y_m: 0 for 1 x_m"),
    ],
)
def test_refused_by_hand(call: Any, says: str) -> None:
    stand, other = Stand(tiny()), Stand(tiny())
    with pytest.raises(InputError) as caught:
        call(stand)
    assert says in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert_same_state(stand, other)
