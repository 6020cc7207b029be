"""Mechanics in the stand's year: rods stay with their metamers, and the records tell of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from forest.measure.trees import BREAST_HEIGHT_M
from forest.record.run import open_run
from forest.simulation import simulate
from forest.stand import Stand
from forest.trees import table
from tests.everything import VARIANTS, everything
from tests.fixed import fixed
from tests.mechanics.year_checks import BENDING, assert_rods_fit, assert_tree_fits, rods_of
from tests.tiny import TOML, YEARS, assert_same_state, steps

PINES = TOML.replace(", fagus_sylvatica = {}", "")


def test_rods_fit_in_every_year() -> None:
    """Seedlings, growth, shedding: what is stored of a metamer is its own."""
    stand = Stand(fixed(TOML, *BENDING))
    metamers = 0
    shed = False
    for _ in range(YEARS):
        stand.step()
        assert_rods_fit(stand)
        assert stand.mechanics is not None
        assert stand.mechanics.settled is not None
        assert stand.mechanics.settled.stable.all()
        metamers += int(stand.rows.size.sum())
        shed = shed or bool((stand.rows.next_serial > stand.rows.size).any())
    assert shed
    assert metamers > 1000


def test_rods_fit_after_planting_pruning_and_felling() -> None:
    stand = Stand(fixed(TOML, *BENDING))
    steps(stand, 4)
    stand.plant([1.0, 2.0, 9.5], [1.0, 8.0, 9.5], "fagus_sylvatica")
    stand.step()
    assert_rods_fit(stand)
    stand.prune(1, _a_branch(stand, 1))
    stand.fell([2, 3])
    stand.step()
    assert_rods_fit(stand)
    young = stand.rows.birth == 4
    assert young.sum() == 3
    assert np.all(stand.rows.size[young] > 1)


def test_rods_fit_after_recruits_come() -> None:
    """A recruit comes with several metamers and the years that it lived as a seedling."""
    stand = Stand(everything(*VARIANTS["bending"]))
    several = 0
    for _ in range(8):
        several += int((stand.rows.size[_newcomers(stand)] > 1).sum())
        stand.step()
        grown = table.keep(stand.rows, ~_newcomers(stand))
        for row in range(len(grown.tree_id)):
            assert_tree_fits(stand, grown, row)
    assert several > 20


def _newcomers(stand: Stand) -> NDArray[np.bool_]:
    return ~table.have_grown(stand.rows, stand.arena.metamers, stand.steps)


def _a_branch(stand: Stand, tree_id: int) -> int:
    """Serial of the metamer that starts a tree's heaviest branch."""
    tree = stand.skeleton(tree_id)
    starts = np.flatnonzero((tree.order == 1) & (tree.order[tree.parent] == 0))
    return int(tree.serial[starts[np.argmax(tree.radius[starts])]])


def test_the_place_in_memory_does_not_matter() -> None:
    """A stand whose extents are laid out anew every year bends to the same bits."""
    scenario = fixed(TOML, *BENDING)
    stand, moved = Stand(scenario), Stand(scenario)
    for _ in range(YEARS - 2):
        stand.step()
        moved.step()
        moved = Stand.restore(scenario, *moved.state())
        assert_same_state(stand, moved)
    assert np.any(stand.rows.start != moved.rows.start)


def test_a_branch_that_goes_lets_the_others_rise() -> None:
    """A pruned stem carries less: its lean changes, its wood does not."""
    stand, pruned = Stand(fixed(TOML, *BENDING)), Stand(fixed(TOML, *BENDING))
    steps(stand, 6)
    steps(pruned, 6)
    before = rods_of(pruned, 0).rigidity[0].copy()
    gone = pruned.prune(1, _a_branch(pruned, 1))
    assert gone > 1
    np.testing.assert_array_equal(rods_of(pruned, 0).rigidity[0], before)
    stand.step()
    pruned.step()
    assert_rods_fit(pruned)
    top = [s.arena.metamers.tip[s.rows.start[0] : s.rows.start[0] + 5] for s in (stand, pruned)]
    assert not np.array_equal(*top)


