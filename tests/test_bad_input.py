"""Whatever a user gets wrong: one line, exit code 2, no traceback, nothing on disk changed."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import pytest
from hypothesis import given, settings

from forest.record.run import open_run
from tests.scenario.test_fuzz import CSV, TOML, mutated
from tests.tiny import TOML as TINY
from tests.tiny import forest, write_tiny

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario and its finished run of two years."""
    folder = tmp_path_factory.mktemp("made")
    code, _, err = forest("run", write_tiny(folder), "--years", 2, "--out", folder / "run.h5")
    assert code == 0, err
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of it, for one test."""
    return Path(shutil.copytree(made, tmp_path / "copy"))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def refused(folder: Path, *words: str | Path | int, says: str) -> None:
    """Check the refusal, and that the folder is as it was."""
    before = contents(folder)
    code, out, err = forest(*map(str, words))
    assert (code, out) == (2, ""), (code, out, err)
    assert len(err.splitlines()) == 1
    assert err.startswith("forest: error: ")
    assert says in err
    assert contents(folder) == before


def test_climate(folder: Path) -> None:
    """A bad climate is refused before the run file is touched, also on the way to resume it."""
    (folder / "years.csv").write_text("year,growth_index\n2001,0.9\n2002,wet\n")
    says = "climate.file: 'years.csv' line 3, column 'growth_index': 'wet' is not allowed"
    words = ["--set", "climate.file=years.csv", "--out", folder / "run.h5"]
    refused(folder, "run", folder / "tiny.toml", *words, "--force", says=says)
    refused(folder, "run", folder / "tiny.toml", *words, "--resume", says=says)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("years =", "yeers =", "did you mean 'years'?"),
        ("years = 8", 'years = "many"', "years"),
        ("years = 8", "years = -3", "years"),
        ("years = 8", "years = nan", "years"),
        ("years = 8", "years = [", "not TOML"),
        ("size_m", "sise_m", "did you mean 'size_m'?"),
        ("output =", "mechanics = { bendng = true }\noutput =", "did you mean 'bending'?"),
        ("output =", "mechanics = { righting = 'strian' }\noutput =", '"strain" | "beta" | "none"'),
        ("output =", "mechanics = { tolerance_rad = 0 }\noutput =", "expected number, 1e-09 to"),
        ("output =", "mechanics = { wind_m_s = -3 }\noutput =", "expected number, 0 to 100"),
        ("output =", "mechanics = true\noutput =", "mechanics: True is not allowed"),
        ("[10, 10]", "[10, 0]", "plot.size_m"),
        ("periodic", "torus", "plot.boundary"),
        ("0.15", "-0.15", "climate.noise_sd"),
        ("pinus_sylvestris", "pinus_silvestris", "did you mean 'pinus_sylvestris'?"),
        ("density_ha = 1000", "density_ha = 1e300", "planting.density_ha"),
        ("checkpoint_every_years = 3", "checkpoint_every_years = 0", "checkpoint_every_years"),
    ],
)
def test_scenario(folder: Path, old: str, new: str, says: str) -> None:
    path = folder / "wrong.toml"
    assert old in TINY
    path.write_text(TINY.replace(old, new, 1))
    refused(folder, "run", path, "--out", folder / "new.h5", says=says)
    refused(folder, "check", path, says="wrong.toml")


@pytest.mark.parametrize(
    ("act", "says"),
    [
        ("kind = 'fell', year = 1999, tree_ids = [1]", "acts[0].year: 1999 is not a year"),
        ("kind = 'fell', year = 2001, tree_ids = [99]", "acts[0].tree_ids in 2001: no living tree"),
        ("kind = 'prune', year = 2001, tree_id = 1, metamer = 7", "acts[0].metamer in 2001"),
        ("kind = 'prune', year = 2001, tree_id = 1, below = 1", "did you mean 'below_m'?"),
        ("kind = 'plant', year = 2001, x_m = [1], y_m = [99], species = 'x'", "acts[0].species[0]"),
    ],
)
def test_acts(folder: Path, act: str, says: str) -> None:
    """What is wrong in the first year is known before a file is written."""
    (folder / "acts.toml").write_text(TINY + f"acts = [{{ {act} }}]")
    refused(folder, "run", folder / "acts.toml", "--out", folder / "new.h5", says=says)


def test_an_act_that_fails_in_its_year_loses_no_year(folder: Path) -> None:
    path, out = folder / "acts.toml", folder / "new.h5"
    path.write_text(TINY + "acts = [{ kind = 'fell', year = 2004, tree_ids = [99] }]")
    code, _, err = forest("run", path, "--out", out)
    assert code == 2
    assert [line for line in err.splitlines() if "error" in line] == [
        "forest: error: acts[0].tree_ids in 2004: no living tree has the id 99; expected one of "
        "1, 2, 3, 4, 5, 6, 7, 8, ... (10 trees)"
    ]
    with open_run(out) as run:
        assert run.years.tolist() == [2001, 2002, 2003]


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("1,1\n11,2\n", "outside the plot"),
        ("1,1\n-0.1,2\n", "outside the plot"),
        ("1,1\n2,2\n1,1\n", "stands on the spot of line 2"),
        ("0,5\n10,5\n", "stands on the spot of line 2"),
        ("1,1\nnan,2\n", "'nan'"),
        ("1,1\n2,\n", "''"),
        ("1,1\n2\n", "1 columns"),
        ("", "no tree"),
    ],
)
def test_stem_map(folder: Path, rows: str, says: str) -> None:
    path = folder / "mapped.toml"
    (folder / "map.csv").write_text("x_m,y_m\n" + rows)
    planting = 'planting = { kind = "stem_map", file = "map.csv", species = "fagus_sylvatica" }'
    lines = [planting if line.startswith("planting") else line for line in TINY.splitlines()]
    path.write_text("\n".join(lines))
    refused(folder, "run", path, "--out", folder / "new.h5", says=says)


def test_missing_files(folder: Path) -> None:
    for command in ("run", "check"):
        refused(folder, command, folder / "none.toml", says="no such file")
        refused(folder, command, folder, says="is a folder")
    for command in ("info", "table"):
        refused(folder, command, folder / "none.h5", says="no such file")
    refused(folder, "run", folder / "tiny.toml", "--set", "planting.kind=stem_map", "--set",
            "planting.file=no.csv", "--out", folder / "new.h5", says="planting")  # fmt: skip


def test_output_path(folder: Path) -> None:
    scenario, run = folder / "tiny.toml", folder / "run.h5"
    refused(folder, "run", scenario, "--out", run, says="--resume to go on")
    refused(folder, "run", scenario, "--out", folder, says="is not a file")
    refused(folder, "run", scenario, "--out", folder / "no" / "x.h5", says="no folder")
    refused(folder, "run", scenario, "--out", scenario / "x.h5", says="no folder")
    refused(folder, "run", scenario, "--out", "/proc/x.h5", says="/proc/x.h5: cannot be written")
    refused(folder, "run", scenario, "--out", run, "--force", "--resume", says="one of them")


def test_options(folder: Path) -> None:
    scenario, out = folder / "tiny.toml", folder / "new.h5"
    for words, says in (
        (["--years", 0], "--years"),
        (["--years", 1.5], "--years"),
        (["--years", 10**9], "years"),
        (["--seed", -1], "--seed"),
        (["--seed", 10**30], "seed"),
        (["--threads", 0], "--threads"),
        (["--threads", 9999], "9999 threads"),
        (["--set", "plot.sise=3"], "plot"),
        (["--set", "plot.size_m=wide"], "plot.size_m"),
        (["--set", "years"], "is not an override"),
        (["--yers", 3], "--yers"),
        (["again.toml"], "again.toml"),
    ):
        refused(folder, "run", scenario, "--out", out, *words, says=says)
    refused(folder, "rnu", scenario, says="Did you mean 'run'?")
    refused(folder, "run", says="SCENARIO")


def test_run_files(folder: Path) -> None:
    run, wrong = folder / "run.h5", folder / "wrong.h5"
    whole = run.read_bytes()
    with h5py.File(folder / "other.h5", "w") as file:
        file["x"] = 1
    refused(folder, "info", folder / "other.h5", says="not a run file")
    for data, says in (
        (b"", "is empty"),
        (b"noise" * 1000, "not a run file"),
        (whole[:100], "cut short"),
        (whole[: len(whole) // 3], "cut short"),
        (whole[:-2], "cut short"),
    ):
        wrong.write_bytes(data)
        for command in ("info", "table"):
            refused(folder, command, wrong, says=says)
        refused(folder, "export", wrong, "--table", "trees", "--to", folder / "x.csv", says=says)
        refused(folder, "picture", wrong, "--to", folder / "x.png", says=says)
        refused(folder, "run", folder / "tiny.toml", "--out", wrong, "--resume", says=says)


def test_export(folder: Path) -> None:
    run = folder / "run.h5"
    refused(folder, "export", run, "--table", "treez", "--to", folder / "x.csv", says="'trees'")
    refused(folder, "export", run, "--table", "trees", "--to", folder / "x.xls", says=".parquet")
    refused(folder, "export", run, "--table", "trees", "--to", folder, says="")
    refused(folder, "export", run, "--table", "trees", "--to", folder / "no/x.csv", says="no/x.csv")
    (folder / "x.csv").write_text("mine")
    refused(folder, "export", run, "--table", "trees", "--to", folder / "x.csv", says="exists")


def test_picture(folder: Path) -> None:
    run = folder / "run.h5"
    refused(folder, "picture", run, says="--to FILE.png")
    refused(folder, "picture", run, "--to", folder / "x.gif", says=".png")
    refused(folder, "picture", run, "--to", folder / "no" / "x.png", says="x.png")
    (folder / "x.png").write_text("mine")
    refused(folder, "picture", run, "--to", folder / "x.png", says="exists")
    for checkpoint in folder.glob("*.npz"):
        checkpoint.unlink()
    refused(folder, "picture", run, "--to", folder / "y.png", says="no checkpoint beside it")


def test_resume_with_another_scenario(folder: Path) -> None:
    words = "run", folder / "tiny.toml", "--out", folder / "run.h5", "--resume"
    refused(folder, *words, "--seed", 2, says="different scenario")
    refused(folder, *words, "--years", 1, says="holds 2 years already")


def test_species(folder: Path) -> None:
    refused(folder, "species", "picea_abis", says="did you mean 'picea_abies'?")


def test_a_broken_mesh_in_a_process_of_its_own(folder: Path) -> None:
    """Libraries that complain on their own do so unheard."""
    mesh = folder / "rock.stl"
    mesh.write_bytes(b"not a mesh")
    answer = subprocess.run(
        [sys.executable, "-c", "from forest.cli import main; main()", "run", folder / "tiny.toml",
         "--out", folder / "new.h5", "--set", f"obstacles=[{{kind='mesh', file='{mesh}'}}]"],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    lines = answer.stderr.splitlines()
    assert answer.returncode == 2
    assert [line for line in lines if not line.startswith("compiling")] == [
        line for line in lines if line.startswith("forest: error: ") and "rock.stl" in line
    ]
    assert not (folder / "new.h5").exists()


def checked(toml: bytes, stem_map: bytes) -> None:
    """Give both files to `forest check`: a summary, or one line."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "map.csv").write_bytes(stem_map)
        path = Path(folder) / "stand.toml"
        path.write_bytes(toml)
        code, out, err = forest("check", path)
    if code == 0:
        assert out.startswith("title")
        assert not err
    else:
        assert (code, out, len(err.splitlines())) == (2, "", 1)
        assert err.startswith("forest: error: ")


@settings(max_examples=60)
@given(mutated(TOML))
def test_spoilt_toml(toml: bytes) -> None:
    checked(toml, CSV)


@settings(max_examples=40)
@given(mutated(CSV))
def test_spoilt_csv(stem_map: bytes) -> None:
    checked(TOML, stem_map)
