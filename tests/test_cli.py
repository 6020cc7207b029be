"""The commands, as a user types them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba
import pandas as pd
import pytest
from typer.main import get_command

from forest import __version__
from forest.cli import app
from forest.record.run import open_run
from tests.tiny import forest, tiny, write_tiny

ROOT = Path(__file__).parents[1]
COMMANDS: dict[str, Any] = vars(get_command(app))["commands"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario and its run."""
    folder = tmp_path_factory.mktemp("cli")
    code, _, err = forest("run", write_tiny(folder), "--out", folder / "run.h5")
    assert code == 0, err
    return folder


def call(*words: str | Path, folder: Path, stdout: Any = subprocess.PIPE) -> Any:
    return subprocess.run(
        [sys.executable, "-c", "from forest.cli import main; main()", *words],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_help_teaches(name: str) -> None:
    code, out, _ = forest(name, "--help")
    assert code == 0
    assert f"forest {name}" in out.split("Usage", 1)[1].split("\n", 1)[1] or name == "version"


def test_the_package_is_the_command(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "forest", "version"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.stdout == forest("version")[1]


def test_no_command_is_help() -> None:
    assert forest() == forest("--help")
    assert all(name in forest()[1] for name in COMMANDS)


def test_help_takes_less_than_half_a_second(tmp_path: Path) -> None:
    """In processor time, which other processes do not stretch."""
    before = os.times()
    assert call("--help", folder=tmp_path).returncode == 0
    after = os.times()
    used = after.children_user + after.children_system
    assert used - before.children_user - before.children_system < 0.5


def test_version() -> None:
    assert forest("version") == (0, f"forest {__version__}\n", "")


def test_run_prints_the_stand_table(folder: Path) -> None:
    code, out, err = forest("run", folder / "tiny.toml", "--out", folder / "again.h5")
    assert code == 0
    assert "Htop" in out
    assert "2008" in out
    assert out.splitlines()[-1] == f"{folder / 'again.h5'} holds 8 years"
    assert "year 8 of 8, 10 trees" in err
    assert forest("table", folder / "again.h5")[1] == out[: out.rindex(str(folder))]


def test_options_are_overrides_on_record(folder: Path) -> None:
    out = folder / "other.h5"
    words = "--years", "2", "--seed", "5", "--threads", "1", "--set", "site.productivity=1.5"
    code, _, err = forest("run", folder / "tiny.toml", "--out", out, "--no-progress", *words)
    assert (code, err) == (0, "")
    with open_run(out) as run:
        assert run.scenario == tiny("years=2", "seed=5", "site.productivity=1.5")
        session = run.provenance["sessions"][0]
        assert session["environment"]["threads"] == 1
        assert session["command"][:3] == ["forest", "run", str(folder / "tiny.toml")]
        assert "site.productivity=1.5" in session["command"]


def test_run_file_is_named_after_the_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_tiny(tmp_path)
    assert forest("run", "tiny.toml", "--years", "1")[0] == 0
    assert (tmp_path / "tiny.h5").is_file()
    assert forest("run", "tiny.toml", "--years", "2", "--force")[0] == 0
    with open_run(tmp_path / "tiny.h5") as run:
        assert len(run.years) == 2


def test_resume_of_a_finished_run_says_so(folder: Path) -> None:
    words = "run", folder / "tiny.toml", "--out", folder / "run.h5", "--resume", "--no-progress"
    code, out, err = forest(*words)
    assert code == 0
    assert "complete; nothing to do" in err
    assert "holds 8 years" in out


def test_a_run_that_has_to_compile_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def compiles(tell: Callable[[], None]) -> Iterator[None]:
        tell()
        yield

    monkeypatch.setattr("forest.simulation.announce_compiling", compiles)
    words = "run", write_tiny(tmp_path), "--years", "1", "--out", tmp_path / "x.h5"
    assert "compiling kernels" in forest(*words)[2].splitlines()[0]


def test_compiling_is_announced_once() -> None:
    from forest._jit import announce_compiling

    told: list[bool] = []
    with announce_compiling(lambda: told.append(True)):
        add = numba.njit(lambda x: x + 1)
        assert (add(1), add(1.5)) == (2, 2.5)
    assert told == [True]
    with announce_compiling(lambda: told.append(True)):
        assert add(2) == 3
    assert told == [True]


def test_stopped_run_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from forest.simulation import Interrupted

    def stops(*_: Any, **__: Any) -> None:
        raise Interrupted("stopped after 2004; go on with the same command and --resume")

    monkeypatch.setattr("forest.simulation.simulate", stops)
    code, out, err = forest("run", write_tiny(tmp_path), "--out", tmp_path / "x.h5")
    assert (code, out) == (130, "")
    assert err == "forest: stopped after 2004; go on with the same command and --resume\n"


def test_check_sums_up(folder: Path) -> None:
    code, out, _ = forest("check", folder / "tiny.toml", "--set", "plot.boundary=open")
    said = dict(line.split(maxsplit=1) for line in out.splitlines())
    assert code == 0
    assert said["plot"] == "10 x 10 m, open"
    assert said["trees"].endswith("(1,000 per ha)")
    assert said["years"] == "8 (2001 to 2008)"
    assert said["environment"] == "shadow + canopy"
    assert said["mode"] == "mass_balance"
    assert said["sha256"] == tiny("plot.boundary=open").digest()


def test_info(folder: Path) -> None:
    code, out, _ = forest("info", folder / "run.h5")
    assert code == 0
    assert "complete" in out
    assert "2001 to 2008 (8)" in out


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_export(folder: Path, tmp_path: Path, suffix: str) -> None:
    to = tmp_path / f"trees.{suffix}"
    words = "export", folder / "run.h5", "--table", "trees", "--to", to
    code, out, _ = forest(*words)
    assert (code, out) == (0, f"{to}: 80 rows\n")
    frame = pd.read_csv(to) if suffix == "csv" else pd.read_parquet(to)
    with open_run(folder / "run.h5") as run:
        assert frame.tree_id.tolist() == run.trees.tree_id.tolist()
    assert forest(*words)[0] == 2
    assert forest(*words, "--force")[0] == 0


def test_species() -> None:
    code, out, _ = forest("species")
    assert code == 0
    assert "picea_abies          Norway spruce (conifer)" in out.splitlines()
    code, out, _ = forest("species", "picea_abies")
    assert code == 0
    for text in ("internode_length_m", "density_kg_m3", "377.0", "kg/m3", "source"):
        assert text in out


def test_picture(folder: Path, tmp_path: Path) -> None:
    stand, development = tmp_path / "stand.png", tmp_path / "development.png"
    words = "picture", folder / "run.h5", "--to", stand, "--development", development
    code, out, err = forest(*words)
    assert (code, err) == (0, "")
    assert f"{stand}: 10 trees in 2008" in out
    for path in (stand, development):
        assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("words", [["version"], ["species", "picea_abies"]])
def test_reader_that_leaves_hears_no_complaint(tmp_path: Path, words: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        answer = call(*words, folder=tmp_path, stdout=write)
    finally:
        os.close(write)
    assert (answer.returncode, answer.stderr) == (1, "")


def test_the_climate_of_a_run(folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "climate.csv"
    sets = ["--set", "climate.generator.drought_index={mean=0, sd=1}"]
    code, summary, err = forest("check", folder / "tiny.toml", *sets)
    assert (code, err) == (0, "")
    assert "drought_index, growth_index drawn" in summary
    assert forest("run", folder / "tiny.toml", "--out", tmp_path / "x.h5", *sets)[0] == 0
    assert forest("export", tmp_path / "x.h5", "--table", "climate", "--to", table)[0] == 0
    first, *rows = table.read_text().splitlines()
    columns = "temperature_c,precipitation_mm,drought_index,growth_index,factor"
    assert first == f"year,species,{columns}"
    assert len(rows) == 16


def test_a_stand_that_bends(folder: Path, tmp_path: Path) -> None:
    out, table = tmp_path / "bent.h5", tmp_path / "stability.csv"
    sets = ["--set", "mechanics={wind_m_s=15}", "--years", "4"]
    code, summary, err = forest("check", folder / "tiny.toml", *sets[:2])
    assert (code, err) == (0, "")
    assert "bending, righting strain, wind 15 m/s" in summary
    assert forest("run", folder / "tiny.toml", "--out", out, *sets)[0] == 0
    assert "stability (40)" in forest("info", out)[1]
    assert forest("table", out)[0] == 0
    assert forest("export", out, "--table", "stability", "--to", table)[0] == 0
    first, *rows = table.read_text().splitlines()
    assert first.startswith("year,tree_id,species,safety_factor,")
    assert len(rows) == 40