@pytest.mark.parametrize("bending", ["true", "false"])
def test_sample_trees_are_read_back_as_they_stood(tmp_path: Path, bending: str) -> None:
    scenario = fixed(
        TOML, *BENDING, f"mechanics.bending={bending}", "output.sample_trees={ids=[1, 4]}"
    )
    simulate(scenario, tmp_path / "run.h5").close()
    stand = Stand(scenario)
    with open_run(tmp_path / "run.h5") as run:
        assert run.samples == (1, 4)
        for _ in range(YEARS):
            stand.step()
            for tree_id in run.samples:
                wanted, found = stand.skeleton(tree_id), run.skeleton(tree_id, stand.year)
                for name, value in vars(wanted).items():
                    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                        np.testing.assert_allclose(vars(found)[name], value, atol=2e-6)
                    else:
                        np.testing.assert_array_equal(vars(found)[name], value)
                if bending == "true" and len(wanted) > 200:
                    first = run.skeleton(tree_id, stand.year - 1)
                    both = np.isin(found.serial, first.serial)
                    old = first.end[np.isin(first.serial, found.serial)]
                    assert np.abs(found.end[both] - old).max() > 1e-3


def test_branches_spring_up_in_winter() -> None:
    """Beeches drop leaves and fruit; pines keep their needles and stay as they are."""
    stand = Stand(fixed(TOML, *BENDING))
    steps(stand, YEARS)
    arrays, _ = stand.state()
    risen = {"pinus_sylvestris": [], "fagus_sylvatica": []}  # type: dict[str, list[float]]
    for tree_id in stand.rows.tree_id:
        summer = stand.skeleton(int(tree_id))
        winter = stand.skeleton(int(tree_id), "winter")
        np.testing.assert_array_equal(summer.serial, winter.serial)
        np.testing.assert_allclose(winter.length, summer.length, atol=1e-5)
        rise = (winter.end - summer.end)[:, 2]
        risen[summer.species].append(float(np.abs(rise).max()))
        if summer.species == "fagus_sylvatica":
            assert rise.mean() > 0.0
    assert min(risen["fagus_sylvatica"]) > 0.005
    assert max(risen["pinus_sylvestris"]) < 1e-3
    after, _ = stand.state()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, after[name], name)


def test_a_seedling_that_has_not_bent_stands_in_winter_as_planted() -> None:
    stand = Stand(fixed(TOML, *BENDING))
    np.testing.assert_array_equal(stand.skeleton(1, "winter").end, stand.skeleton(1).end)
    stand.step()
    (young,) = stand.plant([5.0], [5.0], "fagus_sylvatica")
    np.testing.assert_array_equal(stand.skeleton(young, "winter").end, stand.skeleton(young).end)


def test_stability_rows() -> None:
    stand = Stand(fixed(TOML, *BENDING))
    for record in steps(stand, YEARS):
        table, trees = record.tables["stability"], record.tables["trees"]
        for name in ("year", "tree_id", "species"):
            np.testing.assert_array_equal(table[name], trees[name])
        assert np.all(table["safety_factor"] > 1.0)
        assert np.all(table["critical_height_m"] > 0.0)
        assert np.all(table["frequency_hz"] > 0.0)
        assert np.all(table["wind_stress_share"] > table["stress_share"])
        assert np.all(table["stress_height_m"] <= trees["height_m"])
        assert np.all(table["base_moment_nm"] > 0.0)
    calm = Stand(fixed(TOML))
    assert "stability" not in steps(calm, 1)[0].tables


def test_wind_loads_stems_and_moves_nothing() -> None:
    still, windy = (
        steps(Stand(fixed(TOML, f"mechanics={{wind_m_s={v}}}")), 5)[-1] for v in (0, 20)
    )
    np.testing.assert_array_equal(
        still.tables["trees"]["height_m"], windy.tables["trees"]["height_m"]
    )
    one, other = still.tables["stability"], windy.tables["stability"]
    np.testing.assert_array_equal(one["stress_share"], one["wind_stress_share"])
    np.testing.assert_array_equal(one["stress_share"], other["stress_share"])
    assert np.all(other["wind_stress_share"] > one["wind_stress_share"])


