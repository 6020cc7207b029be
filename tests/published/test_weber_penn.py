"""Numbers of Weber & Penn 1995 that can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from forest.parametric import from_paper, grow, load_parameters
from forest.parametric.ratios import flared, lobed, shape_ratio, tapered
from forest.parametric.sway import sway_angles


@pytest.fixture(scope="module")
def aspen():  # type: ignore[no-untyped-def]
    return grow(load_parameters("quaking_aspen").with_changes(["ScaleV=0"]), 1)


def test_aspen_counts(aspen) -> None:  # type: ignore[no-untyped-def]
    """50 main branches, 50 * 30 * 0.8 on them, 25 * 0.75 leaves on each of these."""
    count = np.bincount(aspen.stems.level)
    assert count[:2].tolist() == [1, 50]
    assert count[2] == pytest.approx(1200, rel=0.01)
    assert len(aspen.leaves.stem) == pytest.approx(18.75 * count[2], rel=0.01)


def test_aspen_radii(aspen) -> None:  # type: ignore[no-untyped-def]
    assert aspen.stems.radius[0] == pytest.approx(13 * 0.015)
    assert aspen.nodes.radius[0] == pytest.approx(0.195 * (1 + 0.6 * 0.99))
    stems = aspen.stems
    own = np.flatnonzero(stems.level == 1)
    share = stems.length[own] / stems.length[0]
    assert (stems.radius[own] <= 0.195 * share**1.2 + 1e-12).all()


def test_aspen_angles_and_lengths(aspen) -> None:  # type: ignore[no-untyped-def]
    """1DownAngle 60, 1DownAngleV -50: 110 degrees at the bare base, 30 at the top."""
    straight = grow(load_parameters("quaking_aspen").with_changes(["ScaleV=0", "0CurveV=0"]), 1)
    stems = straight.stems
    own = np.flatnonzero(stems.level == 1)
    ratio = (13.0 - stems.offset[own]) / (13.0 - 0.4 * 13.0)
    down = np.degrees(np.arccos(straight.nodes.heading[stems.first[own], 2]))
    np.testing.assert_allclose(down, 60 - 50 * (1 - 2 * (0.2 + 0.8 * ratio)))
    tend = np.where(ratio <= 0.7, ratio / 0.7, (1 - ratio) / 0.3)
    np.testing.assert_allclose(stems.length[own], 13 * 0.3 * (0.5 + 0.5 * tend))


@pytest.mark.parametrize(("splits", "segments", "stems"), [(2, 5, 81), (1, 3, 4)])
def test_whole_splits(splits: int, segments: int, stems: int) -> None:
    """(nSegSplits + 1)^(nCurveRes - 1) stems, where a split costs no propensity (4.2, Fig. 1)."""
    values = {"Levels": 1, "0SegSplits": splits, "0CurveRes": segments, "0SplitAngle": 20}
    tree = grow(from_paper(values).with_changes(["clone_habit=1"]))
    assert len(tree.stems.level) == stems


@pytest.mark.parametrize("share", [0.1, 0.37, 0.5, 0.93, 1.2])
def test_error_diffusion(share: float) -> None:
    """Clones of a level are within one of nSegSplits for each joint of each stem."""
    values = {"Levels": 2, "1Branches": 40, "1Length": 0.3, "1SegSplits": share, "1CurveRes": 4}
    tree = grow(from_paper(values).with_changes(["clone_habit=1"]))
    own = tree.stems.level == 1
    joints = int((tree.stems.nodes[own] - 2).sum())  # a clone cannot split where it begins
    clones = int(tree.stems.is_clone[own].sum())
    assert abs(clones - share * joints) <= 1.0


def test_splits_turn_back() -> None:
    """What a split adds to a stem's lean is taken off it over the remaining segments."""
    values = {"Levels": 1, "0BaseSplits": 1, "0SplitAngle": 40, "0CurveRes": 8}
    tree = grow(from_paper(values), 3)
    for k in range(2):
        nodes = slice(tree.stems.first[k], tree.stems.first[k] + tree.stems.nodes[k])
        down = np.degrees(np.arccos(np.clip(tree.nodes.heading[nodes, 2], -1, 1)))
        assert down.max() == pytest.approx(40.0)
        assert down[-1] == pytest.approx(0.0, abs=1e-5)


def test_curve_and_helix() -> None:
    arch = grow(from_paper({"Levels": 1, "0Curve": 60, "0CurveRes": 6}))
    down = np.degrees(np.arccos(arch.nodes.heading[:, 2]))
    np.testing.assert_allclose(down[:6], 10.0 * np.arange(6), atol=1e-6)
    helix = grow(from_paper({"Levels": 1, "0CurveV": -25, "0CurveRes": 12}))
    down = np.degrees(np.arccos(helix.nodes.heading[:, 2]))
    np.testing.assert_allclose(down, 25.0)
    np.testing.assert_allclose(helix.nodes.position[-1, :2], 0.0, atol=1e-9)  # one whole turn


