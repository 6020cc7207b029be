"""The numbers of the scripts: by hand, and against what the run's tables say otherwise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis import (
    diameter_distribution,
    drawn_stems,
    growth_dominance,
    old_growth,
    pressler,
    ring_series,
    social_classes,
    stem_analysis,
    succession,
)
from forest.measure.bucking import Product
from forest.measure.diameter_target import reverse_j
from forest.measure.gaps import gap_share
from forest.measure.products import DEFAULT_PRODUCTS
from forest.measure.stem import stems_of_skeletons
from forest.measure.tables import buck_run, plot_of, sample_skeletons
from forest.measure.taper import RINGS_READ, disc_diameters, taper_stems
from forest.record.run import Run

LAST = 1999


def _living_samples(run: Run) -> list[int]:
    return [i for i in run.samples if LAST in run.sample_years(i)]


def test_ring_series_by_hand():
    years = pd.RangeIndex(1900, 1904, name="Year")
    widths = pd.DataFrame({"T1": [4.0, 3.0, 2.0, 1.0], "T2": [np.nan, 1.0, 0.0, 2.0]}, index=years)
    about = pd.DataFrame({"species": ["picea_abies"] * 2}, index=["T1", "T2"])
    row = ring_series.table(widths, about).iloc[0]
    assert row["series"] == 2
    assert row["mean_mm"] == pytest.approx((2.5 + 1.0) / 2)
    assert row["autocorrelation"] == pytest.approx((1.0 - 1.0) / 2)  # 1 and -1
    assert row["decline"] == 0.5
    assert row["missing"] == pytest.approx(1 / 7)
    assert row["hairline"] == 0.0
    assert ring_series.table(widths / 40.0, about).iloc[0]["hairline"] == 0.5
    assert np.isnan(ring_series.autocorrelation(pd.Series([1.0, 1.0, 1.0])))
    aged = ring_series.by_cambial_age(widths)
    assert aged["T2"].tolist()[:3] == [1.0, 0.0, 2.0]
    assert aged.index.tolist() == [1, 2, 3, 4]


def test_cored_trees_are_the_living_ones_with_enough_rings(dense_run: Run):
    widths, about = ring_series.widths_of(dense_run)
    trees = dense_run.trees
    living = set(trees.loc[trees["year"] == LAST, "tree_id"])
    assert set(about["tree_id"]) <= living < set(trees["tree_id"])
    assert (widths.notna().sum() >= ring_series.FEWEST_RINGS).all()
    one = about.index[0]
    of = trees[trees["tree_id"] == about.loc[one, "tree_id"]].set_index("year")["ring_width_mm"]
    both = pd.concat([widths[one], of], axis=1).dropna()
    assert both.iloc[:, 0].to_numpy() == pytest.approx(both.iloc[:, 1].to_numpy())


def test_stem_analysis_finds_the_year_in_which_a_height_was_reached(dense_run: Run):
    reached = stem_analysis.years_to_heights(dense_run)
    heights = dense_run.trees
    fell = heights.groupby("tree_id")["height_m"].diff() < 0.0  # a leader was lost
    trees = heights.set_index(["tree_id", "age"])["height_m"]
    broken = set(heights.loc[fell, "tree_id"])
    whole = reached[~reached["tree_id"].isin(broken)]
    assert len(whole) > 0.5 * len(reached)
    for tree_id, _, height, age in whole.itertuples(index=False):
        assert trees[tree_id, age] >= height - 1e-3
        if age > 1:
            assert trees.get((tree_id, age - 1), 0.0) < height + 1e-3
    sums = stem_analysis.table(reached)
    assert sums["trees"].sum() == len(reached)
    assert (sums["quarter"] <= sums["median"]).all()


def test_internodes_of_a_sample_tree_tell_its_height_over_age(dense_run: Run):
    tree_id = max(_living_samples(dense_run))
    year, height = stem_analysis.stem_heights(dense_run.skeleton(tree_id, LAST))
    of = dense_run.trees[dense_run.trees["tree_id"] == tree_id].set_index("year")["height_m"]
    assert height[year <= 1980].max() <= of[1980] + 1e-3
    assert height.max() == pytest.approx(of[LAST], abs=0.5)
    drawn = stem_analysis.outlines(dense_run, tree_id)
    assert list(drawn) == [1999, 1989, 1979]
    breast = stems_of_skeletons([dense_run.skeleton(tree_id, 1989)], 0.0).diameter_at(1.3)[0]
    radius, high = drawn[1989]
    assert radius[np.argmax(high >= 1.3)] == pytest.approx(50.0 * breast)


def test_outlines_of_another_tree_are_its_discs(dense_run: Run):
    last = dense_run.read("trees", years=(LAST, LAST)).set_index("tree_id")
    tree_id = int(last.drop(index=list(dense_run.samples), errors="ignore")["dbh_cm"].idxmax())
    radius, high = stem_analysis.outlines(dense_run, tree_id)[LAST]
    assert high[1] == pytest.approx(1.3)
    species = {s.name: s.mensuration.bark_factor for s in dense_run.scenario.species_list}
    wood = 1.0 - species[last.loc[tree_id, "species"]]
    assert 2.0 * radius[1] == pytest.approx(last.loc[tree_id, "dbh_cm"] * wood, rel=1e-4)
    assert (radius[-1], high[-1]) == (0.0, pytest.approx(last.loc[tree_id, "height_m"]))


def test_ring_areas_of_the_pressler_study_by_hand(dense_run: Run):
    every = pressler.profiles(dense_run)
    rings = dense_run.rings
    row = every[every["stem_height_m"] == 1.3].iloc[0]
    mine = rings[(rings["tree_id"] == row["tree_id"]) & (rings["place"] == "height")]
    width = mine[np.isclose(mine["stem_height_m"], 1.3)].sort_values("year")["width_mm"]
    outer, inner = width.sum() / 10.0, width[:-5].sum() / 10.0
    assert row["area_cm2"] == pytest.approx(np.pi * (outer**2 - inner**2) / 5, rel=1e-4)
    assert row["width_mm"] == pytest.approx(width[-5:].mean(), rel=1e-4)


def test_pressler_table_by_hand():
    every = pd.DataFrame(
        {
            "tree_id": 1,
            "species": "picea_abies",
            "stem_height_m": [0.3, 1.3, 5.0, 7.0],
            "crown_base_m": 7.0,
            "width_mm": [1.0, 0.8, 1.2, 2.0],
            "area_cm2": [9.0, 4.0, 6.0, np.nan],
        }
    )
    (row,) = pressler.table(every).to_dict("records")
    assert row["trees"] == 1
    assert row["rising"] == pytest.approx(2 / 3)
    assert row["crown_per_breast"] == pytest.approx(2.5)
    assert row["area_ratio"] == pytest.approx(1.5)
    assert row["area_cv"] == pytest.approx(np.sqrt(2.0) / 5.0)


def test_internode_rings_add_up_to_those_of_the_disc(dense_run: Run):
    every = pressler.profiles(dense_run)
    tree_id = next(i for i in _living_samples(dense_run) if i in set(every["tree_id"]))
    of = pressler.internodes(dense_run, tree_id)
    at_5_m = of["area_cm2"][np.argmax(of["height_m"] >= 5.0)]
    disc = every[(every["tree_id"] == tree_id) & (every["stem_height_m"] == 5.0)]
    assert disc["area_cm2"].iloc[0] == pytest.approx(at_5_m, rel=1e-3)


def test_weibull_finds_its_parameters_again():
    dbh = stats.weibull_min(2.5, scale=18.0).ppf((np.arange(2000) + 0.5) / 2000)
    got = diameter_distribution.fit(dbh)
    assert got.scale_cm == pytest.approx(18.0, rel=0.01)
    assert got.shape == pytest.approx(2.5, rel=0.01)
    assert got.kolmogorov < 0.01


def test_diameters_of_every_tenth_year(dense_run: Run):
    numbers = diameter_distribution.table(dense_run.trees)
    assert numbers["year"].tolist() == [1969, 1979, 1989, 1999]
    row = numbers.iloc[-1]
    dbh = dense_run.trees.loc[dense_run.trees["year"] == LAST, "dbh_cm"].dropna()
    assert (row["trees"], row["mean_cm"]) == (len(dbh), pytest.approx(dbh.mean()))
    assert diameter_distribution.table(pd.DataFrame({"year": [1], "dbh_cm": [2.0]})).empty


def test_succession_by_hand():
    area = pd.DataFrame(
        {"betula_pendula": [0.0, 3.0, 2.0, 1.0], "fagus_sylvatica": [0.0, 1.0, 2.0, 3.0]},
        index=pd.RangeIndex(1, 5, name="age"),
    )
    birch, beech = succession.table(area).to_dict("records")
    assert (birch["peak_age"], birch["peak_share"], birch["last_share"]) == (2, 0.75, 0.25)
    assert (beech["peak_age"], beech["peak_share"], beech["last_m2ha"]) == (4, 0.75, 3.0)
    share = area.loc[2:].div(4.0)
    assert succession.overtaking(share) == 4
    assert succession.overtaking(share.loc[:3]) is None
    assert succession.overtaking(share[["fagus_sylvatica"]]) == 2


def test_turnover_by_hand():
    # Trees 1 to 4 in years 10 to 12: 2 dies, 3 grows past 10 cm, 4 stays thin.
    rows = [
        (10, 1, 20.0, "living"), (10, 2, 12.0, "living"), (10, 3, 9.0, "living"),
        (10, 4, 5.0, "living"), (11, 1, 21.0, "living"), (11, 2, 12.0, "dead"),
        (11, 3, 10.0, "living"), (11, 4, 5.0, "dead"), (12, 1, 22.0, "living"),
        (12, 3, 9.9, "living"),
    ]  # fmt: skip
    trees = pd.DataFrame(rows, columns=["year", "tree_id", "dbh_cm", "status"])
    (row,) = succession.turnover(trees, span=2).to_dict("records")
    assert row == {"age": 3, "stems": 2.0, "lost": 25.0, "grown": 25.0}
    assert succession.turnover(trees, span=3).empty
    assert succession.turnover(trees[trees["dbh_cm"] < 6.0], span=1).empty


def test_basal_areas_are_those_of_the_trees(dense_run: Run):
    area = succession.basal_areas(dense_run)
    sums = dense_run.trees.groupby("year")["basal_area_m2"].sum() * 100.0
    assert area.sum(axis=1).to_numpy() == pytest.approx(sums.to_numpy(), rel=1e-5)


def test_social_classes_by_hand():
    top = pd.Series([20.0] * 5)
    height = pd.Series([21.0, 18.0, 17.9, 10.0, 9.9])
    names = ["dominant", "dominant", "codominant", "intermediate", "suppressed"]
    assert list(social_classes.classify(height, top)) == names
    dbh = pd.Series([5.0, 10.0, 30.0])
    a, b = social_classes.naslund(dbh, 1.3 + (dbh / (1.5 + 0.2 * dbh)) ** 2)
    assert (a, b) == (pytest.approx(1.5), pytest.approx(0.2))


def test_suppressed_trees_are_more_slender(dense_run: Run):
    numbers = social_classes.table(social_classes.measured(dense_run))
    now = numbers[numbers["year"] == LAST].set_index("social")
    whole = dense_run.trees.loc[dense_run.trees["year"] == LAST, "dbh_cm"].notna().sum()
    assert now["trees"].sum() == whole
    classes = [name for name in social_classes.CLASSES if name in now.index]
    assert len(classes) > 1
    assert now.loc[classes[0], "mean_height_m"] > now.loc[classes[-1], "mean_height_m"]


@pytest.mark.parametrize(
    ("size", "growth", "dominance"),
    [
        ([1.0, 3.0], [1.0, 3.0], 0.0),
        ([3.0, 1.0], [4.0, 0.0], 0.25),  # area 0.75 / 2
        ([1.0, 3.0], [4.0, 0.0], -0.75),  # area 0.25 / 2 + 0.75
        ([1.0, 1.0, 2.0], [0.0, 0.0, 5.0], 0.5),
    ],
)
def test_growth_dominance_by_hand(size: list[float], growth: list[float], dominance: float):
    assert growth_dominance.growth_dominance(size, growth) == pytest.approx(dominance)


def test_periods_hold_the_trees_that_lived_through_them(dense_run: Run):
    found = growth_dominance.periods(dense_run)
    assert list(found)[-1] == LAST
    assert np.diff(list(found)).tolist() == [5] * (len(found) - 1)
    trees = dense_run.trees
    volume = trees.pivot(index="tree_id", columns="year", values="stem_volume_m3")
    of = found[LAST]
    assert of["size"].sum() == pytest.approx(volume.loc[of.index, 1994].sum(), rel=1e-6)
    assert (of["size"] + of["growth"]).sum() == pytest.approx(volume[LAST].sum(), rel=1e-6)


def test_drawn_stems_of_stand_grown_trees_are_near_the_true_ones(dense_run: Run):
    """The diameter at half the height within a fifth, the volume within a tenth."""
    shapes = sample_skeletons(dense_run, LAST)
    trees = dense_run.read("trees", years=(LAST, LAST))
    trees = trees[trees["tree_id"].isin([s.tree_id for s in shapes]) & (trees["dbh_cm"] > 7.0)]
    shapes = [s for s in shapes if s.tree_id in set(trees["tree_id"])]
    of = {s.name: s.mensuration.bark_factor for s in dense_run.scenario.species_list}
    bark = np.array([of[s.species] for s in shapes])
    true = stems_of_skeletons(shapes, bark)
    drawn = taper_stems(trees, disc_diameters(dense_run.read("rings", RINGS_READ)), bark)
    assert len(drawn) > 1
    half = 0.5 * drawn.height_m
    assert drawn.diameter_at(half) == pytest.approx(true.diameter_at(half), rel=0.2)
    assert drawn.volume() == pytest.approx(true.volume(), rel=0.1)


def test_drawn_stems_are_held_against_the_true_ones(dense_run: Run):
    rows, true, drawn = drawn_stems.both_stems(dense_run)
    assert set(rows["tree_id"]) == set(_living_samples(dense_run))
    logs = buck_run(dense_run, LAST, DEFAULT_PRODUCTS)
    sold = logs[logs["stem"] == "exact"].groupby("tree_id")["value"].sum()
    worth = pd.Series(drawn_stems.worth(true, rows), rows["tree_id"])
    assert worth[worth > 0.0].to_dict() == pytest.approx(sold.to_dict())
    excess = drawn_stems.excess_cm(true, drawn)
    half = 0.5 * min(true.height_m[0], drawn.height_m[0])
    by_hand = [100.0 * of.diameter_at(half, over_bark=False)[0] for of in (drawn, true)]
    assert excess[0, 9] == pytest.approx(by_hand[0] - by_hand[1])
    assert drawn_stems.excess_cm(true, true) == pytest.approx(0.0)


def test_drawn_stems_by_hand():
    rows = pd.DataFrame(
        {"species": ["a"] * 3, "true": [10.0, 0.0, 30.0], "drawn": [12.0, 0.0, 27.0]}
    )
    excess = np.zeros((3, 19))
    excess[0, 13:] = 3.0  # 0.7 to 0.95 of the height
    excess[:, :13] = 50.0
    row = drawn_stems.table(rows, excess).iloc[0]
    assert row["trees"] == 3
    assert row["worth_ratio"] == pytest.approx(39.0 / 40.0)
    assert row["tree_error"] == pytest.approx(0.15)  # of 0.2 and 0.1
    assert row["upper_excess_cm"] == pytest.approx(1.0)


def test_all_trees_of_a_run_are_bucked(dense_run: Run):
    logs = buck_run(dense_run, LAST, [Product.between("pulpwood", 2.0, 3.0, 5.0, 30.0)])
    trees = dense_run.read("trees", years=(LAST, LAST)).set_index("tree_id")
    by_tree = logs.groupby("tree_id")["volume_m3"].sum()
    assert (by_tree < trees.loc[by_tree.index, "stem_volume_m3"]).all()
    assert set(trees.index[trees["merchantable_volume_m3"] > 0.02]) <= set(by_tree.index)


def test_old_growth_of_the_last_year(dense_run: Run):
    target = reverse_j(1.3, 25.0, 30.0)
    table = old_growth.table(dense_run, target, 12.0)
    assert table["year"].tolist() == list(range(1964, LAST + 1, 5))
    trees = dense_run.read("trees", years=(LAST, LAST))
    last = table.iloc[-1]
    assert last["overlap"] == target.agreement(trees["dbh_cm"], 0.01).overlap
    assert last["gap_share"] == gap_share(trees, plot_of(dense_run.scenario), least_m2=5.0)
    assert last["big_ha"] == 100 * (trees["dbh_cm"] >= 12.0).sum() > 0
    assert table["overlap_g"].iloc[-1] > table["overlap_g"].iloc[0]
    events = dense_run.events
    died = events[events["kind"] == "died"]
    left = np.exp(-old_growth.DECAY_PER_YEAR * (LAST - died["year"]))
    assert last["dead_wood_m3ha"] == pytest.approx(100 * (died["volume_m3"] * left).sum(), rel=1e-6)
    assert last["dead_wood_m3ha"] > 0


def test_effective_layers_by_hand():
    assert old_growth.effective_layers([10.0, 9.5]) == pytest.approx(1.0)
    assert old_growth.effective_layers([10.0, 7.0, 2.0]) == pytest.approx(3.0)
