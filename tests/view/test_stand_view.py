"""Scenes as files, runs as scenes, and their pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from forest.errors import InputError
from forest.record.run import open_run
from forest.surface.feature_map import TREE_BITS
from forest.surface.instances import Instances
from forest.view.scenery import SceneFile, build_scenery, load_scenery, scenery_of_run
from forest.view.scenery.from_run import STAND_INS
from forest.view.stand_view import StandView
from tests.tiny import forest, write_tiny

SCENE = """
season = "summer"
[features]
map = "map.npy"
cell_m = 3.0
[[trees]]
bit = 2
species = "lilac"
most_leaves = 900
per_ha = 400.0
variants = 2
[[tree]]
x_m = 15.0
y_m = 18.0
species = "lilac"
most_leaves = 900
height_m = 6.0
[[grass]]
code = 2
[camera]
eye_m = [15.0, -3.0, 1.7]
towards_m = [15.0, 15.0, 2.0]
size_px = [160, 100]
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    bits = np.full((10, 10), 2 << TREE_BITS, np.uint16)
    bits[:5] |= 1 << 2  # the northern half
    np.save(folder / "map.npy", bits)
    (folder / "scene.toml").write_text(SCENE)
    return folder / "scene.toml"


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    assert forest("run", write_tiny(folder), "--out", folder / "run.h5")[0] == 0
    return folder / "run.h5"


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), float)


def test_a_scene_stands_where_its_file_says(scene: Path) -> None:
    built = load_scenery(scene)
    spread, single = built.instances.place[:-1], built.instances.place[-1]
    assert len(spread) == round(400.0 * 15.0 * 30.0 / 1e4)
    assert (spread[:, 1] >= 15.0).all()
    assert single.tolist() == [15.0, 18.0, 0.0]
    assert built.tree_heights[-1] == pytest.approx(6.0)
    assert len(built.models) == 2  # the single tree is one of the variants
    assert built.extent == (0.0, 0.0, 30.0, 30.0)
    assert np.linalg.norm(built.sun) == pytest.approx(1.0)
    south_west = np.array([-1.0, -1.0])
    np.testing.assert_allclose(built.sun[:2] / np.hypot(*built.sun[:2]), south_west / np.sqrt(2.0))


def test_trees_stand_on_the_slope(scene: Path) -> None:
    np.save(scene.parent / "heights.npy", np.repeat(np.arange(10.0, 0.0, -1.0)[:, None], 10, 1))
    text = SCENE + '[terrain]\nheights = "heights.npy"\ncell_m = 3.0\n'
    built = build_scenery(SceneFile.from_toml(text), scene.parent)
    x, y, z = built.instances.place.T
    np.testing.assert_array_equal(z, built.terrain.at(x, y))
    assert np.ptp(z) > 2.0
    eye = built.camera().eye
    assert eye[2] == pytest.approx(float(built.terrain.at(eye[0], eye[1])) + 1.7)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('season = "summer"', 'season = "sumer"', "season: 'sumer' is not allowed"),
        ("most_leaves = 900\nper_ha", "most_leafs = 900\nper_ha", "did you mean 'most_leaves'"),
        ("bit = 2", "bit = 14", r"trees\[0\].bit"),
        ('species = "lilac"\nmost_leaves = 900\nper', 'species = "lila"\nper', "mean 'lilac'"),
        ("variants = 2", "scale_min = 2.0", r"trees\[0\].scale_max"),
        ("map.npy", "maps.npy", "features.map"),
        ("code = 2", "code = 4", r"grass\[0\].code"),
        ('map = "map.npy"', "", "missing key 'map'"),
        ('[features]\nmap = "map.npy"\ncell_m = 3.0\n', "", "spread over no map"),
        ('species = "lilac"\nmost_leaves = 900\nper', "per", "needs either species or run"),
        ("[camera]", '[terrain]\nheights = "no.asc"\n[camera]', "terrain.heights"),
    ],
)
def test_wrong_scenes_are_refused_in_one_line(scene: Path, old: str, new: str, says: str) -> None:
    assert old in SCENE
    bad = scene.with_name("bad.toml")
    bad.write_text(SCENE.replace(old, new))
    with pytest.raises(InputError, match=says) as error:
        load_scenery(bad)
    assert str(error.value).startswith("bad.toml: ") and "\n" not in str(error.value)


def test_a_picture_shows_sky_trees_and_grass(scene: Path, tmp_path: Path) -> None:
    to = tmp_path / "view.png"
    code, out, err = forest("stand-view", scene, "--to", to)
    assert (code, out.strip()) == (0, str(to)), err
    picture = pixels(to)
    assert picture.shape == (100, 160, 3)
    sky, grass, trees = picture[:10], picture[-15:], picture[40:50]
    assert (sky[..., 2] > sky[..., 1]).all()  # blue
    assert np.mean(grass[..., 1] > grass[..., 2] + 20.0) > 0.95  # green
    assert grass.std() > 5.0  # blades
    assert trees.std() > 15.0


def test_shadows_haze_and_seasons_show(scene: Path) -> None:
    built = load_scenery(scene)
    low = replace(built, sun_azimuth_deg=0.0, sun_elevation_deg=25.0)  # shadows fall to the eye
    dark = StandView(low).picture().astype(float)
    sunny = StandView(low, shadows=False).picture().astype(float)
    assert sunny.mean() > dark.mean() + 1.0
    plain = StandView(built).picture().astype(float)
    hazy = replace(built, haze=replace(built.haze, visibility_m=15.0))
    veiled = StandView(hazy).picture().astype(float)
    assert veiled[40:60].std() < 0.8 * plain[40:60].std()
    bare = StandView(replace(built, season="winter")).picture().astype(float)
    assert np.abs(bare - plain).mean() > 3.0
    empty = replace(built, models=(), heights=np.empty(0), instances=Instances.of([], [], []))
    ground = StandView(empty).picture().astype(float)
    assert np.abs(ground[40:60] - plain[40:60]).mean() > 5.0


