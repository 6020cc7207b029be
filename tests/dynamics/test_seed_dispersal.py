"""Seeds: how many trees bear, where they fall, and whose seedlings they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from forest._threads import using_threads
from forest.dynamics.regeneration.cells import Cells
from forest.dynamics.regeneration.dispersal import (
    Dispersal,
    draw_mothers,
    kernel_density,
    kernel_table,
    near_distance,
)
from forest.dynamics.regeneration.fecundity import mast_factors, seeds_borne
from forest.species import load_species
from tests.dynamics.seedling_cases import NAMES, SHIPPED, code
from tests.reference import regeneration as slow

KERNELS = st.tuples(
    st.sampled_from(["lognormal", "2dt"]), st.floats(2.0, 20.0), st.floats(0.7, 2.0)
)


def _within(kernel: tuple[str, float, float], low: float, high: float) -> float:
    """Seeds between two distances, over their logarithm."""

    def ring(log_r: float) -> float:
        r = np.array(np.exp(log_r))
        return float(2 * np.pi * r * r * kernel_density(*kernel, r))

    return quad(ring, np.log(low), np.log(high), limit=400)[0]


@settings(max_examples=25, deadline=None)
@given(KERNELS)
def test_a_kernel_holds_one_seed(kernel: tuple[str, float, float]) -> None:
    # far enough for the fattest tail, in a logarithm
    assert _within(kernel, 1e-5, kernel[1] * 1e7) == pytest.approx(1.0, abs=1e-3)
    assert _within(kernel, 1e-5, near_distance(*kernel)) == pytest.approx(0.98, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_shipped_kernels_hold_one_seed(name: str) -> None:
    s = load_species(name).regeneration
    kernel = s.kernel, s.kernel_distance_m, s.kernel_shape
    assert _within(kernel, 1e-5, s.kernel_distance_m * 1e7) == pytest.approx(1.0, abs=1e-3)


def test_the_median_is_the_median() -> None:
    assert _within(("lognormal", 12.0, 0.9), 1e-4, 12.0) == pytest.approx(0.5, abs=1e-6)
    assert _within(("2dt", 12.0, 1.0), 1e-6, 12.0) == pytest.approx(0.5, abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(KERNELS, st.integers(1, 9), st.integers(1, 9), st.floats(0.5, 3.0), st.integers(0, 99))
def test_no_seed_is_lost_on_a_torus(
    kernel: tuple[str, float, float], nx: int, ny: int, edge: float, seed: int
) -> None:
    cells = Cells.over((nx * edge, ny * edge), edge, periodic=True)
    borne = np.random.default_rng(seed).uniform(0.0, 1000.0, cells.count)
    fallen = Dispersal(*kernel, cells).fall(borne)
    assert fallen.sum() == pytest.approx(borne.sum(), rel=1e-9)
    assert (fallen >= 0.0).all()
    open_cells = Cells.over((nx * edge, ny * edge), edge, periodic=False)
    stay = Dispersal(*kernel, open_cells).fall(borne)
    assert stay.sum() <= borne.sum() * (1 + 1e-9)
    assert (stay <= fallen * 1.05 + 1e-9).all()  # what leaves does not come in again


@pytest.mark.parametrize("kernel", [("lognormal", 3.0, 0.8), ("2dt", 4.0, 2.0)])
@pytest.mark.parametrize("periodic", [True, False])
def test_seeds_fall_as_tree_by_tree(kernel: tuple[str, float, float], periodic: bool) -> None:
    size = 12.0, 9.0
    cells = Cells.over(size, 1.0, periodic)
    mothers = {3: 100.0, 40: 5.0, 107: 30.0}
    borne = np.zeros(cells.count)
    for cell, seeds in mothers.items():
        borne[cell] = seeds
    fallen = Dispersal(*kernel, cells).fall(borne)
    for cell in (0, 3, 17, 55, 107):
        y, x = divmod(cell, cells.nx)
        expected = sum(
            seeds
            * slow.seeds_in_cell(
                kernel,
                size,
                (x, y, 1.0, 1.0),
                (mother % cells.nx + 0.5, mother // cells.nx + 0.5),
                images=4 if periodic else 0,
            )
            for mother, seeds in mothers.items()
        )
        assert fallen[cell] == pytest.approx(expected, rel=0.03)


def test_the_table_is_that_of_the_ways() -> None:
    """Seeds wrap: the way back is as long as the way there."""
    table = kernel_table("lognormal", 4.0, 0.8, Cells.over((10.0, 6.0), 1.0, True))
    assert table == pytest.approx(np.roll(table[::-1, ::-1], (1, 1), (0, 1)))
    assert table.sum() == pytest.approx(1.0)


def test_mothers_are_drawn_by_their_seeds() -> None:
    cells = Cells.over((20.0, 20.0), 1.0, True)
    table = kernel_table("lognormal", 5.0, 0.8, cells)
    at, borne = np.array([0, 210, 399, 5]), np.array([100.0, 300.0, 50.0, 0.0])
    rain = 0.3
    where, count = 195, np.zeros(5)

    def weight(tree: int) -> float:
        dy, dx = (where // 20 - at[tree] // 20) % 20, (where % 20 - at[tree] % 20) % 20
        return float(borne[tree] * table[dy, dx])

    weights = np.array([weight(0), weight(1), weight(2), 0.0, rain])
    for year in range(4000):
        key = {"seed": 1, "kind": 0, "year": year}
        seeds = np.array([weights.sum()])
        count[draw_mothers(np.array([where]), seeds, cells, table, at, borne, **key)[0]] += 1
    assert count[3] == 0
    assert count / 4000 == pytest.approx(weights / weights.sum(), abs=0.035)


def test_mothers_are_the_same_on_threads() -> None:
    cells = Cells.over((30.0, 30.0), 1.0, True)
    table = kernel_table("2dt", 5.0, 1.0, cells)
    rng = np.random.default_rng(3)
    at, borne = rng.integers(0, 900, 40), rng.uniform(0, 100, 40)
    seeds = Dispersal("2dt", 5.0, 1.0, cells).fall(cells.sum(at, borne)) + 0.5
    found = []
    for threads in (1, 2):
        with using_threads(threads):
            found.append(
                draw_mothers(
                    np.arange(900), seeds, cells, table, at, borne, seed=1, kind=0, year=2000
                )
            )
    np.testing.assert_array_equal(*found)
    assert len(np.unique(found[0])) > 20


def test_size_and_light_make_seeds() -> None:
    of, beech = SHIPPED.seed, code("fagus_sylvatica")
    kind = np.full(6, beech)
    ripe = of.maturity_height_m[beech]
    height = np.array([ripe - 0.01, ripe, ripe, ripe, ripe, ripe])
    leaves = np.array([500.0, 100.0, 200.0, 100.0, 100.0, 0.0])
    light = np.array([1.0, 1.0, 1.0, 0.3, 0.0, np.nan])
    seeds = seeds_borne(kind, height, leaves, light, of)
    assert seeds[0] == 0.0  # immature
    assert seeds[1] == pytest.approx(100.0 * of.seeds_per_leaf_m2[beech])
    assert seeds[2] == 2 * seeds[1]
    assert 0.0 < seeds[3] < seeds[1]
    assert (seeds[4:] == 0.0).all()


def test_mast_years() -> None:
    """In the mean of years the factor is 1, and mast years come at their interval."""
    factors = np.array([mast_factors(5, year, SHIPPED.seed) for year in range(4000)])
    assert factors.mean(axis=0) == pytest.approx(1.0, abs=0.15)
    for kind, interval in enumerate(SHIPPED.seed.mast_interval_years):
        mast = factors[:, kind] > 1.0
        assert mast.mean() == pytest.approx(1.0 / interval, abs=0.04)
        assert len(np.unique(factors[:, kind])) == 2
    beech, oak = (factors[:, code(name)] > 1.0 for name in ("fagus_sylvatica", "quercus_robur"))
    assert abs(np.corrcoef(beech, oak)[0, 1]) < 0.1
