"""Runs that are stopped, resumed, extended, refused: what happens to the file."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

import forest
from forest._threads import thread_count
from forest.errors import InputError
from forest.progress import Silent
from forest.record.checkpoint import checkpoint_paths, remove_checkpoints
from forest.record.run import open_run
from forest.simulation import Interrupted, simulate
from forest.stand import Stand
from tests.tiny import YEARS, assert_same_runs, tiny


class Signals(Silent):
    """Sends this process a signal, so many times, at the end of a year; keeps what is said."""

    def __init__(self, number: int, at: int, times: int = 1) -> None:
        self.said: list[str] = []
        self._number, self._at, self._times = number, at, times

    def say(self, message: str) -> None:
        self.said.append(message)

    def year_done(self, stand: Stand) -> None:
        if stand.steps == self._at:
            for _ in range(self._times):
                os.kill(os.getpid(), self._number)


class Listens(Silent):
    """Keeps what is said."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def say(self, message: str) -> None:
        self.said.append(message)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_after_the_year_and_resumed(tmp_path: Path, number: int) -> None:
    out = tmp_path / "run.h5"
    handler = signal.getsignal(number)
    with pytest.raises(Interrupted, match=r"2004.*--resume"):
        simulate(tiny(), out, progress=Signals(number, at=4))
    assert signal.getsignal(number) is handler
    assert checkpoint_paths(out)[-1].name.endswith("000004.npz")
    with open_run(out) as run:
        assert not run.complete
        assert run.years.tolist() == [2001, 2002, 2003, 2004]
        assert run.provenance["sessions"][0]["elapsed_s"] is not None
    with simulate(tiny(), out, resume=True) as run, simulate(tiny(), tmp_path / "b.h5") as whole:
        assert run.complete
        assert_same_runs(run, whole)


def test_second_signal_stops_at_once(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt, match="at once"):
        simulate(tiny(), out, progress=Signals(signal.SIGINT, at=5, times=2))
    with open_run(out) as run:
        assert run.years.tolist() == [2001, 2002, 2003, 2004, 2005]
    with simulate(tiny(), out, resume=True) as run:
        assert len(run.years) == YEARS


def test_signal_in_the_last_year_changes_nothing(tmp_path: Path) -> None:
    with simulate(tiny(), tmp_path / "run.h5", progress=Signals(signal.SIGINT, at=YEARS)) as run:
        assert run.complete


def test_resume_before_the_first_checkpoint_starts_over(tmp_path: Path) -> None:
    out, hears = tmp_path / "run.h5", Listens()
    with pytest.raises(KeyboardInterrupt):
        simulate(tiny(), out, progress=Signals(signal.SIGINT, at=2, times=2))
    assert not checkpoint_paths(out)
    with simulate(tiny(), out, resume=True, progress=hears) as run:
        assert len(run.years) == YEARS
    assert any("starting over" in line for line in hears.said)


def test_resume_of_nothing_starts(tmp_path: Path) -> None:
    with simulate(tiny(), tmp_path / "run.h5", resume=True) as run:
        assert run.complete


def test_resume_of_a_finished_run_says_so(tmp_path: Path) -> None:
    out, hears = tmp_path / "run.h5", Listens()
    simulate(tiny(), out).close()
    before = out.read_bytes()
    with simulate(tiny(), out, resume=True, progress=hears) as run:
        assert run.complete
    assert any("complete" in line for line in hears.said)
    assert out.read_bytes() == before


@pytest.mark.parametrize("change", ["seed=9", "site.productivity=2", "years=3", "mode=paper"])
def test_resume_with_another_scenario_is_refused(tmp_path: Path, change: str) -> None:
    out = tmp_path / "run.h5"
    simulate(tiny("years=5"), out).close()
    before = out.read_bytes()
    with pytest.raises(InputError, match="--resume"):
        simulate(tiny("years=5", change), out, resume=True)
    assert out.read_bytes() == before
    assert checkpoint_paths(out)


def test_a_climate_may_go_on_when_a_run_is_resumed(tmp_path: Path) -> None:
    """New years of a series are no other scenario; other values of years on file are."""

    def series(values: list[float]) -> str:
        rows = (f"{{year = {2001 + k}, growth_index = {v}}}" for k, v in enumerate(values))
        return f"climate.series=[{', '.join(rows)}]"

    out, values = tmp_path / "run.h5", [1.0, 0.5, 1.1, 0.9, 1.0, 0.4]
    samples = "output.sample_trees={}"
    simulate(tiny("years=4", series(values[:4]), samples), out).close()
    with pytest.raises(InputError, match="different scenario"):
        simulate(tiny("years=6", series([0.9, *values[1:]]), samples), out, resume=True)
    longer = tiny("years=6", series(values), samples)
    with simulate(longer, out, resume=True) as run, simulate(longer, tmp_path / "b.h5") as whole:
        assert_same_runs(run, whole)
        assert run.climate["growth_index"].tolist() == [v for v in values for _ in range(2)]
        assert run.scenario == longer