def test_living_trees_of_a_year_stand_at_their_places(run_file: Path) -> None:
    with open_run(run_file) as run:
        built = scenery_of_run(run, 2006)
        tiled = scenery_of_run(run, 2006, tile=3)
        bare = scenery_of_run(run, 2006, shapes=[])
        trees = run.read("trees", years=(2006, 2006))
        samples = run.samples
        skeletons = [run.skeleton(i, 2006) for i in samples if 2006 in run.sample_years(i)]
    trees = trees[trees["status"] == "living"]
    np.testing.assert_allclose(built.instances.place[:, 0], trees["x_m"], rtol=1e-6)
    np.testing.assert_allclose(built.tree_heights, trees["height_m"], rtol=1e-4)
    own = trees["tree_id"].isin([s.tree_id for s in skeletons]).to_numpy()
    np.testing.assert_array_equal(built.instances.scale == 1.0, own)
    assert f"{own.sum()} as they are on record" in built.notes[0]
    assert len(tiled.instances.model) == 9 * len(trees)
    middle = tiled.instances.place[4 * len(trees) : 5 * len(trees)]
    np.testing.assert_array_equal(middle, built.instances.place)
    assert tiled.extent == (-10.0, -10.0, 20.0, 20.0)
    assert bare.notes == built.notes


def test_sample_trees_of_a_run_are_spread_like_others(scene: Path, run_file: Path) -> None:
    with open_run(run_file) as run:
        sample = run.samples[0]
        skeleton = run.skeleton(sample, 2008)
    row = f'run = "{run_file}"\nsample = {sample}\nper'
    text = SCENE.replace('species = "lilac"\nmost_leaves = 900\nper', row)
    built = build_scenery(SceneFile.from_toml(text), scene.parent)
    height = skeleton.end[:, 2].max() - skeleton.start[0, 2]
    assert built.heights[0] == pytest.approx(height)
    assert (built.instances.model[:-1] == 0).all()
    with pytest.raises(InputError, match=r"trees\[0\].year: .*a year from 2001 to 2008"):
        wrong = SceneFile.from_toml(text.replace("per_ha", "year = 1999\nper_ha"))
        build_scenery(wrong, scene.parent)
    with pytest.raises(InputError, match=r"trees\[0\].sample: tree 999 is no sample tree"):
        wrong = SceneFile.from_toml(text.replace(f"sample = {sample}", "sample = 999"))
        build_scenery(wrong, scene.parent)


def test_without_shapes_parametric_trees_stand_in(tmp_path: Path) -> None:
    from forest.species import species_names
    from forest.species.parametric import parametric_names

    assert set(STAND_INS) == set(species_names())
    assert set(STAND_INS.values()) <= set(parametric_names())
    path = write_tiny(tmp_path)
    changes = ("output.sample_trees={}", 'planting={kind="random", density_ha=100}', "years=2")
    words = [word for change in changes for word in ("--set", change)]
    assert forest("run", path, "--out", tmp_path / "run.h5", *words)[0] == 0
    with open_run(tmp_path / "run.h5") as run:
        built = scenery_of_run(run)
        heights = run.read("trees", ["height_m"], years=(2002, 2002))["height_m"]
    assert f"{len(heights)} by parametric stand-ins" in built.notes[0]
    np.testing.assert_allclose(built.tree_heights, heights, rtol=1e-4)


def test_the_command_draws_runs(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "stand.png"
    words = ("stand-view", run_file, "--to", to, "--size", "120x80")
    code, out, err = forest(*words, "--sun", "200,30", "--season", "winter", "--haze", "300")
    assert code == 0, err
    assert "living trees in 2008: " in out and "0 scaled" in out  # the checkpoint has all shapes
    assert pixels(to).std() > 20.0
    assert forest(*words)[0] == 2  # it is there already
    code, out, err = forest(*words, "--frames", "2", "--year", "2005", "--force", "--no-shadows")
    assert code == 0, err
    frames = [pixels(tmp_path / f"stand_00{k}.png") for k in (0, 1)]
    assert np.abs(frames[0] - frames[1]).mean() > 1.0
    film = tmp_path / "film.gif"
    assert forest(*words[:2], "--to", film, "--size", "60x40", "--frames", "2")[0] == 0
    with Image.open(film) as image:
        assert image.n_frames == 2


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--eye", "1,2"), "--eye"),
        (("--towards", "a,b,c"), "--towards"),
        (("--size", "10"), "WxH"),
        (("--tile", "1000"), "a tile of"),
        (("--size", "0x9"), "--size"),
        (("--sun", "10,-5"), "sun"),
        (("--season", "sumer"), "did you mean 'summer'"),
        (("--haze", "-1"), "--haze"),
        (("--frames", "0"), "--frames"),
        (("--field-of-view", "180"), "--field-of-view"),
        (("--year", "1900"), "a year from 2001 to 2008"),
        (("--eye", "5,5,1", "--towards", "5,5,1"), "eye"),
    ],
)
def test_bad_options_are_refused(
    run_file: Path, tmp_path: Path, options: tuple[str, ...], says: str
) -> None:
    code, _, err = forest("stand-view", run_file, "--to", tmp_path / "v.png", *options)
    assert code == 2
    assert says in err and err.count("\n") == 1
    assert not (tmp_path / "v.png").exists()


def test_years_are_for_runs(scene: Path, tmp_path: Path) -> None:
    code, _, err = forest("stand-view", scene, "--to", tmp_path / "v.png", "--year", "5")
    assert code == 2 and "run files" in err
