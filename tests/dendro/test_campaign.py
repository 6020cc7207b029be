"""The dominant trees of a stand, bored from two sides; ages told apart."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from forest.dendro import ages, campaign
from forest.errors import InputError

from .ringing import ring_frame


def stand() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Four trees over ten years; the third is the thickest, the second the highest."""
    first = {1: 2001, 2: 2002, 3: 2001, 4: 2004}
    width = {1: 2.0, 2: 3.0, 3: 4.0, 4: 1.0}
    rings = pd.concat([ring_frame(t, first[t], [width[t]] * (2011 - first[t])) for t in first])
    rows = [(y, t) for y in range(2000, 2011) for t in first]
    trees = pd.DataFrame(rows, columns=["year", "tree_id"])
    trees["age"] = (trees["year"] - 1998).astype("int32")
    trees["status"] = pd.Categorical(["living"] * len(trees))
    trees["dbh_cm"] = 0.2 * trees["tree_id"].map(width) * (trees["year"] - 2000)
    trees["height_m"] = trees["tree_id"].map({1: 8.0, 2: 12.0, 3: 9.0, 4: 5.0})
    return rings, trees


def test_who_is_bored():
    rings, trees = stand()
    by_dbh = campaign(rings, trees, year=2008, n_trees=2).about
    assert by_dbh["tree_id"].tolist() == [3, 3, 2, 2]
    by_height = campaign(rings, trees, year=2008, n_trees=2, by="height_m").about
    assert by_height["tree_id"].tolist() == [2, 2, 3, 3]
    assert list(by_dbh.index) == ["T3A", "T3B", "T2A", "T2B"]


def test_two_opposite_radii_up_to_the_year_of_the_campaign():
    rings, trees = stand()
    taken = campaign(rings, trees, year=2008, n_trees=1, aim_sd_deg=0.0)
    a, b = taken.about["azimuth_deg"]
    assert (b - a) % 360.0 == pytest.approx(180.0)
    assert taken.about["last_year"].tolist() == [2008, 2008]
    assert (taken.widths == 4.0).all(axis=None)
    assert len(taken.widths) == 8


def test_the_mean_of_opposite_radii_of_an_eccentric_stem():
    rings, trees = stand()
    rings["eccentricity"], rings["thick_side_deg"] = 0.1, 200.0
    taken = campaign(rings, trees, year=2010, n_trees=2, aim_sd_deg=0.0).widths
    for tree, width in ((3, 4.0), (2, 3.0)):
        pair = taken[[f"T{tree}A", f"T{tree}B"]]
        assert pair.mean(axis=1).dropna().to_numpy() == pytest.approx(width, rel=0.01)
        assert pair.std(axis=1).max() > 0.01


def test_same_seed_same_campaign():
    rings, trees = stand()
    one, again, other = (campaign(rings, trees, year=2010, n_trees=4, seed=s) for s in (1, 1, 2))
    assert_frame_equal(one.widths, again.widths)
    assert_frame_equal(one.about, again.about)
    assert not np.array_equal(one.about["azimuth_deg"], other.about["azimuth_deg"])


def at_breast(rings: pd.DataFrame) -> pd.DataFrame:
    """The rings at 1.3 m."""
    return rings[(rings["place"] == "height") & np.isclose(rings["stem_height_m"], 1.3)]


def test_a_run_keeps_its_own_words(noisy_run):
    year = int(noisy_run.years[-1])
    taken = campaign(noisy_run.rings, noisy_run.trees, year=year, n_trees=3)
    now = noisy_run.trees[noisy_run.trees["year"] == year].set_index("tree_id")
    thickest = now["dbh_cm"].nlargest(3).index.tolist()
    assert taken.about["tree_id"].drop_duplicates().tolist() == thickest
    under_bark = at_breast(noisy_run.rings).groupby("tree_id")["width_mm"].sum()
    for row in taken.about[taken.about["miss_mm"] == 0.0].itertuples():
        assert taken.widths[row.Index].sum() == pytest.approx(under_bark[row.tree_id], rel=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"year": 2020}, "no tree lives in 2020; expected a year from 2000 to 2010"),
        ({"n_trees": 5}, "5 trees asked for; expected at most 4, which in 2010"),
        ({"n_trees": 0}, "n_trees is 0"),
        ({"by": "age"}, "by is 'age'"),
        ({"stem_height_m": 9.0}, "at most 0, which in 2010 have rings at 9 m"),
    ],
)
def test_refused(change, message):
    rings, trees = stand()
    with pytest.raises(InputError, match=message):
        campaign(rings, trees, **{"year": 2010} | change)


def test_ages_by_hand():
    rings, trees = stand()
    table = ages(rings, trees).set_index("tree_id")
    assert table.loc[2, "age_at_seed"] == 12  # planted in 1999
    assert table.loc[2, "age_at_height"] == 9  # rings of 2002 to 2010
    assert table.loc[2, "years_to_height"] == 3
    assert table["years_to_height"].tolist() == [2, 3, 2, 5]


def test_ages_in_a_run(noisy_run):
    rings = at_breast(noisy_run.rings)
    table = ages(rings, noisy_run.trees)
    counts = rings.groupby("tree_id").size()
    assert table.set_index("tree_id")["age_at_height"].tolist() == counts.tolist()
    trees = noisy_run.trees
    for row in table.itertuples():
        below = trees[(trees["tree_id"] == row.tree_id) & trees["ring_width_mm"].isna()]
        assert row.years_to_height == len(below)


def test_a_ring_of_no_known_tree():
    rings, trees = stand()
    with pytest.raises(InputError, match="tree 2 has a ring of 2010 but no row"):
        ages(rings, trees[trees["tree_id"] != 2])
