"""Tables for iLand and FVS: names, and units converted by hand."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError
from forest.interop import fvs_summary, fvs_treelist, iland_stand, iland_trees
from forest.interop.fvs import SUMMARY, TREELIST
from forest.interop.iland import STAND, TREE
from forest.interop.mapping import mapping_markdown
from forest.record.run import Run, open_run
from forest.record.schema import EVENT_KINDS
from forest.record.writer import RunWriter
from tests.record.years import Columns, rows
from tests.tiny import tiny

SPECIES = ("pinus_sylvestris", "fagus_sylvatica", "ginkgo_biloba")
PLANTED, DIED, FELLED = (EVENT_KINDS.index(kind) for kind in ("planted", "died", "felled"))


def trees(year: int, ids: list[int], **values: list[float]) -> Columns:
    columns = rows("trees", year, len(ids))
    columns["tree_id"][:] = ids
    columns["species"][:] = [(i - 1) % 3 for i in ids]
    columns["status"][:] = 0
    for name, column in values.items():
        columns[name][:] = column
    return columns


def events(year: int, kinds: dict[int, int], volume_m3: float) -> Columns:
    columns = rows("events", year, len(kinds))
    columns["tree_id"][:] = list(kinds)
    columns["species"][:] = [(i - 1) % 3 for i in kinds]
    columns["kind"][:] = list(kinds.values())
    columns["volume_m3"][:] = volume_m3
    columns["dbh_cm"][:] = 12.7
    columns["height_m"][:] = 9.144
    return columns


def stand(year: int, **values: float) -> Columns:
    """Rows of three species and of all; the values are those of all."""
    columns = rows("stand", year, 4)
    columns["species"][:] = [0, 1, 2, 3]
    columns["removed_ha"][:] = columns["removed_volume_m3ha"][:] = 0.0
    for name, value in values.items():
        columns[name][3] = value
    return columns


def years() -> list[dict[str, Columns]]:
    """Four trees on 10 x 10 m; the fourth dies in 2002, the third is felled in 2003."""
    first = trees(
        2001,
        [1, 2, 3, 4],
        dbh_cm=[25.4, 50.8, 25.4, np.nan],
        basal_area_m2=[0.05, 0.2, 0.05, 0.0],
        height_m=[30.48, 15.24, 10.0, 1.0],
        crown_base_m=[15.24, 3.81, 1.0, 0.1],
        crown_radius_m=[1.524, 3.048, 1.0, 0.2],
        ring_width_mm=[2.54, 1.27, 1.0, np.nan],
        stem_volume_m3=[2.8316846592, 1.0, 1.0, 0.01],
        merchantable_volume_m3=[1.4158423296, 0.5, 0.0, 0.0],
    )
    second = trees(2002, [1, 2, 3], height_m=[30.48 + 0.3048, 15.24, 10.0])
    third = trees(2003, [1, 2])
    of_all = {
        "n_ha": 400.0,
        "basal_area_m2ha": 30.0,
        "sdi": 1000.0,
        "top_height_m": 30.48,
        "qmd_cm": 25.4,
        "volume_m3ha": 300.0,
    }
    removal = {"n_ha": 200.0, "removed_ha": 100.0, "removed_volume_m3ha": 50.0}
    return [
        {
            "trees": first,
            "events": events(2001, dict.fromkeys([1, 2, 3, 4], PLANTED), 0.0),
            "stand": stand(2001, **of_all),
        },
        {"trees": second, "events": events(2002, {4: DIED}, 0.02), "stand": stand(2002, n_ha=300)},
        {
            "trees": third,
            "events": events(2003, {3: FELLED}, 0.5),
            "stand": stand(2003, **(of_all | removal)),
        },
    ]


def write(path: Path, tables: list[str], last: int = 3) -> Path:
    with RunWriter.create(
        path,
        scenario_toml=tiny("plot.size_m=[10, 10]").to_toml(),
        digest="5ca1ab1e",
        seed=7,
        species_names=SPECIES,
        threads=1,
        tables=tables,
    ) as writer:
        for year, columns in enumerate(years()[:last], start=2001):
            everything = {"rings": rows("rings", year, 0), "carbon": rows("carbon", year, 0)}
            writer.append_year(year, everything | columns)
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    path = write(tmp_path_factory.mktemp("tables") / "oakwood.h5", ["trees", "stand", "events"])
    with open_run(path) as run:
        yield run


def test_columns_stand_in_the_order_of_the_definitions(run: Run) -> None:
    for table, frame in (
        (TREE, iland_trees(run)),
        (STAND, iland_stand(run)),
        (TREELIST, fvs_treelist(run)),
        (SUMMARY, fvs_summary(run)),
    ):
        assert list(frame.columns) == [column.name for column in table.filled]
        left_out = ", ".join(names for names, _ in table.left_out)
        assert not {f"`{column.name}`" for column in table.filled} & set(left_out.split(", "))


def test_iland_trees(run: Run) -> None:
    frame = iland_trees(run)
    assert len(frame) == run.count("trees")
    assert frame["species"].tolist()[:3] == ["pisy", "fasy", "ginkgo_biloba"]
    np.testing.assert_array_equal(frame["dbh"], run.trees["dbh_cm"])
    np.testing.assert_array_equal(frame["id"], run.trees["tree_id"])


def test_iland_stand(run: Run) -> None:
    frame = iland_stand(run).set_index(["year", "species"])
    assert len(frame) == 9
    assert (frame["area_ha"] == 0.01).all()
    # tree 4 is the second pine: mean height of 30.48 m and 1 m
    assert frame.loc[(2001, "pisy"), "height_avg_m"] == pytest.approx(15.74)
    assert np.isnan(frame.loc[(2003, "ginkgo_biloba"), "height_avg_m"])
    lost = frame["gwl_m3"] - frame["volume_m3"]
    # 0.02 m3 of pine and 0.5 m3 of ginkgo on a hundredth of a hectare
    assert lost.unstack()["pisy"].tolist() == pytest.approx([0.0, 2.0, 2.0])
    assert lost.unstack()["ginkgo_biloba"].tolist() == pytest.approx([0.0, 0.0, 50.0])
    assert (lost.unstack()["fasy"] == 0.0).all()


def test_fvs_treelist_by_hand(run: Run) -> None:
    frame = fvs_treelist(run)
    first = frame[frame["Year"] == 2001].reset_index(drop=True)
    assert set(frame["StandID"]) == {"oakwood"}
    assert first["TreeId"].tolist() == ["1", "2", "3", "4"]
    assert first["SpeciesPLANTS"].tolist()[:2] == ["PISY", "FASY"]
    assert first["SpeciesPLANTS"].isna().tolist() == [False, False, True, False]
    # one tree on 100 m2 stands for 4046.8564224 / 100 trees on an acre
    assert first["TPA"].tolist() == pytest.approx([40.468564224] * 4, rel=1e-12)
    assert (first["MortPA"] == 0.0).all()
    assert first["DBH"].tolist()[:3] == pytest.approx([10.0, 20.0, 10.0])
    assert first["DG"].tolist()[:2] == pytest.approx([0.2, 0.1])
    assert np.isnan(first["DBH"][3])
    assert first["Ht"].tolist()[:2] == pytest.approx([100.0, 50.0])
    assert first["PctCr"].tolist()[:2] == pytest.approx([50.0, 75.0])
    assert first["CrWidth"].tolist()[:2] == pytest.approx([10.0, 20.0])
    assert first["TCuFt"][0] == pytest.approx(100.0)
    assert first["MCuFt"][0] == pytest.approx(50.0)
    # 0.05, 0.2, 0.05 m2 on a hundredth of a hectare: 5, 20, 5 m2/ha; 1 m2/ha = 4.356 ft2/acre
    assert first["PtBAL"].tolist() == pytest.approx([87.12, 0.0, 87.12, 130.68], abs=1e-4)
    assert first["BAPctile"].tolist() == pytest.approx([100 / 3, 100.0, 100 / 3, 0.0], abs=1e-4)


def test_fvs_treelist_grows_and_lists_the_dead(run: Run) -> None:
    frame = fvs_treelist(run)
    assert frame[frame["Year"] == 2001]["HtG"].isna().all()
    second = frame[frame["Year"] == 2002].reset_index(drop=True)
    assert second["HtG"].tolist()[:3] == pytest.approx([1.0, 0.0, 0.0], abs=1e-5)
    dead = second.iloc[3]
    assert (dead["TreeId"], dead["TPA"]) == ("4", 0.0)
    assert dead["MortPA"] == pytest.approx(40.468564224)
    assert dead["DBH"] == pytest.approx(5.0)
    assert dead["Ht"] == pytest.approx(30.0)
    assert np.isnan(dead["PtBAL"])
    # a felled tree is no mortality
    assert frame[frame["Year"] == 2003]["TreeId"].tolist() == ["1", "2"]


def test_fvs_summary_by_hand(run: Run) -> None:
    first, second, third = fvs_summary(run).to_dict("records")
    assert (first["Year"], first["RmvCode"], first["PrdLen"]) == (2001, 0, 1)
    assert first["Tpa"] == pytest.approx(161.874256896)  # 400 / 2.47105381...
    assert first["BA"] == pytest.approx(130.68)
    assert first["SDI"] == first["ReinekeSDI"] == pytest.approx(404.68564224)
    assert first["TopHt"] == pytest.approx(100.0)
    assert first["QMD"] == pytest.approx(10.0)
    # 1 m3/ha = 35.3146667 ft3 / 2.4710538 acres = 14.2913399 ft3/acre
    assert first["TCuFt"] == first["TPrdTCuFt"] == pytest.approx(4287.402, abs=1e-3)
    # (1.4158423296 + 0.5) m3 on 0.01 ha
    assert first["MCuFt"] == pytest.approx(191.58423 * 14.2913399, rel=1e-6)
    # 0.02 m3 dies in 2002, on 0.01 ha
    assert first["Mort"] == pytest.approx(2.0 * 14.2913399)
    assert second["Mort"] == third["Mort"] == 0.0
    assert (third["RmvCode"], third["PrdLen"]) == (2, 0)
    assert third["TPrdTpa"] - third["Tpa"] == pytest.approx(40.468564224)
    assert third["TPrdTCuFt"] - third["TCuFt"] == pytest.approx(50 * 14.2913399)


def test_columns_that_need_other_tables_are_left_out(tmp_path: Path) -> None:
    with open_run(write(tmp_path / "run.h5", ["stand"])) as run:
        assert {"height_avg_m", "gwl_m3"} == {c.name for c in STAND.filled} - set(iland_stand(run))
        assert {"MCuFt", "Mort"} == {c.name for c in SUMMARY.filled} - set(fvs_summary(run))
        for make in (iland_trees, fvs_treelist):
            with pytest.raises(InputError, match="no table 'trees'"):
                make(run)


def test_a_run_without_years_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "run.h5", ["trees", "stand", "events"], last=0)
    with open_run(path) as run:
        for make in (iland_trees, iland_stand, fvs_treelist, fvs_summary):
            with pytest.raises(InputError, match="holds no years yet"):
                make(run)


def test_the_documentation_lists_every_column() -> None:
    text = mapping_markdown()
    for table in (TREE, STAND, TREELIST, SUMMARY):
        assert f"### {table.program}: `{table.name}`" in text
        for column in table.filled:
            assert f"| `{column.name}` | {column.unit} | {column.source}" in text
