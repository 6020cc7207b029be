"""A live session as the viewer reads it: its years, its trees with branches, its stand."""

from __future__ import annotations

import numpy as np
import pytest

from forest.errors import InputError
from forest.live import LiveSession
from forest.scenario import Scenario
from forest.viewer import live_source
from forest.viewer.live_source import LiveSource
from forest.viewer.obstacle_tool import enters_box
from forest.viewer.picking import Ray
from forest.viewer.work_panel import words_of
from tests.viewer.test_live import TOML


@pytest.fixture
def source() -> LiveSource:
    """A session of three trees, three years old."""
    session = LiveSession(Scenario.from_toml(TOML))
    for _ in range(3):
        session.step()
    return LiveSource(session, "three.session.toml")


def test_it_shows_the_years_so_far_and_the_stand_as_it_began(source: LiveSource) -> None:
    assert source.years == (2000, 2001, 2002, 2003)
    assert len(source.trees(2000)) == 3 and source.trees(2000)["ring_width_mm"].isna().all()
    assert set(source.trees(2000)["status"]) == {"living"}
    assert source.trees(2003)["height_m"].tolist() == source.living["height_m"].tolist()
    assert source.life(2)["year"].tolist() == [2001, 2002, 2003]
    source.session.step()
    assert source.years[-1] == 2003  # what is shown changes with refresh alone
    source.refresh()
    assert source.years[-1] == source.now == 2004


def test_branches_are_of_now_and_show_what_waits(source: LiveSource) -> None:
    assert source.with_branches(2002) == ()
    assert source.with_branches(2003) == (1, 2, 3)
    with pytest.raises(InputError, match="of 2003 alone"):
        source.skeleton(1, 2002)
    whole = source.skeleton(1, 2003)
    source.session.act(kind="prune", tree_id=1, metamer=int(whole.serial[-1]))
    source.refresh()
    assert len(source.skeleton(1, 2003)) < len(whole)


def test_of_many_trees_those_looked_at_have_branches(
    source: LiveSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_source, "_MOST_METAMERS", 1)
    assert source.with_branches(2003) == ()
    assert source.come_near(2) and not source.come_near(2)
    assert source.with_branches(2003) == (2,)
    assert source.come_near(3)
    assert source.with_branches(2003) == (3,)  # the last one, whatever its size
    assert not source.come_near(99)


def test_while_a_year_grows_nothing_is_read_of_the_session(source: LiveSource) -> None:
    source.skeleton(2, 2003)
    source.growing = True
    assert source.with_branches(2003) == (2,)
    with pytest.raises(InputError, match="a year is growing"):
        source.skeleton(1, 2003)
    with pytest.raises(InputError, match="a year is growing"):
        source.stand_near(2003)


def test_its_stand_is_a_copy_and_its_discs_are_those_of_the_run(source: LiveSource) -> None:
    copy = source.stand_near(2003)
    before = source.session.stand.arena.metamers.light.copy()
    copy.step()
    assert source.session.year == 2003
    light = source.session.stand.arena.metamers.light
    assert np.array_equal(light, before, equal_nan=True)  # unused rows may hold anything
    disc = source.disc(2, 0.1, 2003)
    assert disc.years[-1] == 2003


def test_rays_meet_boxes() -> None:
    low, high = np.zeros(3), np.ones(3)
    ahead = Ray(np.array([0.5, -2.0, 0.5]), np.array([0.0, 1.0, 0.0]))
    assert enters_box(ahead, low, high) == 2.0
    assert enters_box(ahead._replace(origin=np.array([1.5, -2.0, 0.5])), low, high) is None
    assert enters_box(ahead._replace(direction=np.array([0.0, -1.0, 0.0])), low, high) is None


@pytest.mark.parametrize(
    ("act", "said"),
    [
        ({"kind": "fell", "tree_ids": [3]}, "fell tree 3"),
        ({"kind": "mark", "tree_ids": [3, 4], "mark": "crop"}, "mark trees 3, 4 'crop'"),
        ({"kind": "prune", "tree_id": 2, "metamer": 7}, "prune tree 2 at metamer 7"),
        ({"kind": "obstacle", "remove": "wall"}, "remove wall"),
        ({"kind": "thin", "method": "below", "n_ha": 800.0}, "thin from below, leave N 800/ha"),
    ],
)
def test_acts_are_said_in_words(act: dict[str, object], said: str) -> None:
    assert words_of(act) == said
