"""Feature maps, and trees spread over them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.distance import pdist

from forest.errors import InputError
from forest.surface.feature_map import (
    FeatureMap,
    Spreading,
    _Room,
    _settle,
    asked_for,
    read_feature_map,
    spread,
)

SEEDS = st.integers(0, 2**32 - 1)


def random_map(seed: int, cell_m: float = 4.0) -> FeatureMap:
    rng = np.random.default_rng(seed)
    bits = rng.integers(0, 1 << 16, (6, 9)).astype(np.uint16)
    return FeatureMap(bits, cell_m, (-10.0, 5.0))


@given(seed=SEEDS, bit=st.integers(0, 13), distance=st.sampled_from([0.0, 1.0, 3.0]))
@settings(max_examples=25, deadline=None)
def test_trees_stand_only_where_their_bit_is_set(seed: int, bit: int, distance: float) -> None:
    features = random_map(seed)
    kinds = [Spreading(bit, 400.0, 3, (0.5, 1.5), distance), Spreading(0, 100.0)]
    trees = spread(features, kinds, seed)
    asked = 400.0 * features.bears(bit).sum() * features.cell_m**2 / 1e4
    mine = trees.kind == 0
    assert mine.sum() <= round(asked)
    if distance == 0.0:
        assert mine.sum() == round(asked)
    set_there = (features.at(trees.x, trees.y) >> np.where(mine, bit, 0)) & 1
    assert set_there.all()
    assert np.all((trees.scale[mine] >= 0.5) & (trees.scale[mine] <= 1.5))
    assert np.all(trees.scale[~mine] == 1.0)
    assert set(trees.variant[mine]) <= {0, 1, 2} and not trees.variant[~mine].any()
    if mine.sum() > 1:
        assert pdist(np.column_stack((trees.x, trees.y))[mine]).min() >= distance


def test_kinds_draw_numbers_of_their_own() -> None:
    features = random_map(3)
    one = spread(features, [Spreading(2, 300.0), Spreading(5, 300.0)], 1)
    other = spread(features, [Spreading(2, 50.0), Spreading(5, 300.0)], 1)
    np.testing.assert_array_equal(one.x[one.kind == 1], other.x[other.kind == 1])
    again = spread(features, [Spreading(2, 300.0), Spreading(5, 300.0)], 2)
    assert not np.array_equal(one.x, again.x)


def test_trees_cover_their_cells_evenly() -> None:
    bits = np.zeros((2, 2), np.uint16)
    bits[0, 1] = 1 << 7  # the north-east cell
    trees = spread(FeatureMap(bits, 100.0), [Spreading(7, 1000.0, 4)], 5)
    assert len(trees.x) == 1000
    assert (trees.x > 100.0).all() and (trees.y > 100.0).all()
    quarters = np.bincount(2 * (trees.x > 150.0) + (trees.y > 150.0), minlength=4)
    assert quarters.min() > 200 and quarters.max() < 300
    assert np.bincount(trees.variant, minlength=4).min() > 200


def test_nowhere_no_trees() -> None:
    empty = FeatureMap(np.zeros((3, 3), np.uint16))
    assert len(spread(empty, [Spreading(0, 1e5)], 0).x) == 0
    assert len(spread(empty, [], 0).x) == 0
    with pytest.raises(InputError, match="at most"):
        spread(FeatureMap(np.ones((3, 3), np.uint16), 1e4), [Spreading(0, 1e5)], 0)


def test_bits_and_files(tmp_path: Path) -> None:
    bits = np.array([[1 << 14, 3 << 14 | 1], [2 << 14 | 1 << 13, 0]], np.uint16)
    Image.fromarray(bits).save(tmp_path / "m.png")
    Image.fromarray(bits).save(tmp_path / "m.tif")
    np.save(tmp_path / "m.npy", bits)
    for name in ("m.png", "m.tif", "m.npy"):
        read = read_feature_map(tmp_path / name, cell_m=2.0)
        np.testing.assert_array_equal(read.bits, bits)
    assert read.grass.tolist() == [[1, 3], [2, 0]]
    assert read.bears(13).tolist() == [[False, False], [True, False]]
    # Row 0 is the north edge; beyond the map there is nothing.
    assert read.grass_at([1.0, 3.0, 1.0, -1.0], [3.0, 3.0, 1.0, 1.0]).tolist() == [1, 3, 2, 0]


def test_bad_maps_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "real.npy", np.zeros((2, 2)))
    np.save(tmp_path / "big.npy", np.full((2, 2), 70000))
    np.save(tmp_path / "flat.npy", np.zeros(4, np.int64))
    for name in ("real.npy", "big.npy", "flat.npy", "map.jpg", "missing.png"):
        with pytest.raises(InputError, match=name.replace(".", r"\.")):
            read_feature_map(tmp_path / name)


@given(seed=SEEDS, count=st.integers(0, 60), distance=st.sampled_from([0.01, 1.0, 4.0, 50.0]))
@settings(max_examples=25, deadline=None)
def test_spots_are_taken_one_after_the_other(seed: int, count: int, distance: float) -> None:
    """As if each tree were compared with all before it that found room."""
    size = (30.0, 11.0)
    spots = np.random.default_rng(seed).uniform(0.0, 1.0, (count, 2)) * size
    taken: list[np.ndarray] = []
    expected = []
    for spot in spots:
        expected.append(all(np.sqrt(np.sum((spot - one) ** 2)) >= distance for one in taken))
        if expected[-1]:
            taken.append(spot)
    room, free = _Room.of(size, distance, count), np.zeros(count, np.bool_)
    trees = np.arange(count, dtype=np.int32)
    half = count // 2
    for part in (slice(0, half), slice(half, count)):
        x, y = (np.ascontiguousarray(column) for column in spots[part].T)
        _settle(room, trees[part], x, y, free[part])
    assert free.tolist() == expected


def test_what_is_asked_for_is_counted() -> None:
    bits = np.array([[1, 0], [1, 2]], np.uint16)
    assert asked_for(FeatureMap(bits, 10.0), Spreading(0, 333.0)) == round(333.0 * 200.0 / 1e4)