@pytest.mark.parametrize(
    ("shape", "at"),
    [
        (0, (0.2, 0.6, 1.0)),
        (1, (0.2, 1.0, 0.2)),
        (2, (0.2, 0.2 + 0.8 * np.sin(np.pi / 4), 1.0)),
        (3, (1.0, 1.0, 1.0)),
        (4, (0.5, 0.75, 1.0)),
        (5, (0.0, 5 / 7, 0.0)),
        (6, (1.0, 0.6, 0.2)),
        (7, (0.5, 0.5 + 2.5 / 7, 0.5)),
        (8, (0.0, 1.0, 0.0)),
    ],
)
def test_shape_ratios(shape: int, at: tuple[float, ...]) -> None:
    got = [shape_ratio(shape, r, 0.5, 0.5, 0.5, False) for r in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(got, at, atol=1e-12)


def test_envelope_jumps_as_printed_only() -> None:
    """Below its peak the printed curve starts at peak / (1 - peak), not at 1."""
    just_below = 0.4 + 1e-9
    assert shape_ratio(8, just_below, 0.6, 1.0, 1.0, False) == pytest.approx(1.0)
    assert shape_ratio(8, just_below, 0.6, 1.0, 1.0, True) == pytest.approx(1.5)


def test_taper_flare_lobes() -> None:
    assert tapered(0.2, 0.0, 1.0, 10.0) == pytest.approx(0.2)
    assert tapered(0.2, 1.0, 0.5, 10.0) == pytest.approx(0.1)
    assert tapered(0.2, 2.0, 0.5, 10.0) == pytest.approx(0.2, rel=1e-6)
    assert tapered(0.2, 2.0, 1.0, 10.0) == pytest.approx(0.0)
    assert tapered(0.2, 3.0, 0.98, 10.0) == pytest.approx(0.2)  # the middle of a sphere
    assert tapered(0.2, 3.0, 0.96, 10.0) == pytest.approx(0.0, abs=1e-6)  # where two meet
    assert flared(0.6, 0.0) == pytest.approx(1.594)
    assert flared(0.6, 0.125) == flared(0.6, 0.9) == 1.0
    assert lobed(5, 0.07, np.pi / 10) == pytest.approx(1.07)
    assert lobed(5, 0.0, 1.0) == 1.0


@pytest.mark.parametrize("name", ["weeping_willow", "quaking_aspen"])
def test_pruned_branches_keep_inside(name: str) -> None:
    changes = ["PruneRatio=1", "PruneWidth=0.2", "Levels=3", "Leaves=0", "ScaleV=0"]
    p = load_parameters(name).with_changes(changes)
    tree = grow(p, 4)
    own = tree.stems.level[tree.nodes.stem] > 0
    assert own.sum() > 100
    x, y, z = tree.nodes.position[own].T
    ratio = (tree.scale - z) / (tree.scale * (1 - p.base_size))
    inner = np.clip(ratio, 0.0, 1.0)
    peak = p.prune_width_peak
    wide = np.where(
        inner < 1 - peak,
        (inner / (1 - peak)) ** p.prune_power_high,
        ((1 - inner) / peak) ** p.prune_power_low,
    )
    assert (np.hypot(x, y) <= 0.2 * tree.scale * wide + 1e-9).all()
    assert ((ratio > 0) & (ratio < 1)).all()


def test_attraction_up() -> None:
    """A magnitude of 1 turns a twig about as far as the vertical; -1 down."""
    values = {
        "Levels": 3, "1Branches": 6, "1Length": 0.3, "1DownAngle": 90, "2Branches": 3,
        "2Length": 0.5, "2CurveRes": 40, "2DownAngle": 0, "2Rotate": 0,
    }  # fmt: skip
    for attraction in (1.0, -1.0):
        tree = grow(from_paper({**values, "AttractionUp": attraction}))
        last = tree.stems.first + tree.stems.nodes - 1
        up = tree.nodes.heading[last[tree.stems.level == 2], 2]
        assert (np.sign(attraction) * up > 0.6).all()


def test_sway_formula() -> None:
    """4.7 by hand: a0 = 4 L (1 - Z) / r, and its limit 4 L / r at the tip of a cone."""
    a0 = 4 * 10.0 * 0.5 / 0.1
    a1, a2 = 5 / 50 * a0, 3 / 50 * a0 + 5 / 50 * a0 / 2
    b = 1.0 + 0.2 / 10 * 30 / 15
    want = (a1 * np.sin(b) + a2 * np.sin(0.7 * b)) / 4
    got = sway_angles((5.0, 3.0, 30.0), 10.0, 0.2, 0.1, 0.5, 1.0, 4)
    assert got == pytest.approx(want)
    tip = sway_angles((5.0, 3.0, 30.0), 10.0, 0.2, 0.0, 1.0, 1.0, 4)
    assert tip == pytest.approx(want)
