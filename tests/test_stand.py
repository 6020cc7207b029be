"""Acts between the years: planting, felling, pruning; their events and the ledger."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from forest.errors import InputError
from forest.record import ledger
from forest.record.schema import CAUSES, EVENT_KINDS
from forest.stand import Stand
from forest.yearbook import YearRecord
from tests.tiny import assert_same_state, assert_same_years, steps, tiny

TREES = 10


@pytest.fixture
def stand() -> Stand:
    """A stand of five years."""
    young = Stand(tiny())
    steps(young, 5)
    return young


def kinds(record: YearRecord) -> Counter[tuple[str, str]]:
    """Count a year's events by kind and cause."""
    events = record.tables["events"]
    return Counter(
        (EVENT_KINDS[kind], CAUSES[cause])
        for kind, cause in zip(events["kind"], events["cause"], strict=True)
    )


def check_ledgers(before: int, records: Sequence[YearRecord]) -> None:
    """Check that trees and dry mass balance in every year."""
    for record in records:
        row = ledger.population_row(
            record.year, before, record.tables["trees"], record.tables["events"]
        )
        ledger.check_carbon(record.year, record.tables["carbon"])
        before = int(row["living"][0])


def test_first_year_records_the_planting() -> None:
    records = steps(Stand(tiny()), 2)
    assert kinds(records[0])["planted", "none"] == TREES
    assert not kinds(records[1])["planted", "none"]
    check_ledgers(0, records)


def test_felled_trees_are_gone_with_an_event(stand: Stand) -> None:
    before = stand.trees.set_index("tree_id")
    stand.fell([2, 7, 2], cause="thinning")
    assert stand.trees.tree_id.tolist() == [i for i in range(1, TREES + 1) if i not in (2, 7)]
    records = steps(stand, 2)
    events = records[0].tables["events"]
    assert kinds(records[0]) == {("felled", "thinning"): 2}
    assert events["tree_id"].tolist() == [2, 7]
    assert events["height_m"].tolist() == before.height_m[[2, 7]].tolist()
    assert not kinds(records[1])
    removed = records[0].tables["stand"]["removed_ha"]
    assert removed[-1] == 2 / 0.01
    check_ledgers(TREES, records)


def test_all_trees_can_be_felled(stand: Stand) -> None:
    stand.fell(range(1, TREES + 1))
    records = steps(stand, 2)
    assert len(records[1].tables["trees"]["tree_id"]) == 0
    check_ledgers(TREES, records)
    assert stand.plant([5.0], [5.0], "fagus_sylvatica") == [TREES + 1]
    (record,) = steps(stand, 1)
    assert record.tables["trees"]["tree_id"].tolist() == [TREES + 1]
    check_ledgers(0, [record])


def test_felling_is_all_or_nothing(stand: Stand) -> None:
    with pytest.raises(InputError, match="id 99"):
        stand.fell([1, 99])
    with pytest.raises(InputError, match="did you mean 'harvest'"):
        stand.fell([1], cause="harvst")
    assert len(stand.trees) == TREES
    assert not stand.pending


def test_planted_trees_grow(stand: Stand) -> None:
    ids = stand.plant([1.0, 10.0], [2.0, 0.0], ["fagus_sylvatica", "pinus_sylvestris"])
    assert ids == [TREES + 1, TREES + 2]
    new = stand.trees.set_index("tree_id").loc[ids]
    assert new.species.tolist() == ["fagus_sylvatica", "pinus_sylvestris"]
    assert new.x_m.tolist() == [1.0, 0.0]  # the right edge of a torus is its left edge
    records = steps(stand, 3)
    assert kinds(records[0]) == {("planted", "none"): 2}
    check_ledgers(TREES, records)
    grown = stand.trees.set_index("tree_id").loc[ids]
    assert (grown.height_m > new.height_m).all()
    assert grown.age.tolist() == [3, 3]


