"""`forest rings` as a user types it."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest

from forest.dendro import read_csv, read_rwl, ring_series
from forest.record.run import Run, open_run
from tests.tiny import forest


@pytest.fixture(scope="module")
def run_file(noisy_run: Run) -> Path:
    return noisy_run.path


def test_a_disc(run_file: Path, tmp_path: Path) -> None:
    for name in ("disc.png", "disc.svg"):
        to = tmp_path / name
        code, out, err = forest("rings", run_file, "--tree", "2", "--height", "1.3", "--to", to)
        assert (code, err) == (0, "")
        assert out.startswith(f"{to}: ") and " rings of tree 2, " in out
        assert to.stat().st_size > 10_000


def test_a_trunk(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "trunk.vtp"
    words = "rings", run_file, "--tree", "1", "--to", to
    code, out, err = forest(*words)
    assert (code, err) == (0, "")
    whole = to.stat().st_size
    assert out.endswith(" cells, tree 1\n")
    assert forest(*words, "--height", "1", "--force")[0] == 0
    assert to.stat().st_size < whole


def test_cores_of_a_tree(run_file: Path, tmp_path: Path) -> None:
    words = "rings", run_file, "--tree", "2"
    assert forest(*words, "--to", tmp_path / "core.rwl")[0] == 0
    assert forest(*words, "--to", tmp_path / "core.csv")[0] == 0
    assert forest(*words, "--azimuth", "90", "--to", tmp_path / "one.csv")[0] == 0
    both, same = read_rwl(tmp_path / "core.rwl"), read_csv(tmp_path / "core.csv")
    np.testing.assert_allclose(both, same, atol=0.0011)
    assert list(same.columns) == ["T2A", "T2B"]
    with open_run(run_file) as run:
        disc = run.disc(2, 1.3)
        np.testing.assert_allclose(same["T2A"], 1000 * disc.widths_at(0.0), atol=0.0006)
    assert same.index[-1] == disc.years[-1]
    assert list(read_csv(tmp_path / "one.csv").columns) == ["T2"]


def test_all_trees_and_the_dominant_ones(run_file: Path, tmp_path: Path) -> None:
    assert forest("rings", run_file, "--to", tmp_path / "all.csv")[0] == 0
    assert forest("rings", run_file, "--dominant", "3", "--to", tmp_path / "dom.rwl")[0] == 0
    with open_run(run_file) as run:
        rings = run.rings[(run.rings["stem_height_m"] - 1.3).abs() < 1e-3]
        expected = ring_series(rings[rings["place"] == "height"]).widths
    found = read_csv(tmp_path / "all.csv")
    assert list(found.columns) == list(expected.columns)
    np.testing.assert_allclose(found, expected, atol=0.0006)
    assert read_rwl(tmp_path / "dom.rwl").shape[1] == 6


def test_years_after_the_present_are_moved(tmp_path: Path) -> None:
    start = datetime.date.today().year - 5
    scenario = tmp_path / "future.toml"
    scenario.write_text(
        f'title = "f"\nyears = 15\nstart_year = {start}\nplot = {{ size_m = [5, 5] }}\n'
        "environment = { shadow = {} }\nspecies = { pinus_sylvestris = {} }\n"
        'planting = { kind = "random", density_ha = 400 }\n'
    )
    assert forest("run", scenario, "--out", tmp_path / "run.h5", "--no-progress")[0] == 0
    to = tmp_path / "core.csv"
    code, out, _ = forest("rings", tmp_path / "run.h5", "--tree", "1", "--to", to)
    assert (code, out.splitlines()[1][:27]) == (0, "all years are 9 earlier tha")
    assert read_csv(to).index[-1] == start + 5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--to", "x.gif"), "unknown format '.gif'; expected a name that ends in .png, .svg"),
        (("--to", "x.png"), "no tree for a .png; expected --tree ID"),
        (("--tree", "1", "--dominant", "2", "--to", "x.rwl"), "--dominant takes cores of many"),
        (("--azimuth", "3", "--to", "x.rwl"), "--azimuth is of a tree's cores"),
        (("--height", "2", "--to", "x.rwl"), "no rings at 2 m; expected one of 0.3, 1.3, 5"),
        (("--year", "1949", "--to", "x.rwl"), "no year 1949; expected a year from 1950 to 2009"),
        (("--tree", "999", "--to", "x.png"), "no tree 999 ever lived in this run"),
        (("--tree", "2", "--to", "x.vtp"), "tree 2 is no sample tree"),
        (("--tree", "2", "--height", "77", "--to", "x.png"), "tree 2 has no rings at 77 m"),
    ],
)
def test_what_cannot_be_is_refused(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = forest("rings", run_file, *words)
    assert (code, out) == (2, "")
    assert message in err and len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_file_is_not_replaced_unasked(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "core.csv"
    to.write_text("mine")
    words = "rings", run_file, "--tree", "2", "--to", to
    assert forest(*words)[0] == 2
    assert to.read_text() == "mine"
    assert forest(*words, "--force")[0] == 0
