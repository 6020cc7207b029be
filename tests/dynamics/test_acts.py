"""The acts of a scenario in their year: the same as acts by hand, once, and on record."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from forest.errors import ActError, InputError
from forest.record import ledger
from forest.record.run import Run, open_run
from forest.record.schema import CAUSES, EVENT_KINDS
from forest.scenario import Scenario
from forest.scenario.acts import Fell
from forest.simulation import simulate
from forest.stand import Stand
from tests.tiny import YEARS, assert_same_runs, assert_same_state, assert_same_years, steps, tiny

PRUNE = "{kind='prune', year=2006, tree_ids=[1, 2], side_deg=270}"
LIFT = "{kind='prune', year=2006, tree_id=4, below_m=0.4}"
FELL = "{kind='fell', year=2007, tree_ids=[3, 4], cause='thinning'}"
PLANT = (
    "{kind='plant', year=2006, x_m=[5, 6], y_m=[5, 10], "
    "species=['fagus_sylvatica', 'pinus_sylvestris']}"
)
ALL = (PLANT, FELL, PRUNE, LIFT)


def with_acts(*acts: str, settings: tuple[str, ...] = ()) -> Scenario:
    """Give the scenario of ten young trees, with acts."""
    return tiny(f"acts=[{', '.join(acts)}]", *settings)


def recorded(run: Run, tree_id: int) -> dict[int, list[int]]:
    """Give the serials that a sample tree lost, by year."""
    dead = run._file[f"samples/{tree_id}/dead"]
    lost: dict[int, list[int]] = {}
    for serial, year in zip(dead["serial"][:], dead["year"][:], strict=True):
        lost.setdefault(int(year), []).append(int(serial))
    return lost


def test_the_same_as_by_hand() -> None:
    """Whatever their order in the file: first pruning, then felling, then planting."""
    acting, by_hand = Stand(with_acts(*ALL)), Stand(tiny())
    records, others = steps(acting, 5), steps(by_hand, 5)
    assert by_hand.prune([1, 2], side_deg=270) > 0
    assert by_hand.prune(4, below_m=0.4) > 0
    by_hand.plant([5, 6], [5, 10], ["fagus_sylvatica", "pinus_sylvestris"])
    records, others = records + steps(acting, 1), others + steps(by_hand, 1)
    by_hand.fell([3, 4], cause="thinning")
    records, others = records + steps(acting, 2), others + steps(by_hand, 2)
    acts = [record.tables["treatments"].pop("act") for record in records[5:7]]
    assert [list(dict.fromkeys(act.tolist())) for act in acts] == [[2, 3, 0], [1]]
    for record in others[5:7]:
        assert set(record.tables["treatments"].pop("act")) == {-1}
    assert_same_years(records, others)
    assert_same_state(acting, by_hand)


def test_the_ledgers_balance_and_events_tell() -> None:
    living, told = 0, Counter[tuple[int, str, str]]()
    for record in steps(Stand(with_acts(*ALL)), YEARS):
        row = ledger.population_row(
            record.year, living, record.tables["trees"], record.tables["events"]
        )
        ledger.check_carbon(record.year, record.tables["carbon"])
        living = int(row["living"][0])
        events = record.tables["events"]
        for kind, cause in zip(events["kind"], events["cause"], strict=True):
            told[record.year, EVENT_KINDS[kind], CAUSES[cause]] += 1
    assert {k: n for k, n in told.items() if k[1] != "died" and k[0] > 2001} == {
        (2006, "pruned", "none"): 3,
        (2006, "planted", "none"): 2,
        (2007, "felled", "thinning"): 2,
    }


def test_an_act_of_the_first_year() -> None:
    (record,) = steps(Stand(with_acts("{kind='fell', year=2001, tree_ids=[2]}")), 1)
    assert record.tables["trees"]["tree_id"].tolist() == [1, *range(3, 11)]
    with pytest.raises(ActError, match=r"acts\[0\]\.tree_ids in 2001: no living tree .* id 11"):
        Stand(with_acts("{kind='fell', year=2001, tree_ids=[11]}"))


@pytest.mark.parametrize("settings", [(), ("mechanics={}",)])
@pytest.mark.parametrize("done", [1, 5, 6])
def test_stopped_before_and_after_an_act(done: int, settings: tuple[str, ...]) -> None:
    """Acts that are done are not done again, whatever year the checkpoint is of."""
    scenario = with_acts(*ALL, settings=settings)
    stand = Stand(scenario)
    steps(stand, done)
    restored = Stand.restore(scenario, *stand.state())
    for record, other in zip(
        steps(stand, YEARS - done), steps(restored, YEARS - done), strict=True
    ):
        for table, columns in record.tables.items():
            for name, column in columns.items():
                np.testing.assert_array_equal(column, other.tables[table][name], name)
    assert_same_state(stand, restored)


def test_sample_trees_lose_what_is_cut(tmp_path: Path) -> None:
    """Tree 1 is pruned in 2006; tree 4 is pruned then and felled a year later."""
    with simulate(with_acts(*ALL), tmp_path / "a.h5") as run:
        stand = Stand(tiny())
        steps(stand, 5)
        for tree_id, choice in ((1, {"side_deg": 270}), (4, {"below_m": 0.4})):
            before = stand.skeleton(tree_id).serial
            stand.prune(tree_id, **choice)
            cut = np.setdiff1d(before, stand.skeleton(tree_id).serial)
            assert cut.size
            assert set(cut) <= set(recorded(run, tree_id)[2006])
        last = run.skeleton(4, 2006)
        assert sorted(recorded(run, 4)[2007]) == last.serial.tolist()
        with pytest.raises(InputError, match="tree 4 is not on record in 2007"):
            run.skeleton(4, 2007)
        for tree_id in (1, 4):
            lost = [serial for year in recorded(run, tree_id).values() for serial in year]
            made = run._file[f"samples/{tree_id}/metamers/serial"][:].tolist()
            assert len(lost) == len(set(lost))  # nothing dies twice
            living = run.skeleton(tree_id, 2008).serial.tolist() if tree_id == 1 else []
            assert sorted(lost + living) == sorted(made)


def test_sample_trees_cut_by_hand() -> None:
    """What is cut between two steps dies in the year of the next, across a checkpoint too."""
    stand = Stand(tiny())
    steps(stand, 5)
    before = stand.skeleton(1).serial
    stand.prune(1, below_m=0.4)
    cut = np.setdiff1d(before, stand.skeleton(1).serial)
    whole = stand.skeleton(4).serial
    stand.fell([4])
    restored = Stand.restore(stand.scenario, *stand.state())
    first, second = steps(stand, 2)
    assert set(cut) <= set(first.samples[1].dead_serial)
    assert first.samples[4].dead_serial.tolist() == whole.tolist()
    assert not first.samples[4].serial.size
    assert not set(cut) & set(second.samples[1].dead_serial)
    assert 4 not in second.samples
    assert_same_years([first, second], steps(restored, 2))


def test_the_shipped_pine_regains_its_balance() -> None:
    """Pruned on its south side before 2014, it has gone half of the way back by 2034."""
    pine = Scenario.load(Path(__file__).parents[2] / "scenarios" / "pruned_pine.toml")
    north: dict[int, list[float]] = {2014: [], 2034: []}
    for seed in (1, 2, 3, 4):
        stand = Stand(pine.with_overrides([f"seed={seed}"]))
        while stand.year < 2034:
            stand.step()
            if stand.year in north:
                tree = stand.skeleton(1)
                mass = tree.radius**2 * tree.length
                y = 0.5 * (tree.start[:, 1] + tree.end[:, 1]) - tree.start[0, 1]
                north[stand.year].append(float((mass * y).sum() / mass.sum()))
    pruned, later = (np.mean(values) for values in north.values())
    assert pruned > 0.1
    assert later < 0.6 * pruned


UNKNOWN = "{kind='prune', year=2005, tree_ids=[1, 99], below_m=0.4}"


def test_an_act_that_cannot_be_done_leaves_the_stand() -> None:
    scenario = with_acts("{kind='prune', year=2005, tree_id=2, below_m=0.4}", UNKNOWN)
    stand, other = Stand(scenario), Stand(tiny())
    steps(stand, 4)
    steps(other, 4)
    for _ in range(2):
        with pytest.raises(ActError, match=r"acts\[1\]\.tree_ids in 2005: no living tree .* 99"):
            stand.step()
        assert_same_state(stand, other)


@pytest.mark.parametrize(
    ("act", "says"),
    [
        ("kind='prune', tree_id=99, below_m=1", r"acts\[0\]\.tree_id in 2003: .* id 99"),
        ("kind='prune', tree_id=1, metamer=9999", r"acts\[0\]\.metamer in 2003: tree 1 has no"),
        ("kind='prune', tree_id=1, metamer=0", r"acts\[0\]\.metamer in 2003: .* whole tree 1"),
        ("kind='fell', tree_ids=[99]", r"acts\[0\]\.tree_ids in 2003: .*one of 1, 2, 3"),
    ],
)
def test_what_cannot_be_done_is_named(act: str, says: str) -> None:
    stand = Stand(with_acts(f"{{year=2003, {act}}}"))
    steps(stand, 2)
    with pytest.raises(ActError, match=says):
        stand.step()


def test_a_run_that_an_act_stops_is_kept_and_goes_on_without_it(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    with pytest.raises(ActError, match="99"):
        simulate(with_acts(PLANT, UNKNOWN), out)
    with open_run(out) as run:
        assert run.years.tolist() == [2001, 2002, 2003, 2004]
        assert not run.complete
    with simulate(with_acts(*ALL), out, resume=True) as run:
        assert run.provenance["sessions"][-1]["years_before"] == 4
        assert [type(act) for act in run.scenario.acts].count(Fell) == 1
        with simulate(with_acts(*ALL), tmp_path / "whole.h5") as whole:
            assert_same_runs(run, whole)
    with pytest.raises(InputError, match="different scenario"):
        simulate(with_acts(*ALL[1:], settings=("years=9",)), out, resume=True)
    with simulate(
        with_acts(*ALL, "{kind='fell', year=2009, tree_ids=[1]}", settings=("years=9",)),
        out,
        resume=True,
    ) as run:
        assert run.population.felled.tolist()[-3:] == [2, 0, 1]
