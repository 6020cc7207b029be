"""The near field against its slow twin, and its symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.environment.light_grid import ShadowGrid, propagate
from tests.reference.shadow import shadow_field

SHAPE = (9, 40)


def make_grid(*, periodic: bool, b: float = 2.0, q_max: int = 3, a: float = 0.05) -> ShadowGrid:
    return ShadowGrid(SHAPE, periodic=periodic, a=a, b=b, q_max=q_max, full_light=1.0)


def fill(grid: ShadowGrid, voxels: np.ndarray, counts: np.ndarray) -> None:
    grid.clear(voxels.min(axis=0), voxels.max(axis=0))
    x, y, z = (voxels - grid.origin).T
    np.add.at(grid.counts, (z, y, x), counts.astype(np.uint16))
    propagate(grid.field)


def as_shadow(grid: ShadowGrid) -> dict[tuple[int, int, int], int]:
    """The grid's nonzero shadows by voxel, in its own units."""
    first, last = grid.field.layers
    layers = grid.shadow[first:last]
    return {
        (int(x + grid.origin[0]), int(y + grid.origin[1]), int(z + first + grid.origin[2])): int(
            layers[z, y, x]
        )
        for z, y, x in np.argwhere(layers)
    }


sources = st.lists(
    st.tuples(
        st.integers(0, SHAPE[0] - 1),
        st.integers(0, SHAPE[1] - 1),
        st.integers(0, 9),
        st.integers(1, 40),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=30, deadline=None)
@given(sources, st.booleans(), st.integers(0, 5), st.sampled_from([1.3, 2.0]))
def test_equals_twin(listed, periodic, q_max, b):
    grid = make_grid(periodic=periodic, q_max=q_max, b=b)
    data = np.array(listed)
    fill(grid, data[:, :3], data[:, 3])
    twin = shadow_field(
        [((x, y, z), n) for x, y, z, n in listed],
        [int(w) for w in grid.weights],
        SHAPE,
        periodic,
    )
    assert as_shadow(grid) == {v: s for v, s in twin.items() if s}


@pytest.mark.parametrize("b", [1.2, 1.5, 2.0, 3.0])
def test_weights_are_the_papers(b):
    grid = make_grid(periodic=True, b=b, q_max=6)
    shadow = grid.weights * 16 * grid.unit
    # Weights are whole numbers: exact for b = 2, else to half of the smallest step.
    assert shadow == pytest.approx(0.05 * b ** -np.arange(7.0), rel=4e-3)
    assert shadow[0] == 0.05
    if b == 2.0:
        assert np.array_equal(shadow, 0.05 * 2.0 ** -np.arange(7))


def test_full_grid_does_not_overflow():
    grid = make_grid(periodic=True, q_max=6, b=1.1)
    grid.clear(np.zeros(3, np.int64), np.array([8, 39, 20]))
    grid.counts[...] = grid.limit
    propagate(grid.field)
    first, last = grid.field.layers
    assert grid.shadow[first:last].min() > 0
    assert grid.shadow.max() == grid.limit * np.sum(
        (2 * np.arange(7) + 1) ** 2 * grid.weights.astype(np.int64)
    )


def test_same_bits_for_any_thread_count():
    rng = np.random.default_rng(3)
    voxels = np.column_stack(
        (rng.integers(0, 9, 300), rng.integers(0, 40, 300), rng.integers(0, 9, 300))
    )
    fields = []
    for n in (1, 2):
        with using_threads(n):
            grid = make_grid(periodic=True)
            fill(grid, voxels, np.full(300, 16))
            fields.append(grid.shadow.copy())
    assert np.array_equal(*fields)


def test_buffers_are_kept_and_grow_in_steps():
    grid = make_grid(periodic=False)
    fill(grid, np.array([[0, 0, 5]]), np.array([16]))
    before = grid.counts
    fill(grid, np.array([[1, 1, 4]]), np.array([16]))
    assert grid.counts is before
    weights = [int(w) for w in grid.weights]
    assert as_shadow(grid) == dict(shadow_field([((1, 1, 4), 16)], weights, SHAPE, False))
    fill(grid, np.array([[60, 0, 5]]), np.array([16]))
    assert grid.counts.shape[2] % 16 == 0
