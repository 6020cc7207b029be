"""How fractures run from strip to strip (Lefebvre and Neyret 3.2.4, 5.3)."""

from __future__ import annotations

import numpy as np
import pytest

from forest.errors import InputError
from forest.surface.bark import Crossings, Material, StripGeometry, grow_bark, shrinking
from tests.surface.bark_cases import check, column, grown, statistics

#: A fracture that nothing stops nor turns.
FREE = {
    "inglis": 0.0,
    "arrest": 0.0,
    "run_m": np.inf,
    "stray_deg": 0.0,
    "influence": 0.0,
    "stand_off": 0.0,
}


def _whole(girth: object = 0.8, strips: int = 20, **material: object):  # type: ignore[no-untyped-def]
    """Give bark under strain that is not torn yet."""
    settings: dict = {"threshold": 1.5, "threshold_jitter": 0.0, **FREE, **material}  # type: ignore[type-arg]
    table = np.array([1.0, 1.05])[:, None] * np.broadcast_to(girth, strips)
    return grow_bark(column(strips), table, Material(**settings))


def _turns(bark, fracture: int = 0):  # type: ignore[no-untyped-def]
    """Give strips and angles (parts of a turn of the middles) of a fracture, base to tip."""
    e = bark.elements
    rows = np.flatnonzero(e.fracture == fracture)
    strips = np.searchsorted(e.offsets, rows, side="right") - 1
    middle = e.start[rows] + 0.5 * e.width[rows]
    return strips, np.array([bark.turns(s, x)[0] for s, x in zip(strips, middle, strict=True)])


def test_a_fracture_runs_straight_along_a_cone() -> None:
    """The same angle on every strip, whatever its girth (5.3)."""
    bark = _whole(np.linspace(1.2, 0.4, 20)).trigger(10, 0.25 * 0.82)
    strips, turn = _turns(bark)
    assert strips.tolist() == list(range(20))
    assert turn == pytest.approx(np.full(20, turn[10]), abs=0.02)
    check(bark)


def test_the_inglis_ratio_stops_it() -> None:
    """Runs only while longer than `inglis` times its width."""
    tall = _whole(inglis=0.01, flaw_m=0.0).trigger(10, 0.3)
    assert tall.fractures.strips[0] == 20
    short = _whole(inglis=1e4, flaw_m=0.0).trigger(10, 0.3)
    assert short.fractures.strips[0] == 1
    flawed = _whole(inglis=1e4, flaw_m=0.1).trigger(10, 0.3)
    assert flawed.fractures.length[0] == pytest.approx(0.1)
    (width,) = short.fractures.width
    ratio = 0.02 / width
    assert _whole(inglis=0.99 * ratio, flaw_m=0.0).trigger(10, 0.3).fractures.strips[0] > 1
    assert _whole(inglis=1.01 * ratio, flaw_m=0.0).trigger(10, 0.3).fractures.strips[0] == 1


def test_relieved_strips_arrest_it() -> None:
    """Strain 0.05 under a threshold of 0.5: 0.1 of what breaks a strip unaided."""
    assert _whole(arrest=0.09).trigger(10, 0.3).fractures.strips[0] == 20
    assert _whole(arrest=0.11).trigger(10, 0.3).fractures.strips[0] == 1


def test_ductile_bark_tears_slowly() -> None:
    bark = _whole(run_m=0.05).trigger(10, 0.3)
    assert bark.fractures.strips[0] == 7  # 0.06 m each way: the strip at which it passes 0.05
    girth = bark.strips.girth[None, :]
    assert bark.grow(girth * 1.01).fractures.strips[0] == 13


def test_strays_within_its_angle() -> None:
    bark = _whole(stray_deg=20.0).trigger(10, 0.3)
    _, turn = _turns(bark)
    slope = np.diff(turn) * 0.84 / 0.02
    assert np.abs(slope).max() > 0.01
    assert np.abs(slope).max() < np.tan(np.radians(20.0)) + 0.05


def test_follows_the_edge_of_a_wide_fracture() -> None:
    """A course near a fracture runs along its edge; far away, or without influence, it does not."""

    def lean(influence: float, apart: float) -> float:
        """Give the slope of the second fracture's course, in parts of a turn over the cone."""
        n = 30
        first = np.full(n, 0.8)
        last = 0.8 + np.linspace(0.02, 0.6, n)  # the fracture gapes towards the tip
        material = Material(**{**FREE, "influence": influence, "threshold": 9.0, "flaw_m": 9.0})  # type: ignore[arg-type]
        bark = grow_bark(column(n), np.vstack([first, 1.01 * first]), material).trigger(0, 0.4)
        bark = bark.grow(last[None, :])
        e = bark.elements
        edge = float(e.start[1] + e.width[1])
        bark = bark.trigger(0, edge + apart)
        _, turn = _turns(bark, 1)
        return float(turn[-1] - turn[0])

    bent = lean(3.0, 0.02)
    assert abs(lean(0.0, 0.02)) < abs(bent) or bent > lean(0.0, 0.02)
    assert lean(0.001, 0.3) == pytest.approx(lean(0.0, 0.3), abs=1e-12)
    assert bent > 0.02


