"""Trees that stand and do not grow: their shade and the markers they take against slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.environment.markers import MarkerSpace
from forest.environment.obstacles import Box
from forest.environment.standing import Standing, StandingLeaves, StandingSites, together
from tests.builders import random_arena
from tests.environment.test_exposure import (
    CANOPY,
    SHADOW,
    every_bud,
    make_light,
    make_stand,
    sites,
)
from tests.environment.test_markers import SIZE, SPACING, all_cells, as_rows, make_species
from tests.reference import markers as twin
from tests.reference.shadow import best_gradient, living_buds, shadow_field, wrapped
from tests.reference.standing import leaves_by_voxel, points_along, shade_sources

SHAPE = (16, 12)
VOXEL_M = 0.25


def some_leaves(seed: int, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Leaves in and around the plot, some of them low, some far above."""
    rng = np.random.default_rng(seed)
    low, high = (-1.0, -1.0, 0.0), (5.0, 4.0, rng.choice([1.5, 4.0]))
    return rng.uniform(low, high, (n, 3)), rng.uniform(0.0, 0.02, n)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_near_shade_equals_twin(seed: int, periodic: bool) -> None:
    metamers, trees = make_stand(seed)
    place, area = some_leaves(seed)
    light = make_light(periodic=periodic)
    light.expose(metamers, trees, None, StandingLeaves.at(place, area, VOXEL_M, 40.0))
    buds = living_buds(metamers, trees, VOXEL_M)
    factor = [1.0, 1.5]
    sources = [(v, factor[s]) for _, s, v in buds]
    sources += shade_sources(leaves_by_voxel(place, area, VOXEL_M), 40.0)
    weights = [SHADOW.a * SHADOW.b**-q for q in range(SHADOW.q_max + 1)]
    shadow = shadow_field(sources, weights, SHAPE, periodic)
    expected = {
        k: max(1.0 - shadow[wrapped(v, SHAPE, periodic)] + SHADOW.a * factor[s], 0.0)
        for k, s, v in buds
    }
    for k in sites(trees):
        assert metamers.light[k] == pytest.approx(expected.get(k, 0.0), rel=1e-5, abs=1e-6)
    shoots, _ = every_bud(metamers, trees)
    found = light.directions(metamers, trees, shoots)
    for n, (_, s, v) in list(enumerate(buds))[:4]:
        own = shadow_field([(v, -factor[s])], weights, SHAPE, periodic)
        others = shadow.copy()
        others.update(own)
        here = wrapped(v, SHAPE, periodic)
        np.testing.assert_allclose(
            found[n], best_gradient(others, here, SHAPE, periodic), rtol=1e-4, atol=1e-4
        )


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_far_shade_counts_every_leaf_once(seed: int, periodic: bool) -> None:
    metamers, trees = make_stand(seed)
    place, area = some_leaves(seed)
    light = make_light(canopy=CANOPY, periodic=periodic)
    light.expose(metamers, trees)
    assert light.canopy is not None
    alone = int(light.canopy.leaf.sum())
    leaves = StandingLeaves.at(place, area, VOXEL_M, 40.0)
    light.expose(metamers, trees, leaves.plant_area, leaves)
    by_voxel = leaves_by_voxel(place, area, VOXEL_M)
    added = sum(round(1e6 * one) for one in by_voxel.values())
    assert int(light.canopy.leaf.sum()) - alone == added
    assert leaves.area_mm2.sum() == added


def test_counts_saturate_beside_solids_and_other_trees() -> None:
    """Two trees of too many leaves in one voxel, and a wall: no count runs over."""
    metamers, trees = make_stand(3)
    one = StandingLeaves.at(np.full((5, 3), 0.3), np.full(5, 100.0), VOXEL_M, 400.0)
    both = together([Standing(one, None), Standing(one, None)])
    assert both is not None
    assert both.sites is None
    light = make_light(obstacles=[Box((0.25, 0.25, 0.0), (0.75, 0.5, 0.5))])
    light.expose(metamers, trees, None, both.leaves)
    grid = light._grid
    assert grid is not None
    assert grid.counts.max() == grid.limit
    assert together([]) is None


