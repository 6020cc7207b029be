"""The thick side of rings as an azimuth: one convention, whether trees bend or not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._jit import njit
from forest.growth.dealing import deal
from forest.mechanics.branch_points import reaction_rings
from forest.mechanics.quaternions import between, product, turn
from forest.mechanics.righting import STRAIN
from forest.mechanics.rings import upright_azimuth
from forest.mechanics.rods import Rods
from forest.mechanics.stems import StemSpecies
from forest.mechanics.wood import lay_wood
from tests.mechanics.stem_cases import SPECIES, pole
from tests.mechanics.test_wood import round_rods, traits_of, unit_quaternions
from tests.reference import rings as slow

seeds = st.integers(0, 2**32 - 1)


def _apart(a: float, b: float) -> float:
    """Angle between two azimuths, rad."""
    return abs((a - b + np.pi) % (2.0 * np.pi) - np.pi)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_azimuths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = unit_quaternions(rng, 20)
    angles = rng.uniform(-np.pi, np.pi, 20)
    found = upright_azimuth(frames.astype(np.float32), angles)
    for frame, angle, azimuth in zip(frames, angles, found, strict=True):
        down = 1.0 + 2.0 * (frame[1] * frame[3] - frame[0] * frame[2])  # 1 + H z
        # what hangs straight down has no shortest turn
        assert _apart(azimuth, slow.azimuth(frame, angle)) < 1e-5 / max(down, 1e-5)


def test_upright_metamers_have_the_azimuths_of_the_world() -> None:
    up = np.array([[np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]], np.float32)  # H up, L y, U -x
    assert upright_azimuth(up, np.array([0.0]))[0] == pytest.approx(np.pi / 2)
    assert _apart(upright_azimuth(up, np.array([np.pi / 2]))[0], np.pi) < 1e-6


@njit
def _leaning(lean, azimuth, roll):  # type: ignore[no-untyped-def]
    """The frame of a metamer that leans towards an azimuth, rolled about its heading."""
    heading = (np.sin(lean) * np.cos(azimuth), np.sin(lean) * np.sin(azimuth), np.cos(lean))
    return product(between((1.0, 0.0, 0.0), heading), turn(roll, 0.0, 0.0))


@given(
    st.floats(0.15, 1.4), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.sampled_from([True, False])
)
@settings(max_examples=25, deadline=None)
def test_both_ways_name_the_same_side(
    lean: float, azimuth: float, roll: float, conifer: bool
) -> None:
    """Leaning stems are thick below in conifers and above in broadleaves; they lean below."""
    n = 12
    m, trees = pole(np.full(n, 0.03), 3.0, lean)
    x, y = m.tip[:n, 0].copy(), m.tip[:n, 1].copy()
    m.tip[:n, 0] = np.cos(azimuth) * x - np.sin(azimuth) * y
    m.tip[:n, 1] = np.sin(azimuth) * x + np.cos(azimuth) * y
    m.order[:n] = 0
    below = azimuth if conifer else azimuth + np.pi

    kind = StemSpecies(*SPECIES)._replace(compression_wood=np.full(2, float(conifer)))
    stiff = reaction_rings(m, trees, kind)[:n]
    assert stiff[0, 0] > 0.0
    assert _apart(stiff[0, 1], below) < 1e-3

    rods: Rods = round_rods(n, 0.028, 8e9, frame=np.array(_leaning(lean, azimuth, roll)))
    woods = traits_of("picea_abies" if conifer else "fagus_sylvatica")
    ring = np.zeros((n, 2), np.float32)
    lay_wood(m, trees, deal(trees.size), rods, woods, STRAIN, ring)
    assert np.all(ring[:, 0] > 0.0)
    for thick in upright_azimuth(rods.frame, ring[:, 1].astype(np.float64)):
        assert _apart(thick, below) < 1e-3