def test_fractures_interlace() -> None:
    """A larger stand-off ends fractures before they come near to others."""
    near = statistics(grown(120, 0.6, 1.2, 20, stand_off=0.0, arrest=0.2))
    far = statistics(grown(120, 0.6, 1.2, 20, stand_off=2.0, arrest=0.2))
    assert far["length"] < near["length"]


def _branched() -> StripGeometry:
    """A stem of 20 strips with a branch of 10 at strip 10, angle 0.25 to 0.45."""
    stem, branch = column(20), column(10)
    back = np.flatnonzero(branch.neighbour_up >= 0)
    up, down = branch.neighbour_up.copy(), branch.neighbour_down.copy()
    up[back] += 20
    down[1:] += 20
    crossings = Crossings(
        strip=np.array([10, 13, 20], np.int32),
        runs=np.array([1, -1, -1], np.int8),
        angle=np.array([0.35, 0.35, 0.0]),
        half=np.array([0.1, 0.1, 0.25]),
        to=np.array([20, 20, 10], np.int32),
        enters=np.array([0.0, 0.5, 0.35]),
        scale=np.array([1.0, -1.0, 0.4]),
        goes=np.array([1, 1, -1], np.int8),
    )
    return StripGeometry(
        axis=np.repeat([0, 1], [20, 10]).astype(np.int32),
        along=np.concatenate([stem.along, branch.along]),
        width=np.concatenate([stem.width, branch.width]),
        neighbour_up=np.concatenate([stem.neighbour_up, up]),
        neighbour_down=np.concatenate([stem.neighbour_down, down]),
        width_around=np.ones((30, 1)),
        crossings=crossings,
    )


@pytest.mark.parametrize("start", [5, 17])
def test_a_fracture_crosses_to_a_branch(start: int) -> None:
    """It stops on the stem where the branch is and goes on along it, from below or from above."""
    girth = np.repeat([0.8, 0.3], [20, 10])
    material = Material(**{**FREE, "threshold": 1.5})  # type: ignore[arg-type]
    bark = grow_bark(_branched(), np.vstack([girth, 1.05 * girth]), material)
    bark = bark.trigger(start, 0.35 * 0.84)
    check(bark)
    t = bark.tears
    on_stem = np.sort(t.strip[t.strip < 20])
    assert (t.fracture == 0).all()
    assert np.sort(t.strip[t.strip >= 20]).tolist() == list(range(20, 30))
    assert on_stem.tolist() == (list(range(11)) if start == 5 else list(range(13, 20)))
    passing = np.flatnonzero((t.strip < 20) & ((t.up >= 0) | (t.down >= 0)))
    ends = [
        k for k in passing for link in (t.up[k], t.down[k]) if link >= 0 and t.strip[link] == 20
    ]
    assert len(ends) == 1
    # It goes on along both, and back down from the branch to the stem.
    again = grow_bark(_branched(), np.vstack([girth, 1.05 * girth]), material).trigger(25, 0.001)
    assert set(again.tears.strip) == {*range(11), *range(20, 30)}


def test_a_fracture_runs_on_over_a_branching_later() -> None:
    """A fracture that came over a passage that turned it round goes on in its new direction."""
    girth = np.repeat([0.8, 0.3], [20, 10])
    material = Material(**{**FREE, "threshold": 1.5, "run_m": 0.05})  # type: ignore[arg-type]
    bark = grow_bark(_branched(), np.vstack([girth, 1.05 * girth]), material)
    bark = bark.trigger(15, 0.35 * 0.84)
    assert 20 in bark.tears.strip and 24 not in bark.tears.strip
    later = bark.grow(np.array([1.055, 1.06, 1.065, 1.07])[:, None] * girth)
    check(later)
    assert set(range(20, 30)) <= set(later.tears.strip)


def test_trigger_tears_there_and_leaves_the_old_bark() -> None:
    bark = _whole(inglis=1e9, flaw_m=0.0)
    torn = bark.trigger(3, 0.5)
    assert len(bark.tears.strip) == 0 and torn.tears.strip.tolist() == [3]
    rows, part = torn.elements.at(3, np.array([0.5]))
    assert torn.elements.kind[rows[0]] == 1 or not 0.01 <= part[0] <= 0.99
    again = torn.trigger(3, 0.2)  # what had opened stays open
    for node in torn.elements.tear[torn.elements.kind == 1]:
        width = [b.elements.width[b.elements.tear == node][0] for b in (torn, again)]
        assert width[1] >= width[0]
    with pytest.raises(InputError, match="no room for a fracture"):
        torn.trigger(3, 0.5)
    with pytest.raises(InputError, match="no strip 20"):
        bark.trigger(20, 0.1)


def test_at_time() -> None:
    bark = grow_bark(column(4), shrinking(np.ones(4), 0.5, 5), keep=True)
    assert bark.at_time(3.5).time == 3.0
    assert (bark.at_time(5).elements.width == bark.elements.width).all()
    with pytest.raises(InputError, match="no snapshot"):
        bark.at_time(0.5)
