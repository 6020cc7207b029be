"""Trees in the wind."""

from __future__ import annotations

import numpy as np
import pytest

from forest.errors import InputError
from forest.parametric import from_paper, grow, load_parameters


@pytest.mark.parametrize(
    ("name", "z_scale"),
    [("quaking_aspen", 1.0), ("sassafras", 1.0), ("queen_palm", 1.0), ("black_tupelo", 2.0)],
)
def test_only_turns_change(name: str, z_scale: float) -> None:
    still = grow(load_parameters(name).with_changes([f"ZScale={z_scale}"]), 3)
    moved = still.swayed(7.0, 5.0, 3.0, time_scale=2000.0)
    assert np.abs(moved.nodes.position - still.nodes.position).max() > 0.1
    a, b = still.skeleton(), moved.skeleton()
    np.testing.assert_allclose(a.length, b.length, atol=1e-9)
    np.testing.assert_array_equal(a.parent, b.parent)
    np.testing.assert_array_equal(a.radius, b.radius)
    # What a parent bears stays where it was on the parent.
    born = np.flatnonzero((a.parent >= 0) & (a.axis != a.axis[a.parent]))
    for end in ("start", "end"):
        was, now = (
            np.linalg.norm(t.start[born] - getattr(t, end)[t.parent[born]], axis=1) for t in (a, b)
        )
        np.testing.assert_allclose(was, now, atol=1e-9)
    node = still.joints.leaf_node
    for column in ("direction", "normal"):
        was, now = (
            (getattr(t.leaves, column) * t.nodes.heading[node]).sum(1) for t in (still, moved)
        )
        np.testing.assert_allclose(was, now, atol=3e-7)  # leaves are single precision


def test_no_wind_and_a_breath() -> None:
    still = grow("quaking_aspen", 3)
    assert still.swayed(11.0, 0.0) is still
    breath = still.swayed(11.0, 1e-9)
    np.testing.assert_allclose(breath.nodes.position, still.nodes.position, atol=1e-6)


def test_a_stretched_tree_sways_as_one_of_its_length() -> None:
    """A straight trunk of 10 m that is stretched to 20 m is one of 20 m, in calm and in wind."""
    values = {"Levels": 1, "0CurveRes": 6, "0CurveV": 0}
    stretched = grow(from_paper({**values, "Scale": 10, "ZScale": 2, "Ratio": 0.02}), 3)
    tall = grow(from_paper({**values, "Scale": 20, "Ratio": 0.01}), 3)
    for column in ("length", "radius", "offset"):
        np.testing.assert_allclose(getattr(stretched.stems, column), getattr(tall.stems, column))
    one, other = (t.swayed(3.0, 4.0, 2.0, time_scale=2000.0) for t in (stretched, tall))
    assert np.abs(other.nodes.position - tall.nodes.position).max() > 0.1
    np.testing.assert_allclose(one.nodes.position, other.nodes.position, atol=1e-9)


def test_refused_winds() -> None:
    with pytest.raises(InputError, match="wind speed -1 is not allowed"):
        grow("lilac", 3).swayed(0.0, -1.0)


def test_frames_are_the_moments() -> None:
    still = grow("black_tupelo", 3)
    times = [0.0, 3.5, 1.25]
    frames = list(still.frames(times, 6.0, 2.0, time_scale=1500.0))
    assert len(frames) == len(times)
    assert np.abs(frames[0].nodes.position - frames[1].nodes.position).max() > 0.01
    for time, frame in zip(times, frames, strict=True):
        alone = still.swayed(time, 6.0, 2.0, time_scale=1500.0)
        for a, b in zip((*frame.nodes, *frame.leaves), (*alone.nodes, *alone.leaves), strict=True):
            np.testing.assert_array_equal(a, b)
        assert frame.stems is still.stems
        assert frame.joints is still.joints
        assert frame.nodes.radius is still.nodes.radius
