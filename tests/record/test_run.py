"""What is written is what is read, and only what is asked for is read."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

from forest.errors import InputError
from forest.record.export import export, info
from forest.record.run import Run, open_run
from forest.record.schema import ALL_TABLES, columns_markdown
from forest.record.writer import RunWriter
from tests.record.years import FIRST_YEAR, PLANTED, SCENARIO, SPECIES, append, create, make_year


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.h5"
    writer = create(path)
    append(writer, FIRST_YEAR, FIRST_YEAR + 9)
    writer.finish()
    return path


@pytest.fixture
def run(path: Path) -> Run:
    return open_run(path)


@pytest.mark.parametrize("table", ["trees", "stand", "events", "rings", "carbon"])
def test_tables_come_back(run: Run, table: str) -> None:
    frame = getattr(run, table)
    years = [make_year(year)[table] for year in run.years]
    for column in ALL_TABLES[table].with_species(SPECIES).columns:
        written = np.concatenate([year[column.name] for year in years])
        if column.levels:
            assert list(frame[column.name].cat.categories) == list(column.levels)
            assert np.array_equal(frame[column.name].cat.codes, written)
        else:
            assert frame[column.name].dtype == column.dtype
            assert np.array_equal(frame[column.name], written)


def test_population_is_a_table(run: Run) -> None:
    population = run.population
    assert population["planted"].tolist() == [PLANTED] + [0] * 9
    assert population["died"].tolist() == [0] + [1] * 9
    assert population["living"].tolist() == list(range(PLANTED, PLANTED - 10, -1))
    assert population["living_before"].tolist() == [0, *population["living"][:-1]]


def test_plain_h5py_reads_beside_an_open_run(run: Run, path: Path) -> None:
    with h5py.File(path) as file:
        assert file["population/living"][0] == PLANTED
        assert file["trees/height_m"].attrs["units"] == "m"


def test_missing_numbers_are_nan_and_codes_have_names(tmp_path: Path) -> None:
    tables = make_year(FIRST_YEAR)
    tables["trees"]["dbh_cm"][:3] = np.nan
    with create(tmp_path / "run.h5") as writer:
        writer.append_year(FIRST_YEAR, tables)
    with open_run(tmp_path / "run.h5") as run:
        assert run.trees["dbh_cm"].isna().sum() == 3
        assert set(run.events["kind"]) == {"planted"}
        assert run.stand["species"].tolist() == [*SPECIES, "all"]


def test_one_column_of_some_years_reads_nothing_else(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = []
    plain = h5py.Dataset.__getitem__

    def spy(self: h5py.Dataset, key: object) -> object:
        read.append((self.name, key))
        return plain(self, key)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", spy)
    frame = run.read("trees", ["height_m"], years=(FIRST_YEAR + 1, FIRST_YEAR + 2))
    assert read == [("/trees/height_m", slice(30, 30 + 29 + 28))]
    written = [make_year(year)["trees"]["height_m"] for year in (FIRST_YEAR + 1, FIRST_YEAR + 2)]
    assert np.array_equal(frame["height_m"], np.concatenate(written))


@pytest.mark.parametrize(
    ("years", "rows"),
    [((1900, 1999), 0), ((1990, FIRST_YEAR), 30), ((2008, 2050), 43), ((5, 1), 0)],
)
def test_years_outside_the_run_give_no_rows(run: Run, years: tuple[int, int], rows: int) -> None:
    assert len(run.read("rings", ["year"], years=years)) == rows


def test_unknown_names_are_refused(run: Run) -> None:
    with pytest.raises(InputError, match=r"no table 'treees'.*did you mean 'trees'"):
        run.read("treees")
    with pytest.raises(InputError, match="no column 'dbh' in 'trees'; did you mean 'dbh_cm'"):
        run.read("trees", ["dbh"])


def test_root_says_what_made_the_file(run: Run) -> None:
    assert run.scenario_toml == SCENARIO
    assert run.species_names == SPECIES
    assert run.digest == "5ca1ab1e"
    assert run.complete
    assert repr(run) == "<Run run.h5: 2000 to 2009, complete>"
    provenance = run.provenance
    assert provenance["seed"] == 7
    (session,) = provenance["sessions"]
    assert session["years_before"] == 0
    assert session["started"] <= session["finished"]
    assert session["peak_memory_bytes"] > 10_000_000
    assert session["software"]["numpy"] == np.__version__


def test_units_and_meaning_stand_in_the_file(path: Path) -> None:
    with h5py.File(path) as file:
        for name in ("trees", "population"):
            for column in ALL_TABLES[name].columns:
                attributes = file[name][column.name].attrs
                assert attributes["units"] == column.unit
                assert attributes["description"] == column.description
        assert list(file["trees/species"].attrs["levels"]) == list(SPECIES)


def test_only_the_chosen_tables_are_stored(tmp_path: Path) -> None:
    with create(tmp_path / "run.h5", tables=["stand"]) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR)
    with open_run(tmp_path / "run.h5") as run:
        assert run.tables == ("stand", "population")
        with pytest.raises(InputError, match="tables that this run stored: stand, population"):
            run.trees  # noqa: B018


def test_a_long_scenario_fits(tmp_path: Path) -> None:
    text = "trees = [\n" + "  {x_m = 1.25, y_m = 3.5},\n" * 10_000 + "]\n"
    path = tmp_path / "run.h5"
    RunWriter.create(
        path, scenario_toml=text, digest="", seed=2**63 - 1, species_names=["a"], threads=1
    ).close()
    with open_run(path) as run:
        assert run.scenario_toml == text
        assert run.provenance["seed"] == 2**63 - 1
        assert not run.complete
        assert repr(run) == "<Run run.h5: no years yet, not complete>"


def test_sample_tree_has_a_shape_in_each_year(run: Run) -> None:
    assert run.samples == (12,)
    shape = run.skeleton(12, FIRST_YEAR + 2)
    assert shape.serial.tolist() == [0, 1, 2, 3]
    assert shape.parent.tolist() == [-1, 0, 0, 1]
    assert shape.axis.tolist() == [0, 0, 1, 0]
    assert shape.order.tolist() == [0, 0, 1, 0]
    assert shape.birth_year.tolist() == [2000, 2001, 2001, 2002]
    assert shape.leafy.tolist() == [False, False, True, True]
    assert shape.start.tolist() == [[5, 7, 0], [5, 7, 1], [5, 7, 1], [5, 7, 2]]
    assert shape.end.tolist() == [[5, 7, 1], [5, 7, 2], [5.5, 7, 1], [5, 7, 3]]
    assert shape.radius == pytest.approx(0.03)
    assert (shape.tree_id, shape.species) == (12, SPECIES[1])
    assert run.skeleton(12, FIRST_YEAR + 4).serial.tolist() == [0, 1, 3, 4, 5]


def test_shapes_not_on_record_are_refused(run: Run) -> None:
    with pytest.raises(InputError, match="tree 12 is not on record in 2050; expected a year from"):
        run.skeleton(12, 2050)
    with pytest.raises(InputError, match="tree 3 is no sample tree; expected 12"):
        run.skeleton(3, 2005)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_export_round_trip(run: Run, tmp_path: Path, suffix: str) -> None:
    to = export(run, "trees", tmp_path / f"trees.{suffix}")
    back = pd.read_csv(to) if suffix == "csv" else pd.read_parquet(to)
    assert list(back.columns) == list(run.trees.columns)
    assert back["species"].tolist() == run.trees["species"].tolist()
    assert np.array_equal(back["height_m"].astype("float32"), run.trees["height_m"])
    with pytest.raises(InputError, match="exists already"):
        export(run, "trees", to)
    export(run, "stand", to, overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == [to.name]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("trees.xlsx", "unknown format '.xlsx'; expected a name that ends in .csv or .parquet"),
        ("trees", "unknown format ''"),
        ("missing/trees.csv", "cannot be written: there is no folder"),
    ],
)
def test_export_refuses(run: Run, tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        export(run, "trees", tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_info_names_what_matters(run: Run) -> None:
    lines = dict(info(run))
    assert lines["state"] == "complete"
    assert lines["years"] == "2000 to 2009 (10)"
    assert lines["sample trees"] == "12"
    assert lines["seed"] == "7"
    assert lines["tables"].startswith("trees (255), stand (30), events (39)")


def test_documentation_lists_every_column() -> None:
    page = (Path(__file__).parents[2] / "docs" / "run_file.md").read_text()
    assert columns_markdown() in page, "rewrite it: python -m forest.record.schema"
