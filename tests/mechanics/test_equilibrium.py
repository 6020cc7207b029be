"""The equilibrium of random trees against relaxation, and what holds of any tree of rods."""

from __future__ import annotations

import copy

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest._threads import using_threads
from forest.mechanics.equilibrium import settle_tree
from forest.mechanics.work import COLUMNS, STEP, TURN, Chain
from tests.mechanics.rod_cases import Case, chain, random_case, settled, tips
from tests.reference import rods as slow

seeds = st.integers(0, 2**32 - 1)


def _slow_rods(case: Case, row: int = 0) -> list[slow.Rod]:
    s = int(case.trees.start[row])
    rods = []
    for i in range(s, s + int(case.trees.size[row])):
        weight, wind = case.loads.weight[i].astype(float), case.loads.wind[i].astype(float)
        rods.append(
            slow.Rod(
                int(case.arena.parent[i]),
                float(case.arena.length[i]),
                slow.matrix(case.rods.joint[i]),
                case.rods.rest[i].astype(float),
                case.rods.rigidity[i].astype(float),
                np.array([wind[0], wind[1], -weight[0]]),
                np.array([0.0, 0.0, -weight[1]]),
            )
        )
    return rods


def _extents(case: Case) -> list[tuple[int, int]]:
    return list(zip(case.trees.start.tolist(), case.trees.size.tolist(), strict=True))


def _curvature(case: Case, row: int = 0) -> NDArray[np.float64]:
    s = int(case.trees.start[row])
    return case.rods.curvature[s : s + int(case.trees.size[row])].astype(float)


@given(seeds)
def test_torques_are_what_the_loads_do_in_a_small_turn(seed: int) -> None:
    """The twin itself: its torques are the slope of its energy, at any curvature."""
    case = random_case(np.random.default_rng(seed), 1, 5)
    rods = _slow_rods(case)
    omega = 3.0 * _curvature(case)
    for rod, rate in zip(rods, omega, strict=True):
        rod.rest = rate  # elastic energy has no slope
    torque = slow.torques(rods, omega)
    for i, k in np.ndindex(*omega.shape):
        for_turn = 1e-5 / rods[i].length
        more, less = omega.copy(), omega.copy()
        more[i, k] += for_turn
        less[i, k] -= for_turn
        work = slow.energy(rods, less) - slow.energy(rods, more)
        np.testing.assert_allclose(work / 2e-5, torque[i, k], atol=1e-6)


@settings(max_examples=20)
@given(seeds, st.sampled_from([0.01, 0.1]))
def test_equilibrium_is_where_relaxation_ends(seed: int, sag: float) -> None:
    """Branching, torsion, elliptical sections, rest curvature, wind: eqs 3, 5, 7, 10 to 15."""
    case = random_case(np.random.default_rng(seed), 1, 8, sag=sag)
    rods = _slow_rods(case)
    expected = slow.relax(rods, _curvature(case), 0.3)
    result = settled(case)
    assert result.stable.all()
    scale = np.abs(expected).max()
    np.testing.assert_allclose(_curvature(case), expected, rtol=1e-5, atol=1e-5 * scale)
    here = slice(int(case.trees.start[0]), int(case.trees.start[0]) + len(rods))
    for s, tip, frame in zip(
        slow.shape(rods, expected), tips(case), case.rods.frame[here], strict=True
    ):
        np.testing.assert_allclose(tip, s.tip, atol=1e-5 * np.abs(tips(case)).max())
        np.testing.assert_allclose(slow.matrix(frame), s.middle, atol=1e-5)


@given(seeds, st.sampled_from([0.01, 0.3, 3.0]))
def test_rods_keep_their_length(seed: int, sag: float) -> None:
    case = random_case(np.random.default_rng(seed), 2, 60, sag=sag)
    settled(case, 1e-4)
    for row in range(2):
        s = int(case.trees.start[row])
        tip = tips(case, row).astype(float)
        parent = case.arena.parent[s : s + len(tip)]
        foot = np.where(parent[:, None] >= 0, tip[parent], 0.0)
        lengths = case.arena.length[s : s + len(tip)]
        error = np.abs(np.linalg.norm(tip - foot, axis=1) - lengths)
        assert error.max() < 1e-6 * max(1.0, np.abs(tip).max())


def _after(case: Case, passes: int) -> NDArray[np.float64]:
    """Curvature of the only tree after some cycles, in float64."""
    here = slice(int(case.trees.start[0]), int(case.trees.start[0] + case.trees.size[0]))
    rods, loads = case.rods, case.loads
    length = case.arena.length[here]
    tree = Chain(
        case.arena.parent[here],
        length,
        rods.joint[here],
        rods.rest[here],
        rods.rigidity[here],
        loads.weight[here],
        loads.wind[here],
    )
    work = np.empty((len(length), int(COLUMNS)))
    part = settle_tree(tree, rods.curvature[here], work, 0.0, np.int64(passes))[3]
    return (work[:, TURN : TURN + 3] + part * work[:, STEP : STEP + 3]) / length[:, None]


