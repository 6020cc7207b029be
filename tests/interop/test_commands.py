"""Exports as a user types them, and the script that compares what they wrote."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from analysis.compare_architecture import main as compare
from analysis.compare_architecture import measured, simulated
from forest.errors import InputError
from forest.interop import fvs_summary, read_simpleforest, read_treeqsm
from forest.record.run import open_run
from tests.tiny import forest, write_tiny


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("interop")
    code, _, err = forest("run", write_tiny(folder), "--out", folder / "run.h5", "--no-progress")
    assert code == 0, err
    return folder / "run.h5"


@pytest.mark.parametrize(
    ("form", "read"), [("simpleforest", read_simpleforest), ("treeqsm", read_treeqsm)]
)
def test_a_tree(run_file: Path, tmp_path: Path, form: str, read: object) -> None:
    to = tmp_path / "tree.txt"
    words = "export", run_file, "--tree", "1", "--as", form, "--to", to
    with open_run(run_file) as run:
        now, then = run.skeleton(1, 2008), run.skeleton(1, 2005)
    assert forest(*words) == (0, f"{to}: {len(now):,} cylinders, tree 1 in 2008\n", "")
    assert forest(*words)[0] == 2
    assert forest(*words, "--year", "2005", "--force")[0] == 0
    np.testing.assert_allclose(read(to).end, then.end, atol=2e-6)  # type: ignore[operator]


def test_a_table(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "FVS_Summary2.csv"
    words = "export", run_file, "--table", "stand", "--as", "fvs", "--to", to
    assert forest(*words) == (0, f"{to}: 8 rows\n", "")
    with open_run(run_file) as run:
        assert_frame_equal(pd.read_csv(to), fvs_summary(run), check_dtype=False)
    words = "export", run_file, "--table", "trees", "--as", "iland", "--to", tmp_path / "t.parquet"
    assert forest(*words)[0] == 0
    assert len(pd.read_parquet(tmp_path / "t.parquet")) == 80


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "nothing to export; expected --table NAME, --tree ID or --residual NAME"),
        (("--table", "stand", "--tree", "1"), "--table and --tree exclude each other"),
        (("--table", "stand", "--year", "2005"), "--year goes with --tree"),
        (("--table", "stand", "--as", "fsv"), "no form 'fsv' for a table of stand; did you mean"),
        (("--table", "rings", "--as", "fvs"), "no --as for a table of rings; expected table trees"),
        (("--tree", "1"), "no --as for a tree; one of simpleforest, treeqsm"),
        (("--tree", "2", "--as", "treeqsm"), "tree 2 is no sample tree"),
        (("--tree", "1", "--as", "treeqsm", "--year", "1999"), "tree 1 is not on record in 1999"),
    ],
)
def test_what_cannot_be_is_refused(
    run_file: Path, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    code, out, err = forest("export", run_file, "--to", tmp_path / "x.csv", *words)
    assert (code, out) == (2, "")
    assert message in err
    assert not list(tmp_path.iterdir())


def test_the_script_compares(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / "one.csv", tmp_path / "two.txt"]
    for path, form in zip(files, ("simpleforest", "treeqsm"), strict=True):
        forest("export", run_file, "--tree", "1", "--year", "2006", "--as", form, "--to", path)
    compare([str(run_file), *map(str, files), "--to", str(tmp_path / "x.png")])
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    assert "length_m" in capsys.readouterr().out
    with open_run(run_file) as run:
        assert len(simulated(run_file)) == len(run.samples)
    with pytest.raises(InputError, match=r"unknown format '\.ply'"):
        measured([tmp_path / "x.ply"])
