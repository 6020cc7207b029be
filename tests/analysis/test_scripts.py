"""Every script on a run file: a figure, numbers, and one line where there is nothing to draw."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from forest.record.run import Run
from forest.simulation import simulate
from tests.tiny import tiny

ROOT = Path(__file__).parents[2]
SCRIPTS = {
    "ring_series": "autocorrelation",
    "stem_analysis": "stem_height_m",
    "pressler": "area_ratio",
    "diameter_distribution": "scale_cm",
    "succession": "peak_share",
    "social_classes": "slenderness",
    "growth_dominance": "gini_volume",
    "self_thinning": "slope",
    "climate_rings": "driest_year",
    "old_growth": "gap_share",
    "drawn_stems": "worth_ratio",
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_draws_and_prints(
    name: str, dense_run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    to = tmp_path / "figure.png"
    importlib.import_module(f"analysis.{name}").main([str(dense_run.path), "--to", str(to)])
    assert to.read_bytes().startswith(b"\x89PNG")
    heading, *rows = capsys.readouterr().out.splitlines()
    assert SCRIPTS[name] in heading.split()
    assert rows


def test_a_script_starts_as_a_file(dense_run: Run, tmp_path: Path) -> None:
    to = tmp_path / "figure.svg"
    words = [ROOT / "analysis" / "succession.py", dense_run.path, "--to", to]
    made = subprocess.run([sys.executable, *map(str, words)], cwd=tmp_path, capture_output=True)
    assert made.returncode == 0, made.stderr
    assert b"<svg" in to.read_bytes()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("ring_series", "has no rings at 1.3 m"),
        ("climate_rings", "has no rings at 1.3 m"),
        ("pressler", "has no tree with 3 discs below its crown"),
        ("diameter_distribution", "has no year with 15 trees that have a dbh"),
        ("social_classes", "has no tree of 1.3 m"),
        ("succession", "has no tree of 1.3 m"),
        ("self_thinning", "has no tree of 1.3 m"),
        ("stem_analysis", "has no tree that reaches 1.3 m"),
        ("old_growth", "has no tree of 5 cm"),
        ("growth_dominance", "has no five years that 5 trees lived through"),
        ("drawn_stems", "has no living sample tree of 1.3 m"),
    ],
)
def test_a_stand_of_seedlings_is_refused(
    name: str, says: str, seedlings: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main = importlib.import_module(f"analysis.{name}").main
    with pytest.raises(SystemExit) as end:
        main([str(seedlings), "--to", str(seedlings.parent / "x.png")])
    assert end.value.code == 2
    assert capsys.readouterr().err == f"error: {seedlings}: {says}; expected an older stand\n"
    assert not (seedlings.parent / "x.png").exists()


def test_a_target_may_be_given(
    dense_run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main = importlib.import_module("analysis.old_growth").main
    words = [str(dense_run.path), "--to", str(tmp_path / "figure.png")]
    main([*words, "--largest", "30", "--q", "1.2", "--basal-area", "20", "--big", "15"])
    near = capsys.readouterr().out.splitlines()
    main(words)
    assert near[0] == capsys.readouterr().out.splitlines()[0]
    with pytest.raises(SystemExit) as end:
        main([*words, "--largest", "33"])
    assert end.value.code == 2
    assert "do not fill 5 to 33 cm" in capsys.readouterr().err


@pytest.fixture(scope="module")
def seedlings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("young") / "run.h5"
    simulate(tiny("years=1"), path).close()
    return path


@pytest.mark.parametrize(
    ("of", "to", "says"),
    [
        ("none.h5", "x.png", "none.h5"),
        ("", "x.xyz", "unknown format '.xyz'; expected .png, .pdf or .svg"),
        ("", "nowhere/x.png", "cannot be written"),
    ],
)
def test_files_that_are_none(
    of: str, to: str, says: str, dense_run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main = importlib.import_module("analysis.succession").main
    run = tmp_path / of if of else dense_run.path
    with pytest.raises(SystemExit) as end:
        main([str(run), "--to", str(tmp_path / to)])
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert said.startswith("error: ")
    assert says in said
