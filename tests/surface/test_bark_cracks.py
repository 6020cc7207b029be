"""Acts `crack`: no growth heeds them, and the bark is torn where and when they say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from forest.errors import ActError, InputError
from forest.record.run import Run
from forest.record.wood import yearly_wood
from forest.simulation import simulate
from forest.stand import Stand
from forest.surface.bark.cracks import Crack, place_on_stem, recorded_cracks, triggers_of
from forest.surface.bark.presets import Preset
from forest.surface.bark.tree_bark import TreeBark, bark_tree
from tests.tiny import steps, tiny

_TREE, _HEIGHT, _AZIMUTH, _YEAR = 4, 0.15, 130.0, 2005
_ACT = (
    f"{{kind='crack', year={_YEAR}, tree_id={_TREE}, height_m={_HEIGHT}, azimuth_deg={_AZIMUTH}}}"
)
_SETTINGS = ("years=8", f"output={{sample_trees={{ids=[1, {_TREE}]}}}}")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """One run without the act, one with it."""
    folder = tmp_path_factory.mktemp("cracks")
    plain = simulate(tiny(*_SETTINGS), folder / "plain.h5")
    cracked = simulate(tiny(*_SETTINGS, f"acts=[{_ACT}]"), folder / "cracked.h5")
    yield plain, cracked
    plain.close(), cracked.close()


def test_growth_does_not_heed_it(runs: tuple[Run, Run]) -> None:
    plain, cracked = runs
    for name in set(plain.tables) - {"events", "treatments"}:
        assert_frame_equal(plain.read(name), cracked.read(name), check_exact=True)
    events = cracked.events
    mine = events[events.kind == "cracked"]
    assert mine[["year", "tree_id"]].to_numpy().tolist() == [[_YEAR, _TREE]]
    rest = events[events.kind != "cracked"].reset_index(drop=True)
    assert_frame_equal(plain.events, rest, check_exact=True)


def test_the_run_tells_where_and_when(runs: tuple[Run, Run], tmp_path: Path) -> None:
    _, cracked = runs
    only = (Crack(_YEAR, _HEIGHT, _AZIMUTH),)
    assert recorded_cracks(cracked, _TREE, _YEAR) == only
    assert recorded_cracks(cracked, _TREE, _YEAR - 1) == ()
    assert recorded_cracks(cracked, 1, _YEAR) == ()
    tables = "tables=['trees','events','stand']"
    bare = (*_SETTINGS[:1], f"output={{sample_trees={{ids=[{_TREE}]}}, {tables}}}")
    with simulate(tiny(*bare, f"acts=[{_ACT}]"), tmp_path / "bare.h5") as run:
        assert recorded_cracks(run, _TREE, 2008) == only
    fired = _ACT.replace(f"year={_YEAR}", "when='age >= 3', at_most=1")
    with (
        simulate(tiny(*bare, f"acts=[{fired}]"), tmp_path / "fired.h5") as run,
        pytest.raises(InputError, match="treatments"),
    ):
        recorded_cracks(run, _TREE, 2008)
    with simulate(tiny(*_SETTINGS, f"acts=[{fired}]"), tmp_path / "both.h5") as run:
        assert recorded_cracks(run, _TREE, 2008) == (Crack(2004, _HEIGHT, _AZIMUTH),)


def grown(run: Run, preset: str, cracks: tuple[Crack, ...]) -> TreeBark:
    year = int(run.years[-1])
    skeleton = run.skeleton(_TREE, year)
    wood = yearly_wood(run, skeleton, year)
    kept = Preset.load(preset)
    return bark_tree(skeleton, kept, 1, wood=wood, cracks=cracks, least_radius_m=0.004)


def at_trigger(bark: TreeBark, crack: Crack) -> tuple[float, float]:
    """Give how far (m around the girth) the nearest tear lies from a crack, and how wide it is."""
    (trigger,) = triggers_of(bark.tree, bark.history, [crack])
    girth = bark.bark.strips.girth[trigger.strip]
    elements = bark.bark.elements.of(trigger.strip)
    open_ = np.flatnonzero(elements.kind == 1)
    if not len(open_):
        return np.inf, 0.0
    middle = elements.start[open_] + 0.5 * elements.width[open_]
    off = np.abs((middle - trigger.turn * girth + 0.5 * girth) % girth - 0.5 * girth)
    return float(off.min()), float(elements.width[open_[off.argmin()]])


def test_bark_is_torn_there_and_from_then_on(runs: tuple[Run, Run]) -> None:
    _, run = runs
    (crack,) = recorded_cracks(run, _TREE, 2008)
    before, after = grown(run, "beech", ()), grown(run, "beech", (crack,))
    off, width = at_trigger(after, crack)
    assert off < 0.004 and width > 0.001
    assert at_trigger(before, crack)[0] > off + 0.002
    assert at_trigger(after.at(_YEAR), crack)[1] > 0.001
    earlier = after.at(_YEAR - 1).bark, before.at(_YEAR - 1).bark
    assert len(earlier[0].fractures.born) == len(earlier[1].fractures.born)
    np.testing.assert_array_equal(earlier[0].elements.width, earlier[1].elements.width)
    (trigger,) = triggers_of(after.tree, after.history, [crack])
    reach = np.flatnonzero(
        np.abs(after.tree.geometry.along - after.tree.geometry.along[trigger.strip]) > 0.15
    )
    for strip in reach[after.tree.geometry.axis[reach] == 0]:
        one, other = (b.bark.elements.of(int(strip)) for b in (before, after))
        np.testing.assert_array_equal(one.width, other.width)


def test_it_is_told_what_is_not_to_be_seen(runs: tuple[Run, Run]) -> None:
    """A second crack at the same place has no room, one high up no strip."""
    run, _ = runs
    again = Crack(_YEAR + 1, _HEIGHT, _AZIMUTH)
    high = Crack(_YEAR, 0.9 * float(run.skeleton(_TREE, int(run.years[-1])).end[:, 2].max()), 0.0)
    bark = grown(run, "beech", (Crack(_YEAR, _HEIGHT, _AZIMUTH), again, high))
    assert [missed.crack for missed in bark.missed] == [high, again]
    assert str(bark.missed[1]) == (
        "the crack of 2006 at 0.15 m, 130 degrees is not to be seen: "
        "the bark was already torn there"
    )
    assert "thinner than 0.004 m" in bark.missed[0].why
    assert [missed.crack for missed in bark.at(_YEAR).missed] == [high]


def test_a_crack_that_waits_is_there_at_once(runs: tuple[Run, Run]) -> None:
    run, _ = runs
    crack = Crack(int(run.years[-1]) + 1, _HEIGHT, _AZIMUTH)
    assert at_trigger(grown(run, "beech", (crack,)), crack)[1] > 0.001


def test_a_place_on_the_stem_is_found_again(runs: tuple[Run, Run]) -> None:
    run, _ = runs
    bark = grown(run, "beech", ())
    path = bark.tree.paths[0]
    (trigger,) = triggers_of(bark.tree, bark.history, [Crack(_YEAR, _HEIGHT, _AZIMUTH)])
    v = bark.tree.geometry.along[[trigger.strip]]
    point = path.points(v, np.array([trigger.turn]), path.radius_at(v))[0]
    height, azimuth = place_on_stem(bark.tree.skeleton, point)
    assert abs(height - _HEIGHT) < 0.02
    assert abs((azimuth - _AZIMUTH + 180.0) % 360.0 - 180.0) < 5.0
    with pytest.raises(InputError, match="not the bark of the stem"):
        place_on_stem(bark.tree.skeleton, point + np.array([0.5, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ("tree_id=999, height_m=0.1, azimuth_deg=0", "tree_id"),
        ("tree_id=4, height_m=50, azimuth_deg=0", "height_m"),
    ],
)
def test_what_cannot_be_is_refused(keys: str, word: str) -> None:
    act = f"{{kind='crack', year=2002, {keys}}}"
    stand = Stand(tiny("years=3", f"acts=[{act}]"))
    steps(stand, 1)
    with pytest.raises(ActError, match=rf"acts\[0\].{word} in 2002"):
        stand.step()
    for bad in ("tree_id=4, azimuth_deg=0", "tree_id=4, height_m=-1, azimuth_deg=0"):
        with pytest.raises(InputError, match="height_m"):
            tiny(f"acts=[{{kind='crack', year=2002, {bad}}}]")


def test_nothing_is_cracked_after_the_felling() -> None:
    acts = f"acts=[{{kind='fell', year=2003, tree_ids=[{_TREE}]}}, {_ACT}]"
    with pytest.raises(InputError, match="felled by"):
        tiny(*_SETTINGS, acts)