@pytest.mark.parametrize(
    ("x", "y", "species", "says"),
    [
        ([1.0], [11.0], "pinus_sylvestris", "outside the plot"),
        ([np.nan], [1.0], "pinus_sylvestris", "outside the plot"),
        ([1.0], [1.0], "picea_abies", "picea_abies.*expected one of pinus_sylvestris"),
        ([1.0, 2.0], [1.0], "pinus_sylvestris", "2 x, 1 y"),
        ([1.0, 2.0], [1.0, 2.0], ["pinus_sylvestris"], "1 species"),
    ],
)
def test_planting_is_checked(
    stand: Stand, x: list[float], y: list[float], species: str | list[str], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        stand.plant(x, y, species)
    assert len(stand.trees) == TREES


def test_seedlings_may_be_planted_leaning(stand: Stand) -> None:
    ids = stand.plant(
        [1.0, 2.0], [2.0, 2.0], "pinus_sylvestris", lean_deg=[30.0, 0.0], lean_azimuth_deg=90.0
    )
    leaning, upright = (stand.skeleton(tree_id) for tree_id in ids)
    length = leaning.length[0]
    reach = leaning.end[0] - leaning.start[0]
    np.testing.assert_allclose(
        reach, length * np.array([0.0, 0.5, np.sqrt(0.75)]), atol=1e-6 * length
    )
    assert (upright.end[0] - upright.start[0]).tolist()[:2] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("leans", "says"),
    [
        ({"lean_deg": 90.0}, "lean_deg = 90.0.*0 to 85"),
        ({"lean_deg": [1.0, 2.0]}, "one for all trees or one for each"),
        ({"lean_azimuth_deg": np.nan}, "lean_azimuth_deg = nan.*-360 to 360"),
    ],
)
def test_leaning_is_checked(stand: Stand, leans: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        stand.plant([1.0], [1.0], "pinus_sylvestris", **leans)


def test_pruning_takes_a_branch_and_what_it_carries(stand: Stand) -> None:
    before = stand.skeleton(1)
    branch = int(np.flatnonzero(before.order == 1)[0])
    below = np.zeros(len(before.parent), bool)
    for i, parent in enumerate(before.parent):
        below[i] = i == branch or (parent >= 0 and below[parent])
    assert stand.prune(1, int(before.serial[branch])) == below.sum()
    after = stand.skeleton(1)
    assert after.serial.tolist() == before.serial[~below].tolist()
    np.testing.assert_array_equal(after.end, before.end[~below])
    np.testing.assert_array_equal(after.start, before.start[~below])
    records = steps(stand, 2)
    assert kinds(records[0]) == {("pruned", "none"): 1}
    check_ledgers(TREES, records)
    assert not np.isin(before.serial[below], stand.skeleton(1).serial).any()


def test_topped_tree_lives_on(stand: Stand) -> None:
    """The stem is cut near the ground: no ring at 1.3 m until it is that high again."""
    stem = stand.skeleton(1)
    second = int(np.flatnonzero((stem.axis == 0) & (stem.parent == 0))[0])
    stand.prune(1, int(stem.serial[second]))
    records = steps(stand, 3)
    check_ledgers(TREES, records)
    for record in records:
        assert (record.tables["rings"]["width_mm"] >= 0).all()


def test_pruning_is_checked(stand: Stand) -> None:
    with pytest.raises(InputError, match="id 99"):
        stand.prune(99, 1)
    with pytest.raises(InputError, match="no metamer 123456"):
        stand.prune(1, 123456)
    with pytest.raises(InputError, match="carries the whole tree"):
        stand.prune(1, int(stand.skeleton(1).serial[0]))
    with pytest.raises(InputError, match="expected one of below_m, below_share"):
        stand.prune(1)
    with pytest.raises(InputError, match=r"Stand\.prune: side: .*did you mean 'side_deg'"):
        stand.prune(1, side=270)
    with pytest.raises(InputError, match=r"Stand\.prune: below_m: nan"):
        stand.prune(1, below_m=np.nan)
    with pytest.raises(InputError, match="metamer and below_m exclude each other"):
        stand.prune(1, 2, below_m=1.0)
    with pytest.raises(InputError, match="no metamer 123456"):
        stand.prune(1, [1, 123456])
    assert stand.prune(1, []) == 0
    assert stand.prune(1, side_deg=0, from_m=100) == 0
    assert not stand.pending


def test_several_metamers_are_one_pruning(stand: Stand) -> None:
    """One may stand on another; a tree that is lift-pruned has no branch below that height."""
    before = stand.skeleton(1)
    branch = int(np.flatnonzero(before.order == 1)[0])
    above = int(np.flatnonzero(before.parent == branch)[0])
    stand.prune(1, [int(before.serial[above]), int(before.serial[branch])])
    assert not np.isin(before.serial[[above, branch]], stand.skeleton(1).serial).any()
    assert [event.kind for event in stand.pending] == ["pruned"]
    stand.prune(1, below_m=0.5)
    after = stand.skeleton(1)
    on_trunk = (after.order == 1) & (after.order[after.parent] == 0)
    assert (after.start[on_trunk, 2] >= 0.5).all()


def test_acts_before_a_checkpoint_are_in_it(stand: Stand) -> None:
    """A stand restored between an act and its year records the act all the same."""
    stand.fell([3])
    stand.plant([4.0], [4.0], "pinus_sylvestris")
    restored = Stand.restore(stand.scenario, *stand.state())
    assert_same_state(stand, restored)
    assert_same_years(steps(stand, 3), steps(restored, 3))


def test_metamers_are_born_in_the_calendar_year_that_made_them() -> None:
    young = Stand(tiny())
    tree_id = int(young.rows.tree_id[0])
    planted = young.skeleton(tree_id).birth_year
    young.step()
    assert list(planted) == [young.scenario.start_year - 1]
    assert young.skeleton(tree_id).birth_year.max() == young.year


def test_marker_space_alone_fits_any_periodic_plot() -> None:
    young = Stand(tiny("environment={markers={}}", "plot.size_m=[6.7, 7.1]"))
    young.step()
    assert young.rows.size.max() > 1
