"""`forest measure` and `forest bucking` on a small run."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from forest.measure.gaps import gap_share
from forest.measure.products import read_products
from forest.measure.tables import buck_run, measure_run, plot_of
from forest.record.run import open_run
from forest.record.writer import RunWriter
from forest.simulation import simulate
from tests.fixed import fixed
from tests.tiny import TOML, forest, tiny, write_tiny

PRODUCTS = """name,lengths_m,top_diameter_cm,price_m3
stake,0.5 1,1,10
"""


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("measuring")
    (folder / "tiny.toml").write_text(fixed(TOML).to_toml())
    words = "--out", folder / "run.h5", "--no-progress"
    code, _, err = forest("run", folder / "tiny.toml", *words)
    assert code == 0, err
    (folder / "products.csv").write_text(PRODUCTS)
    return folder / "run.h5"


@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_a_table_of_trees(run_file: Path, tmp_path: Path, name: str) -> None:
    to = tmp_path / name
    words = "measure", run_file, "--year", "2007", "--to", to
    assert forest(*words) == (0, f"{to}: 10 trees of 2007\n", "")
    read = pd.read_csv(to) if to.suffix == ".csv" else pd.read_parquet(to)
    with open_run(run_file) as run:
        assert_frame_equal(read, measure_run(run, 2007), check_dtype=False, check_categorical=False)


def test_species_on_the_screen(run_file: Path) -> None:
    code, out, _ = forest("measure", run_file)
    assert code == 0
    *lines, gaps = out.splitlines()[2:]
    rows = {" ".join(line.split()[:-9]): line.split()[-9:] for line in lines}
    with open_run(run_file) as run:
        share = gap_share(measure_run(run, 2008), plot_of(run.scenario))
        assert f"m: {100 * share:.0f} % of the plot; " in gaps
        last = run.stand[run.stand["year"] == 2008].set_index("species")
    assert set(rows) == {"pinus sylvestris", "fagus sylvatica", "all"}
    for name, cells in rows.items():
        row = last.loc[name.replace(" ", "_")]
        assert float(cells[0]) == pytest.approx(row["n_ha"])
        assert float(cells[1]) == pytest.approx(row["basal_area_m2ha"], abs=0.051)
        assert float(cells[6]) == pytest.approx(row["volume_m3ha"], abs=0.51)


def test_logs(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "logs.csv"
    words = "bucking", run_file, "--products", run_file.parent / "products.csv"
    code, out, _ = forest(*words, "--to", to)
    logs = pd.read_csv(to)
    assert (code, out) == (0, f"{to}: {len(logs)} logs of 2008\n")
    assert set(logs["stem"]) == {"exact", "drawn"}
    code, out, _ = forest(*words)
    assert code == 0
    assert out.splitlines()[-1].split()[:2] == ["all", str(len(logs))]


def test_the_default_products_find_no_log_in_saplings(run_file: Path) -> None:
    code, out, _ = forest("bucking", run_file)
    assert code == 0
    assert out.splitlines()[-1].split() == ["all", "0", "0.00", "0"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("measure", "--year", "1999"), "no year 1999; expected a year from 2001 to 2008"),
        (("bucking", "--year", "2009"), "no year 2009; expected a year from 2001 to 2008"),
        (("measure", "--to", "x.txt"), "unknown format '.txt'"),
        (("bucking", "--products", "nowhere.toml"), "no such file 'nowhere.toml'"),
    ],
)
def test_what_cannot_be_is_refused(run_file: Path, words: tuple[str, ...], says: str) -> None:
    code, out, err = forest(words[0], run_file, *words[1:])
    assert (code, out) == (2, "")
    assert says in err
    assert len(err.splitlines()) == 1


def test_an_empty_run_is_refused(tmp_path: Path) -> None:
    """A run that was stopped in its first year holds none."""
    scenario = tiny()
    RunWriter.create(
        tmp_path / "empty.h5",
        scenario_toml=scenario.to_toml(),
        digest="",
        seed=scenario.seed,
        species_names=list(scenario.species),
        threads=1,
    ).close()
    for command in ("measure", "bucking"):
        code, _, err = forest(command, tmp_path / "empty.h5")
        assert code == 2
        assert "no year on file yet" in err


def test_trees_alone_cannot_be_bucked(tmp_path: Path) -> None:
    words = "--set", 'output.tables=["trees"]', "--years", "2", "--no-progress"
    forest("run", write_tiny(tmp_path), "--out", tmp_path / "bare.h5", *words)
    code, _, err = forest("bucking", tmp_path / "bare.h5")
    assert code == 2
    assert "no table 'rings'" in err


def test_drawn_logs_are_near_the_exact_ones(run_file: Path) -> None:
    """Of a sample tree both can be cut; saplings are the worst case, thin and steeply tapered."""
    bare = ("output.sample_trees.ids=[]", "output.sample_trees.dbh_quantiles=[]")
    products = read_products(run_file.parent / "products.csv")
    bare_file = run_file.parent / "bare.h5"
    with simulate(fixed(TOML, *bare), out=bare_file) as without, open_run(run_file) as run:
        drawn, mixed = buck_run(without, 2008, products), buck_run(run, 2008, products)
    assert (drawn["stem"] == "drawn").all()
    exact = mixed[mixed["stem"] == "exact"].groupby("tree_id")["volume_m3"].sum()
    assert set(exact.index) == set(run.samples) & set(mixed["tree_id"])
    same = drawn[drawn["tree_id"].isin(exact.index)].groupby("tree_id")["volume_m3"].sum()
    assert same.to_numpy() == pytest.approx(exact.to_numpy(), rel=0.3)
    others = mixed[mixed["stem"] == "drawn"].reset_index(drop=True)
    left = drawn[~drawn["tree_id"].isin(exact.index)].reset_index(drop=True)
    assert_frame_equal(others, left, check_dtype=False)
