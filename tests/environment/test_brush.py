"""Markers of strokes against their slow twin: places, density, parts, symmetry, dormant buds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from forest.environment.brush import PER_METRE, Pieces, cut_path, lay_markers, within_piece
from forest.environment.dormant import BOTH, LATERAL_ALONE, TERMINAL_ALONE, Hold, dormant_buds
from forest.environment.marker_buds import list_buds
from forest.environment.symmetry import mirror, shifts_of, turn, unite
from forest.trees.metamers import MAIN
from tests.builders import random_arena
from tests.reference import brush as twin
from tests.reference import markers as marker_twin


def a_stroke(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    n = int(rng.integers(1, 5))
    points = rng.uniform((-0.6, -0.6, -0.2), (0.6, 0.6, 1.0), (n, 3))
    if n > 2 and rng.random() < 0.3:
        points[1] = points[0]  # the brush stays and its pressure changes
    return points, rng.uniform(0.03, 0.4, n)


@settings(max_examples=15)
@given(seed=st.integers(0, 2**63 - 1), number=st.integers(1, 2**40))
def test_markers_equal_the_twin(seed: int, number: int) -> None:
    """One marker per cell, where the spheres hold it, above the ground; each exactly once."""
    rng = np.random.default_rng(seed)
    points, radius = a_stroke(rng)
    spacing = float(rng.uniform(0.12, 0.3))
    found, _ = lay_markers(cut_path(points, radius, 1, spacing), spacing, seed, number)
    rows = {tuple(p) for p in found.tolist()}
    assert len(rows) == len(found)
    path = [tuple(p) for p in points.tolist()]
    wide = radius.max() + spacing
    low = np.floor((points.min(axis=0) - wide) / spacing).astype(int)
    high = np.floor((points.max(axis=0) + wide) / spacing).astype(int)
    low[2] = max(low[2], 0)
    for cell in itertools.product(*(range(a, b + 1) for a, b in zip(low, high, strict=True))):
        marker = twin.marker_of_cell(seed, number, cell, spacing)
        if marker in rows:
            rows.remove(marker)
            # spheres are infinitely many, the twin's are not: it may miss one by a hair
            assert twin.distance_beyond(marker, path, radius.tolist(), 400) < 2e-3
        else:
            assert twin.distance_beyond(marker, path, radius.tolist(), 40) > 0.0
    assert not rows


def test_every_marker_lies_in_a_sphere_and_the_grid() -> None:
    points = np.array([[0.0, 0.0, 1.0], [1.0, 0.2, 1.4], [1.2, 1.1, 0.9]])
    pieces = cut_path(points, np.array([0.3, 0.1, 0.5]), 4, 0.05)
    found, part = lay_markers(pieces, 0.05, 3, 1)
    for marker, own in zip(found[::7], part[::7], strict=True):
        held = [k for s, k in enumerate(pieces.part) if within_piece(pieces, np.int64(s), *marker)]
        assert own == min(held)
    np.testing.assert_array_equal(found * PER_METRE, np.rint(found * PER_METRE))
    assert np.all(np.diff(part) >= 0) and set(part) == {0, 1, 2, 3}


@pytest.mark.parametrize("spacing", [0.03, 0.05])
def test_density_is_one_marker_per_cell(spacing: float) -> None:
    """A sphere of 0.5 m and a cylinder with two ends; cells at the rim vary."""
    for points, volume in (
        ([[0.0, 0.0, 1.0]], 4 / 3 * np.pi * 0.5**3),
        ([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]], 4 / 3 * np.pi * 0.5**3 + np.pi * 0.5**2 * 2.0),
    ):
        path = np.array(points)
        counts = [
            len(lay_markers(cut_path(path, np.full(len(path), 0.5), 1, spacing), spacing, 1, k)[0])
            for k in range(1, 9)
        ]
        expected = volume / spacing**3
        assert abs(np.mean(counts) - expected) < 4 * np.sqrt(expected) / np.sqrt(8)
        assert len(set(counts)) > 1  # each stroke draws its own


def test_a_dense_path_lays_each_cell_once() -> None:
    """Points of a pen come close together: the set is that of the straight line."""
    ends = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    dense = np.column_stack((np.linspace(0, 1, 65), np.zeros(65), np.ones(65)))
    coarse, _ = lay_markers(cut_path(ends, np.full(2, 0.25), 1, 0.1), 0.1, 5, 2)
    fine, _ = lay_markers(cut_path(dense, np.full(65, 0.25), 1, 0.1), 0.1, 5, 2)
    assert {tuple(p) for p in coarse.tolist()} == {tuple(p) for p in fine.tolist()}


def test_parts_are_equally_long() -> None:
    pieces = cut_path(np.array([[0.0, 0, 1], [3.0, 0, 1]]), np.full(2, 0.2), 6, 0.1)
    length = np.linalg.norm(pieces.end - pieces.start, axis=1)
    np.testing.assert_allclose(np.bincount(pieces.part, length), 0.5)
    assert isinstance(pieces, Pieces)


# --- symmetry -------------------------------------------------------------------------------


def laid(number: int = 1) -> tuple[np.ndarray, np.ndarray]:
    points = np.array([[3.1, 2.2, 0.3], [3.7, 2.9, 1.1]])
    return lay_markers(cut_path(points, np.array([0.2, 0.4]), 3, 0.1), 0.1, 8, number)


def as_set(points: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(p) for p in points.tolist()}


X, Y = 3.0123456789, 2.9876543211  # on no grid


@pytest.mark.parametrize("normal", [0, 45, 90, 135, 180, -45, 270, 360])
def test_mirrors_are_exact(normal: float) -> None:
    points, part = laid()
    image = mirror(points, X, Y, normal)
    np.testing.assert_array_equal(mirror(image, X, Y, normal), points)
    whole, _ = unite([points, image], part)
    assert as_set(mirror(whole, X, Y, normal)) == as_set(whole)
    assert len(whole) > len(points)
    # and it is a mirror: distances to the plane's points stay, the normal part is reversed
    n = np.array([np.cos(np.radians(normal)), np.sin(np.radians(normal))])
    before, after = points[:, :2] - [X, Y], image[:, :2] - [X, Y]
    np.testing.assert_allclose(after @ n, -(before @ n), atol=4e-6)
    np.testing.assert_allclose(after @ [-n[1], n[0]], before @ [-n[1], n[0]], atol=4e-6)


@pytest.mark.parametrize("times", [2, 3, 4, 5, 6, 8, 12])
def test_turns(times: int) -> None:
    """Quarter and half turns are exact, others to two micrometres."""
    points, part = laid()
    turned = [turn(points, X, Y, times, k) for k in range(times)]
    whole, parts = unite(turned, part)
    for k, image in enumerate(turned):
        angle = 2 * np.pi * k / times
        c, s = np.cos(angle), np.sin(angle)
        away = (points[:, :2] - [X, Y]) @ np.array([[c, s], [-s, c]])
        np.testing.assert_allclose(image[:, :2] - [X, Y], away, atol=4e-6)
    exact = 4 if times % 4 == 0 else 2 if times % 2 == 0 else 1
    for k in range(exact):
        assert as_set(turn(whole, X, Y, exact, k) if exact > 1 else whole) == as_set(whole)
    again = turn(whole, X, Y, times, 1)
    assert len(again) == len(whole) == times * len(points)
    assert len(parts) == len(whole)
    if exact == times:
        np.testing.assert_array_equal(np.unique(whole, axis=0), np.unique(again, axis=0))
    else:
        away, _ = cKDTree(again).query(whole, p=np.inf)
        assert away.max() <= 2e-6


def test_tilings_are_exact() -> None:
    points, part = laid()
    shifts = shifts_of([[0.7, 0.1, 0.0], [0.0, 0.0, 1.3]], [3, 2])
    assert len(shifts) == 6
    whole, _ = unite([points + shift for shift in shifts], part)
    everything = as_set(whole)
    for shift in shifts:
        assert as_set(points + shift) <= everything
        np.testing.assert_array_equal((points + shift) - shift, points)


def test_markers_on_the_mirror_are_laid_once() -> None:
    points = np.array([[1.0, 2.0, 3.0], [1.5, 2.0, 3.0]])
    whole, parts = unite([points, mirror(points, 1.0, 0.0, 0.0)], np.array([2, 1]))
    assert as_set(whole) == {(1.0, 2.0, 3.0), (1.5, 2.0, 3.0), (0.5, 2.0, 3.0)}
    assert parts.tolist() == [1, 1, 2]


# --- dormant buds ---------------------------------------------------------------------------


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_dormant_buds_equal_the_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    metamers, trees = random_arena(rng, 3, 25)
    buds = list_buds(metamers, trees)
    row = int(rng.integers(0, 3))
    here = slice(int(trees.start[row]), int(trees.start[row] + trees.size[row]))
    serials = metamers.serial[here]
    words = {BOTH: None, TERMINAL_ALONE: "terminal", LATERAL_ALONE: "lateral"}
    holds = [
        Hold(int(trees.tree_id[row]), int(rng.choice(serials)), int(rng.integers(0, 3)))
        for _ in range(int(rng.integers(1, 3)))
    ]
    found = dormant_buds(buds, metamers, trees, holds)
    all_buds = marker_twin.living_buds(metamers, trees)
    own = [b for b in all_buds if b["row"] == row]
    parents, main = metamers.parent[here].tolist(), (metamers.state[here] & MAIN != 0).tolist()
    each = [
        twin.dormant(own, parents, main, serials.tolist(), (hold.metamer, words[hold.bud]))
        for hold in holds
    ]
    expected = iter(np.all(each, axis=0).tolist())
    assert found.tolist() == [next(expected) if b["row"] == row else False for b in all_buds]