@settings(max_examples=20)
@given(seeds, st.sampled_from([0.1, 1.0, 10.0]))
def test_no_cycle_raises_the_energy(seed: int, sag: float) -> None:
    case = random_case(np.random.default_rng(seed), 1, 12, sag=sag)
    rods = _slow_rods(case)
    energies = np.array([slow.energy(rods, _after(case, k)) for k in range(9)])
    scale = sum(
        float(np.abs(r.middle_force).sum() + np.abs(r.tip_force).sum()) for r in rods
    ) * sum(r.length for r in rods)
    assert (np.diff(energies) <= 1e-11 * (scale + np.abs(energies).max())).all()
    assert energies[-1] < energies[0]


@given(seeds, st.floats(-3.1, 3.1))
def test_rotating_the_world_about_z_rotates_the_result(seed: int, angle: float) -> None:
    case = random_case(np.random.default_rng(seed), 1, 30, sag=0.1)
    other = copy.deepcopy(case)
    about = slow.rotation(np.array([0.0, 0.0, angle]))
    w, z = np.cos(0.5 * angle), np.sin(0.5 * angle)
    base = int(case.trees.start[0])
    here = slice(base, base + int(case.trees.size[0]))
    for field, rows in ((other.rods.frame, here), (other.rods.joint, slice(base, base + 1))):
        q = field[rows].astype(float)
        field[rows, 0] = w * q[:, 0] - z * q[:, 3]
        field[rows, 1] = w * q[:, 1] - z * q[:, 2]
        field[rows, 2] = w * q[:, 2] + z * q[:, 1]
        field[rows, 3] = w * q[:, 3] + z * q[:, 0]
    other.loads.wind[:] = case.loads.wind @ about[:2, :2].T
    other.arena.bud[:] = case.arena.bud @ about.T
    settled(case)
    settled(other)
    turned = tips(case) @ about.T
    np.testing.assert_allclose(tips(other), turned, atol=1e-5 * np.abs(turned).max())
    np.testing.assert_allclose(other.arena.bud[here], case.arena.bud[here] @ about.T, atol=1e-5)
    np.testing.assert_allclose(_curvature(other), _curvature(case), rtol=1e-4, atol=1e-5)


def test_same_bits_for_any_number_of_threads() -> None:
    results = []
    for count in (1, 2, 3):
        with using_threads(count):
            case = random_case(np.random.default_rng(4), 20, 40, sag=0.3)
            result = settled(case, 1e-4)
        used = np.concatenate([np.arange(s, s + n) for s, n in _extents(case)])
        arrays = (case.arena.tip, case.arena.bud, *case.rods)
        results.append([a[used].tobytes() for a in arrays] + [a.tobytes() for a in result])
    assert results[0] == results[1] == results[2]


@given(seeds)
def test_stiff_trees_settle_in_few_cycles_and_stay(seed: int) -> None:
    """A second look at a settled tree takes one cycle and moves it by less than the tolerance."""
    case = random_case(np.random.default_rng(seed), 1, 60, sag=0.01)
    assert settled(case, 1e-4).passes[0] <= 6
    again = settled(case, 1e-4)
    assert again.passes[0] == 1
    assert again.turned[0] < 1e-4


@given(seeds)
def test_lateral_buds_turn_with_their_metamers(seed: int) -> None:
    case = random_case(np.random.default_rng(seed), 1, 20, sag=0.3)
    s, n = int(case.trees.start[0]), int(case.trees.size[0])
    before = [slow.matrix(q) for q in case.rods.frame[s : s + n]]
    bud = case.arena.bud[s : s + n].astype(float)
    settled(case, 1e-4)
    for i in range(n):
        after = slow.matrix(case.rods.frame[s + i])
        np.testing.assert_allclose(case.arena.bud[s + i], after @ before[i].T @ bud[i], atol=1e-5)


def test_a_column_past_its_buckling_load_hangs_once_it_is_pushed() -> None:
    for push in (1e-2, 1e-5):
        column = chain(50, elevation=0.5 * np.pi - push, weight=12.0)
        assert not settled(column, most_passes=1).stable[0]
        result = settled(column)
        assert result.stable[0]
        assert result.passes[0] < 60
        assert column.arena.tip[-1, 2] < 0.3


def test_a_hanging_twig_settles_in_few_cycles() -> None:
    """From level to nearly plumb: q L^3 / E I = 1000."""
    twig = chain(50, weight=1000.0)
    result = settled(twig, 1e-4)
    assert result.stable[0]
    assert result.passes[0] < 12
    assert twig.arena.tip[-1, 2] < -0.9
