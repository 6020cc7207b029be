"""A live session: acts are queued and done by the next step, and all can be replayed headless."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pandas.testing import assert_frame_equal

from forest.errors import ActError, InputError, OutputError
from forest.live import LiveSession
from forest.record.run import open_run
from forest.record.schema import ACT_KINDS
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand
from tests.tiny import assert_same_runs, assert_same_years, steps, tiny, write_tiny

SETTINGS = (
    "years=3",
    "environment={shadow={}, canopy={}, markers={}}",
    "planting={kind='random', density_ha=600}",
    "output={sample_trees={ids=[1, 4], dbh_quantiles=[0.5]}}",
    "acts=[{kind='prune', year=2002, all_trees=true, below_share=0.2},"
    "{kind='thin', when='n_ha > 300', from_year=2002, method='random', share_n=0.2, at_most=1}]",
)
KINDS = (
    *("step", "step", "step", "undo", "fell", "prune", "lift", "plant", "thin", "harvest"),
    *("mark", "fell marked", "bend", "crack", "wall", "move", "remove"),
    *("stroke", "stroke of a branch"),
)


def do(session: LiveSession, kind: str, draw: int) -> None:
    """Do something of a kind; `draw` chooses what of it."""
    ids = session.stand.rows.tree_id.tolist()
    tree_id = ids[draw % len(ids)] if ids else 0
    if kind == "step":
        session.step()
    elif kind == "undo":
        session.undo()
    elif kind == "fell":
        session.act(kind="fell", tree_ids=[tree_id])
    elif kind == "prune":
        serials = session.stand.skeleton(tree_id).serial if ids else np.zeros(1)
        session.act(kind="prune", tree_id=tree_id, metamer=int(serials[draw % len(serials)]))
    elif kind == "lift":
        session.act(kind="prune", all_trees=True, below_share=0.5)
    elif kind == "plant":
        where = {"x_m": [draw % 97 / 10], "y_m": [draw % 89 / 10]}
        session.act(kind="plant", species="fagus_sylvatica", **where)
    elif kind == "thin":
        session.act(kind="thin", method="below", share_n=0.3)
    elif kind == "harvest":
        session.act(kind="harvest", method="diameter_limit", limit_cm=1.0)
    else:
        shape(session, kind, draw, tree_id)


def shape(session: LiveSession, kind: str, draw: int, tree_id: int) -> None:
    """Do something that marks or shapes trees, or changes what is around them."""
    x, y = draw % 97 / 10, draw % 89 / 10
    if kind == "mark":
        session.act(kind="mark", tree_ids=[tree_id], mark="out")
    elif kind == "fell marked":
        session.act(kind="fell", marked="out")
    elif kind == "crack":
        session.act(kind="crack", tree_id=tree_id, height_m=draw % 8 / 10, azimuth_deg=draw % 360)
    elif kind == "wall":
        box = {"min_m": [x, y, draw % 7 / 10], "max_m": [x + 0.5, y + 2, 2]}
        session.act(kind="obstacle", add={"kind": "box", "name": f"wall {draw % 3}", **box})
    elif kind == "move":
        session.act(kind="obstacle", move=f"wall {draw % 3}", by_m=[0.3, 0, 0.2])
    elif kind == "remove":
        session.act(kind="obstacle", remove=f"wall {draw % 3}")
    elif kind == "stroke":
        turns = {"x_m": 5, "y_m": 5, "times": 2 + draw % 3}
        path = {"points_m": [[x, y, 0.3], [5, 5, 1.5]], "steps": 1 + draw % 3}
        session.act(kind="stroke", radius_m=0.4, rotation=turns, **path)
    else:
        there = session.skeleton(tree_id)
        k = draw % len(there)
        metamer, end = int(there.serial[k]), there.end[k]
        to = (end + np.array([0.1, 0.05, 0.02 * (draw % 4)])).tolist()
        if kind == "bend":
            session.act(kind="bend", tree_id=tree_id, metamer=metamer, to_m=to)
        else:
            bud = {"tree_id": tree_id, "metamer": metamer, "from_metamer": metamer}
            session.act(kind="stroke", points_m=[to], radius_m=0.3, hold_steps=draw % 3, **bud)


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(st.sampled_from(KINDS), st.integers(0, 10_000)), max_size=14))
def test_any_session_replays(moves: list[tuple[str, int]]) -> None:
    """Whatever is done, a headless run of its scenario gives the same years."""
    session = LiveSession(tiny(*SETTINGS))
    for kind, draw in moves:
        waiting = session.pending
        try:
            do(session, kind, draw)
        except InputError as refusal:
            assert "\n" not in str(refusal)
            assert session.pending == waiting  # nothing is queued, nothing is lost
    text = session.scenario.to_toml()
    again = Scenario.from_toml(text)
    assert again == session.scenario
    assert again.years == max(len(session.records), 1)
    assert_same_years(session.records, steps(Stand(again), len(session.records)))


@pytest.fixture(scope="module")
def worked() -> LiveSession:
    """A session of all kinds of acts, beyond the years of its scenario."""
    session = LiveSession(tiny(*SETTINGS))
    session.act(kind="plant", x_m=[5.0], y_m=[5.0], species="pinus_sylvestris")
    for _ in range(3):
        session.step()
    session.act(kind="fell", tree_ids=[2], cause="thinning")
    session.act(kind="prune", all_trees=True, below_share=0.4)
    session.act(kind="mark", tree_ids=[3], mark="crop")
    roof = {"kind": "box", "name": "roof", "min_m": [0, 0, 5], "max_m": [2, 2, 6]}
    session.act(kind="obstacle", add=roof)
    session.act(kind="stroke", points_m=[[5, 5, 1]], radius_m=0.5)
    to = session.skeleton(3).end[1] + np.array([0.02, 0.01, 0.0])
    session.act(kind="bend", tree_id=3, metamer=1, to_m=to.tolist())
    session.act(kind="crack", tree_id=3, height_m=0.1, azimuth_deg=40.0)
    session.step()
    session.act(
        kind="harvest", method="gap", gap={"kind": "circle", "x_m": 3, "y_m": 3, "radius_m": 2}
    )
    session.step()
    return session


def test_its_run_file_is_the_headless_one(worked: LiveSession, tmp_path: Path) -> None:
    worked.write_run(tmp_path / "live.h5")
    worked.save(tmp_path / "session.toml")
    scenario = Scenario.load(tmp_path / "session.toml")
    assert scenario.years == 5
    run, live = simulate(scenario, tmp_path / "run.h5"), open_run(tmp_path / "live.h5")
    assert_same_runs(run, live)
    assert live.complete
    assert live.scenario == run.scenario
    assert live.digest == run.digest
    kinds = {"planted", "died", "felled", "pruned", "marked", "bent", "cracked"}
    assert set(run.events.kind) >= kinds - {"died"}
    assert set(run.treatments.kind) == set(ACT_KINDS)
    tables = worked.tables
    assert tables.keys() == set(run.tables)
    for name, frame in tables.items():
        assert_frame_equal(frame, run.read(name), check_exact=True)
    with pytest.raises(InputError, match="exists already"):
        worked.write_run(tmp_path / "live.h5")


def test_its_run_file_has_the_surfaces_that_were_asked_for(tmp_path: Path) -> None:
    scenario = tiny("output.sample_trees={ids=[1, 4], meshes='ply'}", "years=2")
    session = LiveSession(scenario)
    session.step(), session.step()
    session.write_run(tmp_path / "live.h5")
    simulate(session.scenario, tmp_path / "run.h5").close()
    written = sorted((tmp_path / "run_meshes").iterdir())
    assert written
    for path in written:
        assert (tmp_path / "live_meshes" / path.name).read_bytes() == path.read_bytes()


def test_before_the_first_step(tmp_path: Path) -> None:
    session = LiveSession(tiny(*SETTINGS), save_to=tmp_path / "session.toml")
    assert (session.year, session.next_year, session.scenario.years) == (2000, 2001, 1)
    assert session.tables["trees"].empty
    with pytest.raises(InputError, match="no year is done"):
        session.write_run(tmp_path / "run.h5")
    session.act(kind="fell", tree_ids=[2])
    trees = session.trees()
    assert trees.pending[trees.tree_id == 2].tolist() == ["fell"]
    assert set(trees.pending[trees.tree_id != 2]) == {""}
    (felling,) = Scenario.load(tmp_path / "session.toml").acts[2:]
    assert (felling.kind, felling.year) == ("fell", 2001)
    session.undo()
    assert session.pending == ()
    assert len(Scenario.load(tmp_path / "session.toml").acts) == 2
    with pytest.raises(InputError, match="no act is pending"):
        session.undo()


def test_the_shape_to_come() -> None:
    """A pruning that waits shows at once, and comes out as it was shown."""
    session = LiveSession(tiny())
    for _ in range(5):
        session.step()
    before = session.skeleton(4)
    branch = int(before.serial[np.flatnonzero(before.order == 1)[0]])
    session.act(kind="prune", tree_id=4, metamer=branch)
    shown = session.skeleton(4)
    assert branch not in shown.serial
    assert len(session.stand.skeleton(4)) == len(before) > len(shown)
    session.undo()
    np.testing.assert_array_equal(session.skeleton(4).serial, before.serial)
    stand = session.stand
    stand.prune(tree_id=4, metamer=branch)
    np.testing.assert_array_equal(stand.skeleton(4).serial, shown.serial)
    np.testing.assert_array_equal(stand.skeleton(4).end, shown.end)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no such tree": ({"kind": "fell", "tree_ids": [999]}, "act.tree_ids in 2001: no living tree"),
    "no such kind": ({"kind": "burn"}, "act: unknown kind 'burn'"),
    "no such key": ({"kind": "fell", "tree_id": 3}, "unknown key 'tree_id', did you mean"),
    "with a time": ({"kind": "fell", "tree_ids": [3], "year": 2009}, "act: year is given"),
    "outside": ({"kind": "plant", "x_m": [99.0], "y_m": [1.0]}, "act"),
    "the foot": ({"kind": "prune", "tree_id": 1, "metamer": 0}, "carries the whole tree 1"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_one_line(name: str) -> None:
    keys, message = REFUSED[name]
    session = LiveSession(tiny())
    before = session.scenario
    with pytest.raises(InputError, match=message) as refused:
        session.act(**keys)
    assert "\n" not in str(refused.value)
    assert session.pending == ()
    assert session.scenario == before


def test_an_act_that_cannot_be_done_leaves_the_session() -> None:
    """An act of the scenario's own may come too late; what waits stays, and can be taken back."""
    session = LiveSession(tiny("acts=[{kind='fell', year=2002, tree_ids=[99]}]"))
    session.step()
    assert session.trees().pending.eq("").all()
    with pytest.raises(ActError, match="no living tree has the id 99"):
        session.step()
    assert (session.year, len(session.records)) == (2001, 1)


