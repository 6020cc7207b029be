"""`forest movie`: as many frames as asked for, which differ, and nothing half-written."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from forest.record.run import open_run
from forest.view import film, tree_movie
from forest.view.film import FilmSettings
from forest.view.movie import film_stand
from forest.view.stand_years import StandYears
from forest.view.tree_colours import COLOURS, FATE_COLOURS, TreeColours
from tests.tiny import YEARS, forest, write_tiny

FELLED, FELLING = 2, 2005
SMALL = ("--size", "160x100", "--fps", 5)
TREE = ("--tree", 1, "--size", "100x120", "--fps", 5)


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("movie")
    act = f'acts=[{{kind="fell", year={FELLING}, tree_ids=[{FELLED}]}}]'
    code, _, err = forest("run", write_tiny(folder), "--set", act, "--out", folder / "run.h5")
    assert code == 0, err
    return folder / "run.h5"


def frames(path: Path) -> list[np.ndarray]:
    with Image.open(path) as picture:
        return [np.asarray(one.convert("RGB"), int) for one in ImageSequence.Iterator(picture)]


def mp4_frames(path: Path) -> list[np.ndarray]:
    reader = pytest.importorskip("imageio_ffmpeg").read_frames(str(path))
    width, height = next(reader)["size"]
    return [np.frombuffer(one, np.uint8).reshape(height, width, 3) for one in reader]


def test_a_gif_of_a_stand(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "stand.gif"
    code, out, err = forest("movie", run_file, "--to", to, *SMALL, "--seconds", 1.6)
    assert code == 0, err
    assert "8 frames, 1.6 s" in out
    shown = frames(to)
    assert len(shown) == 8  # a year each, and none stands still
    assert shown[0].shape == (100, 160, 3)
    for one, other in pairwise(shown):
        assert np.abs(one - other)[:, :120].max() > 20  # not only the year's number
    assert [path.name for path in tmp_path.iterdir()] == ["stand.gif"]


def test_an_mp4_of_some_years_from_above(run_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    to = tmp_path / "stand.mp4"
    words = ("--from-year", 2003, "--to-year", 2006, "--view", "above", "--colour", "height")
    code, _, err = forest("movie", run_file, "--to", to, *SMALL, *words, "--seconds", 2)
    assert code == 0, err
    shown = mp4_frames(to)
    assert len(shown) == 10
    assert shown[0].shape == (100, 160, 3)
    assert np.abs(shown[0].astype(int) - shown[-1]).mean() > 1.0


def test_a_turning_camera_goes_around(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "turn.gif"
    last = 2000 + YEARS
    words = ("--from-year", last, "--view", "turning", "--seconds", 1)
    assert forest("movie", run_file, "--to", to, *SMALL, *words)[0] == 0
    shown = frames(to)
    assert len(shown) == 5
    assert all(np.abs(one - shown[0]).mean() > 0.5 for one in shown[1:])


def test_a_tree_from_all_sides_and_as_it_grows(run_file: Path, tmp_path: Path) -> None:
    around, grown = tmp_path / "around.gif", tmp_path / "grown.gif"
    assert forest("movie", run_file, "--to", around, *TREE, "--seconds", 1)[0] == 0
    code, _, err = forest("movie", run_file, "--to", grown, *TREE, "--grow", "--seconds", 2)
    assert code == 0, err
    for path, count in ((around, 5), (grown, 10)):
        shown = frames(path)
        assert len(shown) == count
        assert shown[0].shape == (120, 100, 3)
    drawn = [np.abs(one - one[-1, -1]).sum(axis=2)[20:] > 30 for one in frames(grown)]
    assert drawn[0].sum() < drawn[-1].sum()


def test_a_tree_as_a_surface(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tree_movie, "too_thin", lambda skeleton: True)  # blending has its own tests
    to = tmp_path / "mesh.gif"
    words = ("--shape", "mesh", "--year", 2004, "--no-leaves", "--seconds", 0.6)
    code, _, err = forest("movie", run_file, "--to", to, *TREE, *words)
    assert code == 0, err
    assert len(frames(to)) == 3


def test_sizes_lie_between_those_of_two_years(run_file: Path) -> None:
    with open_run(run_file) as run:
        years = StandYears(run)
        before, now = years.living(2003), years.living(2004)
        middle = years.at(2003.25, 2003.0)
        assert middle["tree_id"].tolist() == now["tree_id"].tolist()
        wanted = 0.75 * before["height_m"] + 0.25 * now["height_m"]
        np.testing.assert_allclose(middle["height_m"], wanted, rtol=1e-6)
        assert years.at(2004.0, 2003.5)["height_m"].tolist() == now["height_m"].tolist()


def test_who_has_gone_is_seen_once_more(run_file: Path) -> None:
    with open_run(run_file) as run:
        years = StandYears(run)
        colours = TreeColours.of_run(run, "species")
        for moment, since, there in (
            (FELLING - 1.0, FELLING - 1.5, False),
            (FELLING - 0.5, FELLING - 1.0, True),
            (float(FELLING), FELLING - 0.5, True),
            (FELLING + 0.5, float(FELLING), False),
            (FELLING + 2.0, FELLING - 2.0, True),  # the frames leap over the year
        ):
            trees = years.at(moment, since)
            marked = trees[trees["fate"] == "felled"]
            assert marked["tree_id"].tolist() == [FELLED] * there, moment
            rgb = colours.of(trees)[(trees["fate"] == "felled").to_numpy()]
            assert rgb.tolist() == [list(FATE_COLOURS["felled"])] * there
        alive = years.at(FELLING - 1.0, FELLING - 1.5)
        assert FELLED in alive["tree_id"].tolist()


@pytest.mark.parametrize("by", COLOURS)
def test_colours_are_on_one_scale(run_file: Path, by: str) -> None:
    with open_run(run_file) as run:
        colours = TreeColours.of_run(run, by)
        first, last = (colours.of(StandYears(run).living(year)) for year in (2001, 2000 + YEARS))
    assert first.min() >= 0.0 and last.max() <= 1.0
    assert len(np.unique(last, axis=0)) > 1 or by == "age"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--to", "stand.avi"), ".mp4 or .gif"),
        (("--to", "nowhere/stand.gif"), "there is no folder"),
        (("--to", "a.gif", "--colour", "hight"), "did you mean 'height'?"),
        (("--to", "a.gif", "--view", "abov"), "did you mean 'above'?"),
        (("--to", "a.gif", "--to-year", 2050), "2001 to 2008"),
        (("--to", "a.gif", "--from-year", 2005, "--to-year", 2003), "before --from-year"),
        (("--to", "a.gif", "--tree", 2), "no sample tree"),
        (("--to", "a.gif", "--tree", 1, "--year", 1990), "2001 to 2008"),
        (("--to", "a.gif", "--tree", 1, "--shape", "messh"), "did you mean 'mesh'?"),
        (("--to", "a.gif", "--tree", 1, "--to-year", 2003), "films of a stand"),
        (("--to", "a.gif", "--tree", 1, "--view", "side"), "--view is for films of a stand"),
        (("--to", "a.gif", "--grow"), "--tree ID"),
        (("--to", "a.gif", "--shape", "skeleton"), "--shape is for films of a tree"),
        (("--to", "a.gif", "--no-leaves"), "--leaves is for films of a tree"),
        (("--to", "a.gif", "--fps", 0), "0.5 to 60"),
        (("--to", "a.gif", "--fps", "nan"), "0.5 to 60"),
        (("--to", "a.gif", "--seconds", 3600, "--fps", 60), "20,000 at most"),
        (("--to", "a.gif", "--size", "12"), "WxH"),
        (("--to", "a.mp4", "--size", "101x99"), "even sides"),
    ],
)
def test_what_is_refused(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[object, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = forest("movie", run_file, *words)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_runs_without_trees_are_refused(tmp_path: Path) -> None:
    toml = write_tiny(tmp_path)
    run = tmp_path / "bare.h5"
    words = ("--set", "output.tables=['stand']", "--set", "years=2")
    assert forest("run", toml, "--out", run, *words)[0] == 0
    code, _, err = forest("movie", run, "--to", tmp_path / "a.gif")
    assert code == 2 and "no table of trees" in err


def test_an_mp4_without_its_writer(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    code, _, err = forest("movie", run_file, "--to", tmp_path / "a.mp4")
    assert code == 2
    assert "forest-stand[view]" in err and ".gif" in err


@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
def test_a_film_that_is_stopped_leaves_nothing(run_file: Path, tmp_path: Path, name: str) -> None:
    if name.endswith(".mp4"):
        pytest.importorskip("imageio_ffmpeg")
    old = tmp_path / name
    old.write_bytes(b"an older film")
    left = iter((None, None))

    def stop() -> None:
        if next(left, "stop") == "stop":
            raise KeyboardInterrupt

    settings = FilmSettings(fps=5, seconds=2, size=(160, 100))
    with open_run(run_file) as run, pytest.raises(KeyboardInterrupt):
        film_stand(run, old, settings=settings, overwrite=True, done=stop)
    assert old.read_bytes() == b"an older film"
    assert list(tmp_path.iterdir()) == [old]


def test_a_film_is_replaced_only_when_told(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "a.gif"
    to.write_bytes(b"older")
    words = ("movie", run_file, "--to", to, *SMALL, "--seconds", 0.4)
    code, _, err = forest(*words)
    assert code == 2 and "--force" in err
    assert to.read_bytes() == b"older"
    assert forest(*words, "--force")[0] == 0
    assert len(frames(to)) == 2


def test_a_gif_keeps_rare_colours(tmp_path: Path) -> None:
    pictures = [np.full((40, 60, 3), 230, np.uint8) for _ in range(4)]
    for k, picture in enumerate(pictures):
        picture[:30] = (40, 90 + 20 * k, 60)
        picture[32:38, 4 : 6 + 2 * k] = (214, 48, 38)
    film.write_film(lambda k: pictures[k], 4, tmp_path / "a.gif", fps=10)
    shown = frames(tmp_path / "a.gif")
    assert len(shown) == 4
    for one, wanted in zip(shown, pictures, strict=True):
        assert np.abs(one - wanted).max() <= 12
