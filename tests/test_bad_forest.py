"""Bad climate, regeneration, mortality, wind, management, inventory: one line, nothing on disk."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.everything import TOML
from tests.test_bad_input import contents, refused
from tests.tiny import forest, write_tiny

#: The first line of a planting, and where a table or an act can be put in.
PLANTING = 'planting = { kind = "random", density_ha = 9000, min_distance_m = 0.3 }'
ACT = '[[acts]]\nkind = "thin"\nwhen = "n_ha > 6000"'
EVENTS = "events = [\n"
HEAD = "x_m,y_m,species,dbh_cm,height_m,crown_base_m\n"
INVENTORY = 'planting = { kind = "inventory", file = "rows.csv", species = "fagus_sylvatica" }'

# Each: what of the scenario is replaced, by what, and what the message says.
CLIMATE = [
    ("noise_sd = 0.1", "noise_sd = 2", "climate.noise_sd: 2 is not allowed; expected number, 0 to"),
    ("noise_sd", "nosie_sd", "climate.nosie_sd: unknown key 'nosie_sd', did you mean"),
    ("year = 2002, dr", "year = 2004, dr", "climate.series[1].year: 2004 does not follow 2001"),
    ("2002, drought_index", "2002, temperature_c", "climate.series[1]: the year 2002 tells temp"),
    ("drought_index = -1.5", "drought_index = -15", "climate.series[1].drought_index: -15"),
    ("drought_index = -1.5", "drought_index = nan", "climate.series[1].drought_index"),
    ("noise_sd", 'file = "rows.csv"\nnoise_sd', "climate.file"),
    ("factor = 0.2 }", "factor = 0.2 }, { year = 2012, factor = 1 }", "2012 is given twice"),
    ("factor = 0.2", "factor = -1", "climate.extreme_years[0].factor: -1"),
    ("autocorrelation = 0.5", "autocorrelation = 1", "climate.generator.drought_index.autocorrel"),
    ("mean = 0, sd = 1", "mean = 0, sd = -1", "climate.generator.drought_index.sd: -1"),
    ("mean = 0, sd", "sd", "climate.generator.drought_index.mean: missing"),
    ("extreme_probability = 0.2", "extreme_probability = 2", "climate.generator.extreme_prob"),
    ("drought_index = { mean", "drougth_index = { mean", "did you mean 'drought_index'?"),
    ("drought_index = { mean", "growth_index = { mean", "noise_sd draws the growth index already"),
    ("share = 1\n", "share = 1\nresponse = { drought_index_lags = [1, 1, 1] }\n", "add up to 3"),
    ("share = 1\n", "share = 1\nresponse = { drougth_index_curve = [] }\n", "did you mean"),
]
REGENERATION = [
    ("pinus_sylvestris = 10", "pinus_silvestris = 10", "regeneration.seed_rain: unknown species"),
    ("fagus_sylvatica = 4", "fagus_sylvatica = -4", "regeneration.seed_rain.fagus_sylvatica: -4"),
    ("handover_height_m = 0.5", "handover_height_m = 9", "regeneration.handover_height_m: 9"),
    ("handover_height_m", "hand_over_height_m", "did you mean 'handover_height_m'?"),
    ("handover_height_m", "cell_m = 0.3\nhandover_height_m", "regeneration.cell_m: 0.3 is finer"),
    ("handover_height_m", "cohorts_per_cell = 0\nhandover_height_m", "cohorts_per_cell: 0"),
    (", canopy = {}", "", "regeneration: seedlings live by the light at the ground"),
    ("seed = 5", 'seed = 5\nmode = "paper"', "regeneration: seedlings hand over dry mass"),
    ("maturity_height_m = 1.0", "maturity_height_m = -1", "regeneration.maturity_height_m: -1"),
]
MORTALITY = [
    ("age = true", "age = 1.5", "mortality.age: 1.5 is not allowed"),
    ("snags = true", "snag = true", "mortality.snag: unknown key 'snag', did you mean"),
    ("snags = true", "buckling = true", "mortality.buckling: buckling is found by mechanics"),
    (EVENTS, EVENTS + "{ year = 1999, share = 1 },", "mortality.events[0]: 1999 is not a year"),
    (EVENTS, EVENTS + "{ year = 2005 },", "mortality.events[0]: names no trees"),
    (EVENTS, EVENTS + "{ year = 2005, x_m = 1, y_m = 1 },", "mortality.events[0].radius_m: not gi"),
    (EVENTS, EVENTS + "{ year = 2005, x_m = 1, y_m = 99, radius_m = 1 },", "outside the plot"),
    (EVENTS, EVENTS + "{ year = 2005, share = 2 },", "mortality.events[0].share: 2"),
    (EVENTS, EVENTS + "{ year = 2005, tree_id = 2, share = 1 },", "share: given beside tree_id"),
    (EVENTS, EVENTS + "{ year = 2006, tree_id = 3 },", "tree 3 has died in 2004"),
    (EVENTS, EVENTS + "{ year = 2001, tree_id = 999 },", "mortality.events[0].tree_id in 2001: no"),
    ('cause = "fire"', 'cause = "fires"', "mortality.events[0].cause: 'fires' is not allowed"),
    ('cause = "fire"', 'species = "fagus"', "unknown species 'fagus', did you mean 'fagus_sylv"),
    ("max_dbh_cm = 3", "max_dbh_cm = 3, min_dbh_cm = 4", "events[2].max_dbh_cm: 3 lies below"),
    ("longevity_years = 14", "longevity_years = 0", "pinus_sylvestris.mortality.longevity_years"),
]
WIND = [
    ("year = 2011, speed", "year = 1911, speed", "wind.storms[0].year: 1911 is not a year of the"),
    ("speed_m_s = 14", "speed_m_s = 0", "wind.storms[0].speed_m_s: 0"),
    ("speed_m_s = 14", "speed_m_s = 140", "wind.storms[0].speed_m_s: 140"),
    ("speed_m_s = 14", "speed = 14", "did you mean 'speed_m_s'?"),
    ("direction_deg = 30", "direction_deg = 400", "wind.storms[0].direction_deg: 400"),
    ("mode_m_s = 5, ", "", "wind.yearly.mode_m_s: missing"),
    ("dispersion_m_s = 3", "dispersion_m_s = 0", "wind.yearly.dispersion_m_s: 0"),
    ("anchorage = 0.1", "anchorage = 0", "wind.anchorage: 0"),
    ("anchorage = 0.1", "anchorage = inf", "wind.anchorage"),
    ("from_height_m = 1.8", "from_heigth_m = 1.8", "did you mean 'from_height_m'?"),
]
MANAGEMENT = [
    ("n_ha > 6000", "n_he > 6000", "acts[0].when: unknown quantity 'n_he', did you mean 'n_ha'?"),
    ("n_ha > 6000", "n_ha about 6000", "acts[0].when: 'n_ha about 6000' is no trigger"),
    ("share_n = 0.15", "share_n = 0.15\nsdi = 300", "acts[0]: sdi and share_n exclude each other"),
    ("share_n = 0.15", "share_n = 15", "acts[0].share_n: 15"),
    ('method = "random"', 'method = "rndom"', "acts[0].method: 'rndom' is not allowed; expected"),
    ("wait_years = 3", "wait_years = 0", "acts[0].wait_years: 0"),
    ("from_year = 2004", "from_year = 2040", "acts[0].from_year: no year of the run is meant"),
    ("crop_trees_ha = 500", "", "acts[1]: missing key 'crop_trees_ha'"),
    ("crop_trees_ha", 'crop_species = "fagus"\ncrop_trees_ha', "acts[1].crop_species[0]: unknown"),
    ("below_share = 0.3", "below_share = 3", "acts[2].below_share: 3"),
    ("thickest_ha = 500\n", "", "acts[2].tree_id: missing"),
    (", radius_m = 2.5 }\n", " }\n", "acts[12].gap.radius_m: missing"),
    ("x_m = 0, y_m = 5", "x_m = 50, y_m = 5", "acts[12].gap: lies beside the plot"),
    ("years = [2010, 2013]", "years = [2010, 2093]", "acts[13].years[1]: 2093 is not a year"),
    ("density_ha = 1500", "density_ha = 1e300", "acts[13].density_ha"),
    (ACT, f'[[acts]]\nkind = "fell"\nyear = 2001\ntree_ids = [999]\n{ACT}', "in 2001: no living"),
    (ACT, f'[[acts]]\nkind = "burn"\nyear = 2001\n{ACT}', "acts[0]: unknown kind 'burn'"),
]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run of another scenario."""
    folder = tmp_path_factory.mktemp("made")
    code, _, err = forest("run", write_tiny(folder), "--years", 2, "--out", folder / "run.h5")
    assert code == 0, err
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of it, for one test."""
    return Path(shutil.copytree(made, tmp_path / "copy"))


def refused_by_all(folder: Path, toml: str, says: str) -> None:
    """Check that no command that reads the scenario takes it, or touches a file for it."""
    path = folder / "wrong.toml"
    path.write_text(toml)
    refused(folder, "run", path, "--out", folder / "new.h5", says=says)
    refused(folder, "run", path, "--out", folder / "run.h5", "--force", says=says)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [*CLIMATE, *REGENERATION, *MORTALITY, *WIND, *MANAGEMENT],
)
def test_scenario(folder: Path, old: str, new: str, says: str) -> None:
    assert old in TOML
    refused_by_all(folder, TOML.replace(old, new, 1), says)


@pytest.mark.parametrize(
    ("old", "new", "says"), [rows[0] for rows in (CLIMATE, REGENERATION, MORTALITY, WIND)]
)
def test_also_checked_and_resumed(folder: Path, old: str, new: str, says: str) -> None:
    path = folder / "wrong.toml"
    path.write_text(TOML.replace(old, new, 1))
    refused(folder, "check", path, says=f"wrong.toml: {says}")
    refused(folder, "run", path, "--out", folder / "run.h5", "--resume", says=says)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("year,drought_index\n2001,\n", "'rows.csv' line 2"),
        ("year,drought_index\n2001,dry\n", "line 2, column 'drought_index': 'dry' is not allowed"),
        ("year,drought_index\n2001,0\n2001,0\n", "'rows.csv' line 3"),
        ("year,drought_index\n2001,0\n2003,0\n", "line 3: 2003 does not follow 2001"),
        ("year,drought_index\n2001,-50\n", "'rows.csv' line 2"),
        ("year,drougth_index\n2001,0\n", "did you mean 'drought_index'?"),
        ("drought_index\n0\n", "year"),
        ("year,drought_index\n", "rows.csv"),
        ("", "rows.csv"),
        (None, "rows.csv"),
    ],
)
def test_climate_file(folder: Path, rows: str | None, says: str) -> None:
    if rows is not None:
        (folder / "rows.csv").write_text(rows)
    series = TOML[TOML.index("series = ") : TOML.index("extreme_years")]
    refused_by_all(folder, TOML.replace(series, 'file = "rows.csv"\n'), says)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("year,share\n2003,half\n", "'rows.csv' line 2, column 'share': 'half' is not allowed"),
        ("year,share\n2003,1\n2003.5,1\n", "line 3, column 'year': '2003.5' is not allowed"),
        ("year,share\n2003,\n", "'rows.csv' line 2: names no trees"),
        ("year,share\n1903,1\n", "'rows.csv' line 2: 1903 is not a year of the run"),
        ("year,tree_id\n2001,999\n", "'rows.csv' line 2 in 2001: no living tree has the id 999"),
        ("year,tree_id\n2003,1\n2004,1\n", "'rows.csv' line 3: tree 1 has died in 2003"),
        ("year,trea_id\n2003,1\n", "did you mean 'tree_id'?"),
        ("year,share,cause\n2003,1,fires\n", "'rows.csv' line 2"),
        (None, "rows.csv"),
    ],
)
def test_events_file(folder: Path, rows: str | None, says: str) -> None:
    if rows is not None:
        (folder / "rows.csv").write_text(rows)
    events = TOML[TOML.index("events = [") : TOML.index("[wind]")]
    refused_by_all(folder, TOML.replace(events, 'events = "rows.csv"\n'), says)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (
            f"{HEAD}1,1,,,8,\n",
            "planting.file: 'rows.csv' line 2: dbh_cm: none, but the tree is 8 m",
        ),
        (f"{HEAD}1,1,,5,1,\n", "does not reach 1.3 m"),
        (f"{HEAD}1,1,,,,\n", "neither dbh nor height"),
        (f"{HEAD}1,1,,8,,\n", "no height curve can be fitted to the 0 trees of fagus_sylvatica"),
        (f"{HEAD}1,1,,8,9,10\n", "10 is above the tree, which is 9 m high"),
        (f"{HEAD}1,1,fagus,8,9,\n", "unknown species 'fagus', did you mean 'fagus_sylvatica'?"),
        (f"{HEAD}1,11,,8,9,\n", "outside the plot"),
        (f"{HEAD}1,1,,8,9,\n1,1,,8,9,\n", "line 3: stands on the spot of line 2"),
        (f"{HEAD}1,1,,-8,9,\n", "'rows.csv' line 2"),
        (f"{HEAD}1,1,,8,900,\n", "'rows.csv' line 2"),
        (f"{HEAD}1,1,,8,tall,\n", "column 'height_m': 'tall'"),
        ("x_m,y_m,dbh\n1,1,8\n", "dbh"),
        (HEAD, "no tree"),
        ("", "rows.csv"),
        (None, "rows.csv"),
    ],
)
def test_inventory_file(folder: Path, rows: str | None, says: str) -> None:
    if rows is not None:
        (folder / "rows.csv").write_text(rows)
    refused_by_all(folder, TOML.replace(PLANTING, INVENTORY), says)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("1,1,,1,2,", "1,1,,80,2,", "planting.file 'rows.csv' line 2: dbh of 80 cm"),
        (
            EVENTS,
            EVENTS + "{ year = 2001, tree_id = 4 },",
            "mortality.events[0].tree_id in 2001: no",
        ),
        (
            ACT,
            f'[[acts]]\nkind = "fell"\nyear = 2001\ntree_ids = [4]\n{ACT}',
            "acts[0].tree_ids in",
        ),
    ],
)
def test_inventory_that_grows_no_forest(folder: Path, old: str, new: str, says: str) -> None:
    """What is known when the nursery has grown, which tells of itself before the error."""
    rows = f"{HEAD}1,1,,1,2,\n4,4,,1,2,\n8,2,,1,2,\n"
    (folder / "rows.csv").write_text(rows.replace(old, new))
    (folder / "wrong.toml").write_text(TOML.replace(PLANTING, INVENTORY).replace(old, new, 1))
    before = contents(folder)
    for name, *more in (("new.h5",), ("run.h5", "--force")):
        code, out, err = forest("run", folder / "wrong.toml", "--out", folder / name, *more)
        assert (code, out) == (2, "")
        assert err.splitlines()[-1].startswith("forest: error: ")
        assert err.count("error") == 1
        assert says in err.splitlines()[-1]
        assert contents(folder) == before


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("climate.noise_sd=2", "climate.noise_sd: 2"),
        ("regeneration.seed_rain.pinus_silvestris=1", "did you mean 'pinus_sylvestris'?"),
        ("mortality.events=none.csv", "none.csv"),
        ("mortality.snag=true", "did you mean 'snags'?"),
        ("wind.storms=[{year=2002, speed_m_s=-1}]", "wind.storms[0].speed_m_s: -1"),
        ("wind=20", "wind: 20 is not allowed"),
        ("acts=[{kind='thin', year=2002}]", "acts[0].method: missing"),
        ("planting.kind=inventory", "planting"),
    ],
)
def test_set(folder: Path, override: str, says: str) -> None:
    (folder / "good.toml").write_text(TOML)
    words = ["run", folder / "good.toml", "--set", override]
    refused(folder, *words, "--out", folder / "new.h5", says=says)
    refused(folder, *words, "--out", folder / "run.h5", "--force", says=says)


def test_a_run_that_is_there_is_not_touched_unasked(folder: Path) -> None:
    (folder / "good.toml").write_text(TOML)
    words = ["run", folder / "good.toml", "--out", folder / "run.h5"]
    refused(folder, *words, says="exists already")
    refused(folder, *words, "--resume", says="was made by a different scenario")
    assert "run.h5" in contents(folder)
