"""Stem cones and crown shapes: closed, and as large as the trees' numbers say."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.view.tree_bodies import Bodies, tree_bodies


def frame(n: int = 1, **columns: object) -> pd.DataFrame:
    """Give `n` alike trees, changed by `columns`."""
    usual = {
        "tree_id": np.arange(1, n + 1),
        "species": "picea_abies",
        "x_m": 3.0,
        "y_m": 4.0,
        "height_m": 20.0,
        "dbh_cm": 24.0,
        "base_diameter_cm": 30.0,
        "crown_base_m": 8.0,
        "crown_radius_m": 2.0,
    }
    return pd.DataFrame(usual | columns, index=range(n))


def volume(bodies: Bodies, chosen: np.ndarray) -> float:
    """Volume within the triangles whose points are all chosen: Gauss's theorem."""
    corners = bodies.points.astype(np.float64)[bodies.triangles[chosen[bodies.triangles[:, 0]]]]
    return float(np.einsum("ij,ij", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def random_trees(seed: int, n: int) -> pd.DataFrame:
    """Trees of all sizes, some with numbers missing."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.01, 40.0, n)
    trees = frame(
        n,
        species=rng.choice(["picea_abies", "fagus_sylvatica"], n),
        x_m=rng.uniform(0.0, 50.0, n),
        y_m=rng.uniform(0.0, 50.0, n),
        height_m=height,
        base_diameter_cm=0.9 * height,
        dbh_cm=np.where(height > 1.3, 0.7 * height, np.nan),
        crown_base_m=height * rng.uniform(0.0, 1.0, n),
        crown_radius_m=rng.uniform(0.0, 4.0, n),
        lean_deg=rng.uniform(0.0, 30.0, n),
    )
    for column in ("base_diameter_cm", "crown_base_m", "crown_radius_m", "lean_deg", "height_m"):
        trees.loc[rng.random(n) < 0.1, column] = np.nan
    return trees


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 12), rings=st.integers(1, 6))
def test_every_body_is_closed_and_points_outwards(seed: int, n: int, rings: int) -> None:
    bodies = tree_bodies(random_trees(seed, n), crown_rings=rings, conifers=["picea_abies"])
    assert np.isfinite(bodies.points).all()
    assert len(bodies.tree) == len(bodies.crown) == len(bodies.points)
    edges = Counter(
        (int(a), int(b))
        for triangle in bodies.triangles
        for a, b in zip(triangle, np.roll(triangle, -1), strict=True)
    )
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    assert set(bodies.triangles.ravel().tolist()) == set(range(len(bodies.points)))
    for tree in range(n):
        for crown in (False, True):
            chosen = (bodies.tree == tree) & (bodies.crown == crown)
            if chosen.any():
                assert volume(bodies, chosen) > 0.0
    corners = bodies.triangles
    assert (bodies.tree[corners] == bodies.tree[corners[:, :1]]).all()
    assert (bodies.crown[corners] == bodies.crown[corners[:, :1]]).all()


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 12))
def test_bodies_keep_to_their_numbers(seed: int, n: int) -> None:
    trees = random_trees(seed, n).drop(columns="lean_deg")
    bodies = tree_bodies(trees, conifers=["picea_abies"])
    for tree, row in enumerate(trees.itertuples()):
        mine = bodies.tree == tree
        height = np.fmax(row.height_m, 0.05)
        stem, crown = (bodies.points[mine & (bodies.crown == c)] for c in (False, True))
        assert stem[:, 2].min() == 0.0
        assert stem[:, 2].max() == pytest.approx(height, rel=1e-5)
        has = row.crown_radius_m > 0.0 and np.fmax(row.crown_base_m, 0.0) < height
        assert bool(len(crown)) == has
        if not has:
            continue
        assert crown[:, 2].min() == pytest.approx(np.fmax(row.crown_base_m, 0.0), rel=1e-4)
        assert crown[:, 2].max() == pytest.approx(height, rel=1e-5)
        reach = np.hypot(crown[:, 0] - row.x_m, crown[:, 1] - row.y_m)
        assert reach.max() == pytest.approx(row.crown_radius_m, rel=1e-4, abs=1e-4)


def test_a_stem_is_as_thick_as_measured() -> None:
    bodies = tree_bodies(frame(), stem_sides=400)
    stem = bodies.points[~bodies.crown]
    reach = np.hypot(stem[:, 0] - 3.0, stem[:, 1] - 4.0)
    assert reach[np.isclose(stem[:, 2], 1.3)] == pytest.approx(0.12, rel=1e-4)
    assert reach[stem[:, 2] == 0.0].max() == pytest.approx(0.15, rel=1e-4)
    big, mid = np.pi * 0.15**2, np.pi * 0.12**2
    wanted = 1.3 / 3 * (big + mid + np.sqrt(big * mid)) + 18.7 / 3 * mid
    assert volume(bodies, ~bodies.crown) == pytest.approx(wanted, rel=1e-3)


def test_crowns_of_conifers_taper_and_those_of_others_are_round() -> None:
    trees = frame(2, species=["picea_abies", "fagus_sylvatica"])
    fine = tree_bodies(trees, crown_sides=200, crown_rings=99, conifers=["picea_abies"])
    cone, round_ = (volume(fine, fine.crown & (fine.tree == tree)) for tree in (0, 1))
    assert round_ == pytest.approx(4.0 / 3.0 * np.pi * 2.0**2 * 6.0, rel=1e-2)
    cylinder = np.pi * 2.0**2 * 12.0
    assert cylinder / 3 < cone < 0.45 * cylinder
    cone_points = fine.points[fine.crown & (fine.tree == 0)]
    reach = np.hypot(cone_points[:, 0] - 3.0, cone_points[:, 1] - 4.0)
    assert cone_points[reach.argmax(), 2] < 8.0 + 0.2 * 12.0


def test_seedlings_have_bodies_too() -> None:
    bodies = tree_bodies(
        frame(
            height_m=0.4,
            dbh_cm=np.nan,
            base_diameter_cm=0.8,
            crown_base_m=0.1,
            crown_radius_m=0.15,
        )
    )
    assert bodies.points[:, 2].max() == pytest.approx(0.4)
    assert bodies.crown.any() and not bodies.crown.all()


def test_a_leaning_tree_has_its_top_aside() -> None:
    trees = frame(3, lean_deg=[0.0, 20.0, np.nan])
    bodies = tree_bodies(trees)
    for tree, offset in ((0, 0.0), (1, 20.0 * np.tan(np.radians(20.0))), (2, 0.0)):
        mine = bodies.points[bodies.tree == tree]
        top = mine[mine[:, 2].argmax()]
        assert np.hypot(top[0] - 3.0, top[1] - 4.0) == pytest.approx(offset, abs=1e-4)
        assert top[2] == pytest.approx(20.0)


def test_no_trees_no_bodies() -> None:
    bodies = tree_bodies(frame(0))
    assert bodies.points.shape == (0, 3) and bodies.points.dtype == np.float32
    assert bodies.triangles.shape == (0, 3) and bodies.triangles.dtype == np.int32
    assert bodies.tree.dtype == np.int32 and bodies.crown.dtype == np.bool_
    bare = tree_bodies(frame(2, crown_radius_m=0.0))
    assert not bare.crown.any()