def test_a_lengthened_run_gets_storms_and_deaths_in_its_new_years(tmp_path: Path) -> None:
    """The same deaths on other lines are the same; a storm that has blown cannot be had anew."""
    out, deaths = tmp_path / "run.h5", tmp_path / "deaths.csv"
    events, samples = f"mortality.events='{deaths}'", "output.sample_trees={}"

    def storms(*years: int) -> str:
        blown = ", ".join(f"{{year = {year}, speed_m_s = 100}}" for year in years)
        return f"wind={{from_height_m = 0.1, storms = [{blown}]}}"

    deaths.write_text("year,share,tree_id\n2003,0.2,\n2003,0.3,\n2002,,3\n")
    simulate(tiny("years=4", events, samples), out).close()
    dry = "climate.extreme_years=[{year = 2005, factor = 0.3}]"
    for refused in (storms(2004), dry.replace("2005", "2004")):
        with pytest.raises(InputError, match=r"different scenario.*deaths, storms and climate"):
            simulate(tiny("years=6", events, refused, samples), out, resume=True)
    deaths.write_text("year,share,tree_id\n\n2002,,3\n2003,0.3,\n2003,0.2,\n")
    with pytest.raises(InputError, match="different scenario"):  # other trees are drawn
        simulate(tiny("years=6", events, samples), out, resume=True)
    deaths.write_text("year,share,tree_id\n\n2002,,3\n2003,0.2,\n2003,0.3,\n2005,0.1,\n")
    longer = tiny("years=6", events, dry, storms(2006), samples)
    with simulate(longer, out, resume=True) as run, simulate(longer, tmp_path / "b.h5") as whole:
        assert_same_runs(run, whole)
        assert run.scenario == longer
        assert set(run.storms.year) == {2006}


def test_resume_without_its_checkpoints_is_refused(tmp_path: Path) -> None:
    """Starting over would lose years that cannot be had back without growing them again."""
    out = tmp_path / "run.h5"
    simulate(tiny("years=5"), out).close()
    remove_checkpoints(out)
    before = out.read_bytes()
    with pytest.raises(InputError, match="checkpoints are gone"):
        simulate(tiny(), out, resume=True)
    assert out.read_bytes() == before


def test_broken_checkpoint_falls_back_on_the_one_before(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    simulate(tiny(), out).close()
    older, newest = checkpoint_paths(out)
    newest.write_bytes(newest.read_bytes()[:-2])
    with simulate(tiny("years=10"), out, resume=True) as run:
        assert run.provenance["sessions"][-1]["years_before"] == int(older.stem[-6:])
        with simulate(tiny("years=10"), tmp_path / "whole.h5") as whole:
            assert run.trees.equals(whole.trees)


@pytest.mark.filterwarnings("ignore:The VTK reader")
def test_a_stand_that_cannot_be_built_leaves_the_old_run(tmp_path: Path) -> None:
    out, mesh = tmp_path / "run.h5", tmp_path / "rock.stl"
    simulate(tiny("years=1"), out).close()
    mesh.write_bytes(b"not a mesh")
    before = out.read_bytes()
    wrong = tiny(f"obstacles=[{{kind='mesh', file='{mesh}'}}]")
    with pytest.raises(InputError, match=r"rock\.stl"):
        simulate(wrong, out, overwrite=True)
    assert out.read_bytes() == before
    assert checkpoint_paths(out)


def test_overwriting_forgets_old_checkpoints(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    simulate(tiny(), out).close()
    with simulate(tiny("years=2"), out, overwrite=True) as run:
        assert len(run.years) == 2
    assert [path.name for path in checkpoint_paths(out)] == ["run.h5.checkpoint-000002.npz"]


def test_threads(tmp_path: Path) -> None:
    before = thread_count()
    with simulate(tiny("years=1"), tmp_path / "run.h5", threads=1) as run:
        assert run.provenance["sessions"][0]["environment"]["threads"] == 1
    assert thread_count() == before
    with pytest.raises(InputError, match="999 threads"):
        simulate(tiny("years=1"), tmp_path / "b.h5", threads=999)
    assert not (tmp_path / "b.h5").exists()


def test_public_names_are_not_hidden_by_modules() -> None:
    """Importing a module named like a public function would put itself in its place."""
    folder = Path(forest.__file__).parent
    for name in forest.__all__:
        assert not (folder / f"{name}.py").exists()
        assert not (folder / name).exists()
    assert forest.simulate is forest.simulate is simulate