def test_a_killed_session_leaves_a_whole_file(tmp_path: Path) -> None:
    scenario, saved = write_tiny(tmp_path), tmp_path / "session.toml"
    code = f"""
from forest.live import LiveSession
from forest.scenario import Scenario
session = LiveSession(Scenario.load({str(scenario)!r}), save_to={str(saved)!r})
while True:
    session.act(kind="prune", all_trees=True, below_share=0.1)
    session.act(kind="plant", x_m=[session.year % 10], y_m=[3.0], species="fagus_sylvatica")
    session.step()
"""
    child = subprocess.Popen([sys.executable, "-c", code], env=os.environ)
    seen = 0
    while child.poll() is None and seen < 3:  # the file is whole whenever it is read
        time.sleep(0.02)
        if saved.exists():
            seen = Scenario.load(saved).years
    child.send_signal(signal.SIGKILL)
    child.wait()
    whole = Scenario.load(saved)
    assert whole.years >= 3
    assert [act.kind for act in whole.acts[:2]] == ["prune", "plant"]
    assert len(steps(Stand(whole), whole.years)) == whole.years


def test_a_disk_that_refuses_loses_nothing(tmp_path: Path) -> None:
    session = LiveSession(tiny(), save_to=tmp_path / "session.toml")
    session.act(kind="fell", tree_ids=[2])
    before = (tmp_path / "session.toml").read_text()
    with pytest.raises(InputError, match="no folder"):
        session.save(tmp_path / "none" / "session.toml")
    assert (tmp_path / "session.toml").read_text() == before
    assert [path.name for path in tmp_path.iterdir()] == ["session.toml"]


def test_what_cannot_be_kept_does_not_wait_and_a_year_is_kept_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "session.toml"
    session = LiveSession(tiny(), save_to=file)
    session.act(kind="fell", tree_ids=[2])
    before = file.read_text()
    full = pytest.raises(OutputError, match="no room left")

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, "no room")

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", refuse)
        with full:
            session.act(kind="fell", tree_ids=[3])
        with full:
            session.undo()
        assert [act["tree_ids"] for act in session.pending] == [[2]]
        assert [act.kind for act in session.scenario.acts] == ["fell"]
        with full:
            session.step()
        assert (session.year, session.pending, session.kept) == (2001, (), False)
        assert file.read_text() == before
    session.keep()
    assert session.kept
    assert Scenario.load(file) == session.scenario