@pytest.mark.parametrize("bending", ["true", "false"])
def test_rings_are_those_of_the_stem_at_breast_height(bending: str) -> None:
    stand = Stand(fixed(TOML, f"mechanics={{bending={bending}}}", "years=14"))
    for record in steps(stand, 14):
        rings = record.tables["rings"]
        assert np.all((rings["eccentricity"] >= 0.0) & (rings["eccentricity"] < 1.0))
        side = rings["thick_side_deg"]
        np.testing.assert_array_equal(np.isnan(side), rings["eccentricity"] == 0.0)
        assert np.all(np.isnan(side) | ((side >= 0.0) & (side < 360.0)))
    assert stand.mechanics is not None
    breast = stand.rows.start + stand.measure().breast_metamer
    there = rings["stem_height_m"] == BREAST_HEIGHT_M
    here = np.isin(stand.rows.tree_id, rings["tree_id"][there])
    eccentricity, azimuth = stand.mechanics.thick_sides(stand.arena, breast[here])
    np.testing.assert_array_equal(rings["eccentricity"][there], eccentricity)
    np.testing.assert_array_equal(side[there], np.degrees(azimuth) % 360.0)
    assert len(eccentricity) > 0


def test_rings_of_pines_that_lean_are_thick_below() -> None:
    stand = Stand(fixed(PINES, "mechanics={}", "years=14"))
    rings = steps(stand, 14)[-1].tables["rings"]
    breast = stand.measure().breast_metamer
    arena = stand.arena.metamers
    compared = 0
    for k in np.flatnonzero(rings["stem_height_m"] == BREAST_HEIGHT_M):
        row = stand.row_of(int(rings["tree_id"][k]))
        start, i = int(stand.rows.start[row]), int(breast[row])
        x, y, z = (arena.tip[start + i] - arena.tip[start + arena.parent[start + i]]).astype(float)
        if rings["eccentricity"][k] == 0.0 or np.hypot(x, y) < 0.1 * z:
            continue
        apart = rings["thick_side_deg"][k] - np.degrees(np.arctan2(y, x))
        # the ring was laid in the shape of the summer before
        assert abs((apart + 180.0) % 360.0 - 180.0) < 25.0
        compared += 1
    assert compared > 0


def test_rings_without_bending_are_thick_towards_the_load() -> None:
    """In pines: below branches, and on the side of the crown at stems."""
    stand = Stand(fixed(PINES, "mechanics={bending=false}", "years=14"))
    steps(stand, 14)
    assert stand.mechanics is not None
    assert stand.mechanics.settled is None
    compared = [0, 0]
    for row, tree_id in enumerate(stand.rows.tree_id):
        tree = stand.skeleton(int(tree_id))
        index = stand.rows.start[row] + np.arange(len(tree))
        eccentricity, azimuth = stand.mechanics.thick_sides(stand.arena, index)
        volume = tree.radius**2 * tree.length
        centre = (0.5 * (tree.start + tree.end) * volume[:, None]).sum(axis=0) / volume.sum()
        stem = (tree.order == 0)[:, None]
        x, y, _ = np.where(stem, centre - tree.start[0], tree.end - tree.start).T
        towards = np.cos(azimuth - np.arctan2(y, x))
        compared[0] += int(np.sum((eccentricity > 0.0) & (tree.order == 0)))
        compared[1] += int(np.sum((eccentricity > 0.0) & (tree.order > 0)))
        assert np.all(np.isnan(towards) == (eccentricity == 0.0))
        assert np.all(towards[(eccentricity > 0.0) & (tree.order > 0)] > 0.999)
        assert np.all(towards[(eccentricity > 0.0) & (tree.order == 0)] > 0.5)  # leaves weigh, too
    assert min(compared) > 0
