"""Discs, sections and cores out of a run agree with its tables and with each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from forest.dendro import core
from forest.errors import InputError
from forest.measure.stem import stems_of_skeletons
from forest.record.run import Run, open_run
from forest.scenario import Scenario
from forest.simulation import simulate
from tests.dendro.test_disc import area
from tests.record.years import create

YEARS = 25
STAND = """
title = "a few trees"
years = 25
start_year = 1981
plot = { size_m = [10, 10], boundary = "open" }
environment = { shadow = {}, canopy = {} }
planting = { kind = "random", density_ha = 600 }
output = { sample_trees = { ids = [1, 2] } }
"""


def grown(folder: Path, *overrides: str) -> Run:
    scenario = Scenario.from_toml(STAND + "\n".join(overrides))
    return simulate(scenario, folder / "run.h5")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    with grown(tmp_path_factory.mktemp("upright"), "[species.pinus_sylvestris]") as run:
        yield run


@pytest.fixture(scope="module", params=["picea_abies", "fagus_sylvatica"])
def bending(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp(request.param)
    return grown(folder, f"[species.{request.param}]", "[mechanics]", "bending = true")


def test_discs_agree_with_the_table_of_trees(run: Run) -> None:
    trees = run.trees[run.trees["dbh_cm"].notna()]
    some = trees[trees["year"].isin([1995, 2005])]
    assert len(some) > 4
    for row in some.itertuples():
        disc = run.disc(row.tree_id, 1.3, year=row.year)
        assert disc.years[-1] == row.year
        assert 200 * (disc.radius + disc.bark_thickness) == pytest.approx(row.dbh_cm, rel=1e-6)
        assert 1000 * disc.ring_widths[-1] == pytest.approx(row.ring_width_mm, rel=1e-6)
        over_bark = disc.radius + disc.bark_thickness
        assert np.pi * over_bark**2 == pytest.approx(row.basal_area_m2, rel=1e-6)


def test_a_sample_tree_at_any_height(run: Run) -> None:
    stem = run.stem(1)
    skeleton = run.skeleton(1, 2005)
    (one,) = [stems_of_skeletons([skeleton], stem.bark_factor)]
    for height in (0.3, 0.77, 1.3, 2.9):
        disc = run.disc(1, height)
        wood = one.diameter_at(height, over_bark=False)[0]
        assert 2 * disc.radius == pytest.approx(wood, rel=1e-6)
        own = stem.rings(height)
        both = min(len(own.year), len(disc.years))
        assert both > 10
        np.testing.assert_allclose(own.width_mm[-both:] / 1000, disc.ring_widths[-both:], atol=1e-7)
        np.testing.assert_array_equal(own.cambial_age[-both:], disc.cambial_ages[-both:])


def test_the_rings_of_a_stem_fill_it(run: Run, bending: Run) -> None:
    for each in (run, bending):
        stem = each.stem(1)
        skeleton = each.skeleton(1, 2005)
        volume = stems_of_skeletons([skeleton], 0.0).volume()[0]
        summed = stem.ring_volumes().sum() + stem.undated_volume()
        assert summed == pytest.approx(volume, rel=1e-12)
        assert stem.undated_volume() < 0.01 * volume


def test_thick_sides_lie_where_reaction_wood_grows(bending: Run) -> None:
    """Conifers push from below, broadleaves pull from above."""
    below = bending.scenario.species_list[0].group == "conifer"
    cosines, weights = [], []
    for year in range(1996, 2006, 3):
        stem = bending.stem(1, year=year)
        for height in np.linspace(0.5, 0.9 * stem.height_m, 12):
            disc = stem.disc(float(height))
            lean = stem.direction[stem.internode_at(float(height))]
            if np.hypot(*lean[:2]) < 0.05 or disc.eccentricity[-1] == 0.0:
                continue
            towards = np.degrees(np.arctan2(lean[1], lean[0]))
            low, high = disc.widths_at(towards)[-1], disc.widths_at(towards + 180)[-1]
            cosines.append((low - high) / (low + high))
            weights.append(disc.eccentricity[-1])
    assert len(weights) > 8
    share = sum(cosines) / sum(weights)
    assert (share if below else -share) > 0.5


def test_a_level_section_is_the_disc(run: Run) -> None:
    stem = run.stem(1)
    i = stem.internode_at(1.0)
    middle = 0.5 * (stem.start[i] + stem.end[i])
    section = run.section(1, middle, stem.direction[i])
    disc = run.disc(1, float(middle[2]))
    assert section.years.tolist() == disc.years.tolist()
    for loops, outline in zip(section.outlines[3:], disc.outlines[3:], strict=True):
        assert len(loops) == 1
        assert abs(area(loops[0])) == pytest.approx(area(outline), rel=0.01)
    assert [knot.serial for knot in section.knots] == [knot.serial for knot in disc.knots]


def test_a_radial_board_shows_each_year_within_the_next(run: Run) -> None:
    stem = run.stem(1)
    section = run.section(1, stem.start[0], (0.0, 1.0, 0.0))
    assert section.years.tolist() == stem.years.tolist()
    tops = [max(loop[:, 1].max() for loop in loops) for loops in section.outlines]
    areas = [sum(abs(area(loop)) for loop in loops) for loops in section.outlines]
    assert np.all(np.diff(areas) > 0)
    assert tops[-1] > tops[5] > tops[0]
    feet = [np.ptp(loops[0][loops[0][:, 1] < 1e-3, 0]) for loops in section.outlines[2:]]
    assert feet == pytest.approx(2 * stem.radius[2:, 0], rel=0.02)
    assert section.knots


def test_knots_end_when_branches_do(run: Run) -> None:
    stem = run.stem(1)
    lost = np.flatnonzero((stem.branches.radius[-1] == 0) & (stem.branches.radius.max(0) > 0.004))
    kept = np.flatnonzero(stem.branches.radius[-1] > 0.004)
    for branches, alive in ((lost, False), (kept, True)):
        assert len(branches)
        for b in branches[:5]:
            node = stem.branches.node[b]
            last = int(stem.years[stem.branches.radius[:, b] > 0][-1])
            then = stem.radius[stem.years == last, node][0]
            towards = stem.branches.direction[b]
            sine = np.linalg.norm(np.cross(towards, stem.direction[node]))
            disc = run.disc(1, float(stem.end[node, 2] + 0.5 * then / sine * towards[2]))
            (knot,) = [k for k in disc.knots if k.serial == stem.branches.serial[b]]
            assert knot.alive == alive
            assert knot.last_year == last
            reach = np.hypot(*knot.outline.T).max()
            assert reach < disc.radius * (1 + 1e-9)
            if not alive:
                assert reach < then + 2 * stem.branches.radius[:, b].max()


def test_cores_are_those_of_the_table(run: Run) -> None:
    one, other = run.core(3, 1.3, 40.0, aim_sd_deg=5.0), core(run.rings, 3, 40.0, aim_sd_deg=5.0)
    np.testing.assert_array_equal(one.width_mm, other.width_mm)
    assert one.miss_mm == other.miss_mm
    assert run.core(3, 1.3, 40.0, year=2000).year[-1] == 2000
    free = run.core(1, 0.9, 0.0)
    np.testing.assert_allclose(free.width_mm, 1000 * run.disc(1, 0.9).ring_widths)


def test_a_tree_that_came_on_record_late(tmp_path: Path) -> None:
    text = STAND.replace("ids = [1, 2]", "dbh_quantiles = [0.5], at_year = 1999")
    scenario = Scenario.from_toml(text + "[species.pinus_sylvestris]")
    with simulate(scenario, tmp_path / "run.h5") as run:
        (tree,) = run.samples
        whole, part = run.disc(tree, 1.3), run.disc(tree, 0.9)
        assert whole.undated_radius == 0.0
        assert part.years.tolist() == [2000, 2001, 2002, 2003, 2004, 2005]
        assert part.undated_radius == pytest.approx(part.radius - part.ring_widths.sum())
        assert part.undated_radius > 0.2 * part.radius
        with pytest.raises(InputError, match="on record from 1999 to 1999 only"):
            run.disc(tree, 0.9, year=1999)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((3, 2.0), "tree 3 has no rings at 2 m; expected a height on record: 0.3, 1.3"),
        ((1, 55.0), "tree 1 has no stem at 55 m in 2005; expected 0 to "),
        ((1, -1.0), "tree 1 has no stem at -1 m"),
        ((1, float("nan")), "height nan; expected a number of metres"),
        ((99, 1.3), "no tree 99 ever lived in this run; its trees are numbered 1 to "),
        ((3, 1.3, 1900), "no year 1900; expected a year from 1981 to 2005"),
        ((1, 1.3, 2006), "no year 2006; expected a year from 1981 to 2005"),
        ((3, 1.3, 1981), "has no ring"),
    ],
)
def test_what_cannot_be_cut_is_refused(run: Run, words: tuple, says: str) -> None:
    tree, height, *year = words
    for cut in (run.disc, lambda *a, **k: run.core(*a, 0.0, **k)):
        with pytest.raises(InputError, match=says.replace("(", "\\(")) as error:
            cut(tree, height, year=year[0] if year else None)
        assert "\n" not in str(error.value)


def test_planes_and_trees_without_a_section_are_refused(run: Run) -> None:
    with pytest.raises(InputError, match="the plane misses the stem of tree 1; expected a plane"):
        run.section(1, (0, 0, 100), (0, 0, 1))
    with pytest.raises(InputError, match="tree 3 is no sample tree; expected 1, 2"):
        run.section(3, (0, 0, 1), (0, 0, 1))


def test_an_empty_run_is_refused(tmp_path: Path) -> None:
    create(tmp_path / "run.h5").close()
    with open_run(tmp_path / "run.h5") as run:
        for cut in (run.disc, lambda *a: run.core(*a, 0.0), lambda *a: run.stem(a[0])):
            with pytest.raises(InputError, match="holds no years yet"):
                cut(1, 1.3)
