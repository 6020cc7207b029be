"""Thickening, ageing, turning: against twins, and what must hold of the tree."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.inventory.fitting import MOST_WOOD, aged, thickened, turned
from forest.mechanics.quaternions import heading, product
from forest.mechanics.rods import FIELDS
from forest.mechanics.transplant import transplanted
from tests.reference import inventory as slow

QUICK = settings(max_examples=25, deadline=None)


@st.composite
def pipes(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, float]:
    """Wood of a small tree as rings lay it: primary wood, and what its children carry on top."""
    n = draw(st.integers(1, 12))
    parent = [-1] + [draw(st.integers(0, i - 1)) for i in range(1, n)]
    primary = 3e-5
    rings = [draw(st.floats(0.0, 1e-3)) for _ in range(n)]
    for i in range(n - 1, 0, -1):
        rings[parent[i]] += rings[i]
    return np.array(rings, np.float32) + np.float32(primary), np.array(parent, np.int32), primary


@given(pipes(), st.data(), st.floats(3e-5, 1e-2))
@QUICK
def test_thickened(tree: tuple, data: st.DataObject, wanted: float) -> None:
    pipe, parent, primary = tree
    breast = data.draw(st.integers(0, len(pipe) - 1))
    got = thickened(pipe, parent, breast, wanted, primary)
    expected = slow.thickened(
        [float(p) for p in pipe], parent.tolist(), breast, wanted, primary, MOST_WOOD
    )
    np.testing.assert_allclose(got, expected, rtol=1e-6)
    np.testing.assert_allclose(got[breast], wanted, rtol=1e-6)
    borne = np.zeros(len(pipe))  # a stem still has the rings of all that it bears
    for i in range(1, len(pipe)):
        borne[parent[i]] += got[i] - primary
    assert (got - primary >= borne - 1e-6).all()


@given(st.lists(st.integers(0, 60), min_size=1), st.integers(1, 90), st.integers(0, 40))
@QUICK
def test_aged(years: list[int], wanted_age: int, kept: int) -> None:
    age = max(max(years), 1)
    got = -aged(-np.array(years, np.int16), age, wanted_age, kept).astype(int)
    assert got.tolist() == slow.aged(years, age, wanted_age, kept)
    assert got.max() <= wanted_age
    assert (np.diff(got[np.argsort(years, kind="stable")]) >= 0).all()  # none older than its parent
    if age in years and age > kept:
        assert got[years.index(age)] == wanted_age  # the first metamer is as old as the tree


@given(st.tuples(*[st.floats(-5, 5, width=32)] * 3), st.floats(-7, 7))
@QUICK
def test_turned(vector: tuple[float, float, float], azimuth: float) -> None:
    got = turned(np.array([vector], np.float32), azimuth)[0]
    np.testing.assert_allclose(got, slow.turned(vector, azimuth), atol=1e-5)


@given(st.integers(0, 1000), st.floats(-4, 4), st.floats(0.7, 1.4), st.floats(0.6, 1.8))
@QUICK
def test_rods_keep_their_shape_under_their_load(
    seed: int, azimuth: float, ratio: float, thicker: float
) -> None:
    draw = np.random.default_rng(seed)
    parent = np.array([-1, 0, 1, 1], np.int32)
    n = len(parent)
    rods = {
        name: draw.normal(size=(n, k) if k > 1 else n).astype(dtype)
        for name, (dtype, k, _) in FIELDS.items()
    }
    for name in ("joint", "frame"):
        rods[name] /= np.linalg.norm(rods[name], axis=1, keepdims=True)
    got = transplanted(tuple(rods.values()), parent, azimuth, ratio, np.full(n, thicker))
    turn = (np.cos(azimuth / 2), 0.0, 0.0, np.sin(azimuth / 2))
    for i in range(n):
        expected = product(turn, rods["frame"][i].astype(float))
        np.testing.assert_allclose(got.frame[i], expected, atol=1e-6)
        h = np.array([heading(rods["frame"][i].astype(float))], np.float32)
        np.testing.assert_allclose(
            heading(got.frame[i].astype(float)), turned(h, azimuth)[0], atol=1e-5
        )
    np.testing.assert_array_equal(got.joint[1:], rods["joint"][1:])
    # angles along the tree stay; moment = rigidity x (curvature - rest) grows as the load does
    np.testing.assert_allclose(got.curvature * ratio, rods["curvature"], rtol=1e-5)
    moment = got.rigidity * (got.curvature.astype(float) - got.rest)
    before = rods["rigidity"] * (rods["curvature"].astype(float) - rods["rest"])
    np.testing.assert_allclose(moment, before * ratio**2 * thicker**2, rtol=1e-3, atol=1e-5)