def test_of_trees_without_leaves_nothing_shades() -> None:
    metamers, trees = make_stand(4)
    light = make_light(canopy=CANOPY)
    light.expose(metamers, trees)
    before = metamers.light.copy()
    bare = StandingLeaves.at(np.zeros((0, 3)), np.zeros(0), VOXEL_M, 40.0)
    light.expose(metamers, trees, bare.plant_area, bare)
    assert np.array_equal(metamers.light, before)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**63 - 1), periodic=st.booleans(), release=st.booleans())
def test_markers_equal_the_twin(seed: int, periodic: bool, release: bool) -> None:
    """A standing point takes what lies around it and sees nothing; felled, it frees or does not."""
    rng = np.random.default_rng(seed)
    metamers, trees = random_arena(rng, 2, 5, size_m=SIZE, n_species=2)
    species = make_species(rng, 2)
    n = int(rng.integers(1, 8))
    standing = StandingSites(
        rng.uniform((-0.2, -0.2, 0.0), (*SIZE, 0.8), (n, 3)),
        rng.integers(0, 2, n),
        np.array([0.15, 0.35]),
    )
    space = MarkerSpace(seed, SPACING, SIZE, periodic, release)
    buds = twin.living_buds(metamers, trees)
    points = [
        {
            "place": tuple(place),
            "heading": (0.0, 0.0, 1.0),
            "species": 2 + int(kind),
            "rank": (10**9, k, 0),
        }
        for k, (place, kind) in enumerate(zip(standing.point, standing.kind, strict=True))
    ]
    rows = [*as_rows(species), (0.15, 0.0, 1.0), (0.35, 0.0, 1.0)]
    reach = max(max(row[:2]) for row in rows)
    cells = all_cells(space, [*buds, *points], reach, periodic) if buds else []
    markers = [twin.marker_of_cell(seed, *ijk, space.cell_m) for ijk in cells]
    size = SIZE if periodic else None
    taken, won, direction = twin.claim([*buds, *points], markers, rows, size)
    bare = StandingLeaves.at(np.zeros((0, 3)), np.zeros(0), VOXEL_M, 40.0)
    two = [
        Standing(bare, standing._replace(point=standing.point[k::2], kind=standing.kind[k::2]))
        for k in range(2)
    ]
    both = together(two)
    assert both is not None
    found = space.claim(metamers, trees, species, both.sites)
    assert found.found.tolist() == [len(w) for w in won[: len(buds)]]
    np.testing.assert_allclose(
        found.direction, np.array(direction[: len(buds)]).reshape(-1, 3), rtol=1e-5, atol=1e-5
    )
    left = [m for k, m in enumerate(markers) if release or k not in taken]
    _, won, _ = twin.claim(buds, left, as_rows(species), size)
    assert space.claim(metamers, trees, species).found.tolist() == [len(w) for w in won]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_points_stand_for_all_parts(seed: int) -> None:
    """Near every part of a tree is a point of its kind, which is a point of the tree."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 2.0, (6, 3))
    end = start + rng.uniform(-0.7, 0.7, (6, 3))
    thick = rng.choice([0.01, 0.12, 0.3], 6)
    leaves = rng.uniform(0.0, 2.0, (20, 3))
    found = StandingSites.along(start, end, thick, leaves, 0.2)
    radius = found.radius_m[found.kind]
    for a, b, r in zip(start, end, thick, strict=True):
        whole = 0.2 + 0.1 * round(r / 0.1)
        own = found.point[np.isclose(radius, whole)]
        for point in points_along(a[None], b[None], 0.1):
            assert np.linalg.norm(own - point, axis=1).min() <= 0.1 * math.sqrt(3.0)
    thin = found.point[np.isclose(radius, 0.2)]
    for leaf in leaves:
        assert np.linalg.norm(thin - leaf, axis=1).min() <= 0.1 * math.sqrt(3.0)
    parts = np.array([*points_along(start, end, 0.1), *leaves])
    for point in found.point:
        assert np.linalg.norm(parts - point, axis=1).min() < 1e-9
