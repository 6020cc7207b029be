"""Where commands write: one rule for all, told before any work, and nothing half-written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError, OutputError, span_of
from forest.record.export import check_target, whole_file, whole_folder
from forest.simulation import simulate
from forest.surface.export import Material, Part, write_mesh
from forest.surface.tubes import tubes
from tests.surface.bushes import bush
from tests.tiny import forest, tiny


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    to = tmp_path_factory.mktemp("a run") / "tiny run.h5"
    simulate(tiny("years=2"), to).close()
    return to


COMMANDS = {
    "mesh": ("mesh", "RUN", "--tree", "1", "--to", "a.glb"),
    "scene": ("scene", "RUN", "--to", "a.glb"),
    "bark": ("bark", "RUN", "--tree", "1", "--to", "a.glb"),
    "tree": ("tree", "quaking_aspen", "--to", "a.glb"),
    "rings": ("rings", "RUN", "--tree", "1", "--to", "a.png"),
    "picture": ("picture", "RUN", "--to", "a.png"),
    "stand-view": ("stand-view", "RUN", "--to", "a.png"),
    "movie": ("movie", "RUN", "--to", "a.gif"),
    "report": ("report", "RUN", "--to", "a.html"),
    "stability": ("stability", "RUN", "--to", "a.csv"),
    "measure": ("measure", "RUN", "--to", "a.csv"),
    "bucking": ("bucking", "RUN", "--to", "a.csv"),
    "export": ("export", "RUN", "--table", "trees", "--to", "a.csv"),
    "export tree": ("export", "RUN", "--tree", "1", "--as", "treeqsm", "--to", "a.csv"),
}


def refused(run_file: Path, words: tuple[str, ...], to: Path, says: str) -> None:
    """Check the one line, and that nothing came into the folder."""
    before = {path: path.stat().st_mtime_ns for path in to.parent.parent.rglob("*")}
    given = [str(run_file) if word == "RUN" else word for word in words[:-1]]
    code, out, err = forest(*given, to)
    assert (code, out) == (2, ""), (code, out, err)
    assert len(err.splitlines()) == 1, err
    assert says in err
    assert {path: path.stat().st_mtime_ns for path in to.parent.parent.rglob("*")} == before


@pytest.mark.parametrize("name", COMMANDS)
def test_all_commands_refuse_alike(run_file: Path, tmp_path: Path, name: str) -> None:
    words = COMMANDS[name]
    suffix = Path(words[-1]).suffix
    (tmp_path / "afile").touch()
    there, folder = tmp_path / f"there{suffix}", tmp_path / f"folder{suffix}"
    there.touch()
    folder.mkdir()
    for to, says in (
        (there, f"{there}: exists already; expected a new path, or --force"),
        (folder, "is a folder; expected the path of a file"),
        (tmp_path / "none" / f"a{suffix}", f"there is no folder '{tmp_path / 'none'}'"),
        (tmp_path / "afile" / f"a{suffix}", f"'{tmp_path / 'afile'}' is a file"),
    ):
        refused(run_file, words, to, says)


@pytest.mark.parametrize("name", sorted({*COMMANDS} - {"bark", "export tree"}))
def test_a_name_tells_the_format(run_file: Path, tmp_path: Path, name: str) -> None:
    refused(run_file, COMMANDS[name], tmp_path / "a", "a: has no suffix; expected a name that ends")
    refused(run_file, COMMANDS[name], tmp_path / "a.xyz", "a.xyz: unknown format '.xyz'; expected")


def test_bark_takes_a_folder(run_file: Path, tmp_path: Path) -> None:
    words = ("bark", "RUN", "--tree", "1", "--to", "")
    (tmp_path / "afile").touch()
    refused(run_file, words, tmp_path / "none" / "maps", "there is no folder")
    refused(run_file, words, tmp_path / "afile" / "maps", "is a file")
    refused(run_file, words, tmp_path / "a.xyz", "unknown format '.xyz'; expected a folder, or a")


def test_what_goes_beside_a_file_is_not_replaced(run_file: Path, tmp_path: Path) -> None:
    (tmp_path / "a.mtl").touch()
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "mine.txt").touch()
    refused(run_file, COMMANDS["mesh"], tmp_path / "a.obj", "a.mtl: exists already")
    refused(run_file, COMMANDS["scene"], tmp_path / "b.vtm", "b: exists already; expected a new")
    words = ("scene", "RUN", "--force", "--to", "")
    refused(run_file, words, tmp_path / "b.vtm", "holds other things; expected room for the blocks")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("mesh", "--tree", "1", "--cell", "-1", "--to", "a.glb"), "--cell is -1; expected metres"),
        (("mesh", "--tree", "1", "--cell", "nan", "--to", "a.glb"), "--cell is nan"),
        (("mesh", "--tree", "1", "--cell", "inf", "--to", "a.glb"), "--cell is inf"),
        (("mesh", "--tree", "1", "--cell", "1e9", "--to", "a.glb"), "--cell: the thickest"),
        (("mesh", "--tree", "1", "--cell", "1e-9", "--to", "a.glb"), "--cell: "),
        (("mesh", "--tree", "1", "--tolerance", "0.1", "--to", "a.glb"), "only tubes have"),
        (
            ("mesh", "--tree", "1", "--kind", "tubes", "--tolerance", "1e9", "--to", "a.glb"),
            "--tolerance is 1e+09; expected metres, 0 or more, at most 1",
        ),
        (("mesh", "--tree", "1", "--colour", "order", "--to", "a.glb"), "--colour is for a .png"),
        (("scene", "--season", "autumn", "--to", "a.glb"), "unknown --season 'autumn'"),
        (("scene", "--quality", "-1", "--to", "a.glb"), "--quality is -1"),
        (("scene", "--detail", "fr", "--to", "a.glb"), "unknown --detail 'fr', did you mean 'far'"),
        (("scene", "--year", "1900", "--to", "a.glb"), "expected a year from 2001 to 2002"),
        (("bark", "--tree", "1", "--cell", "0", "--to", "a.glb"), "--cell is 0"),
        (("bark", "--tree", "1", "--from", "-1", "--to", "a.png"), "--from is -1"),
        (("bark", "--tree", "1", "--height", "nan", "--to", "a.png"), "--height is nan"),
        (("bark", "--tree", "1", "--least-radius", "0", "--to", "a"), "--least-radius is 0"),
        (("bark", "--tree", "1", "--law", "conservd", "--to", "a"), "did you mean 'conserved'?"),
        (("bark", "--tree", "1", "--preset", "oakk", "--to", "a"), "'oakk', did you mean 'oak'?"),
        (("bark", "--tree", "1", "--film", "1900", "--to", "a.png"), "--film: no year 1900"),
        (("bark", "--tree", "1", "--film", "2001", "--shrink", "--to", "a.png"), "a history"),
        (("bark", "--tree", "1", "--model", "flow", "--size", "256", "--to", "a.glb"), "--size"),
        (("bark", "--tree", "1", "--tile", "--from", "1", "--to", "a"), "go with --tile"),
    ],
)
def test_options_are_named_as_typed(
    run_file: Path, tmp_path: Path, words: tuple[str, ...], says: str
) -> None:
    command, *options, to = words
    refused(run_file, (command, "RUN", *options, to), tmp_path / to, says)


def test_a_run_file_may_have_any_name(tmp_path: Path) -> None:
    (tmp_path / "scene").touch()
    refused(tmp_path / "scene", COMMANDS["scene"], tmp_path / "a.glb", "scene: is empty; expected")


def test_one_year_is_no_span() -> None:
    assert span_of(2001, 2003) == "a year from 2001 to 2003"
    assert span_of(2001, 2001) == "2001, the only year"


def test_an_interrupted_file_leaves_nothing(tmp_path: Path) -> None:
    """Neither the file nor what goes beside it; what was there stays."""
    for to in (tmp_path / "a.obj", tmp_path / "b.obj"):
        if to.name == "b.obj":
            to.write_text("old")
            to.with_suffix(".mtl").write_text("old")
        with pytest.raises(KeyboardInterrupt), whole_file(to, overwrite=True) as draft:
            draft.write_text("half")
            draft.with_suffix(".mtl").write_text("half")
            raise KeyboardInterrupt
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "b.obj": "old",
        "b.mtl": "old",
    }


def test_an_interrupted_folder_leaves_nothing(tmp_path: Path) -> None:
    to = tmp_path / "maps"
    with pytest.raises(KeyboardInterrupt), whole_folder(to) as draft:
        (draft / "colour.png").write_text("half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
    to.mkdir()
    (to / "mine.txt").write_text("mine")
    with whole_folder(to) as draft:
        (draft / "trunk").mkdir()
        (draft / "trunk" / "colour.png").write_text("whole")
    assert {path.name for path in to.rglob("*")} == {"mine.txt", "trunk", "colour.png"}


def test_an_image_beside_a_mesh_is_not_replaced(tmp_path: Path) -> None:
    bark = Material("bark", colour_image=np.full((2, 2, 3), 90, np.uint8))
    wood = [Part(tubes(bush(3, 8)), bark)]
    (tmp_path / "a_bark_colour.png").touch()
    with pytest.raises(InputError, match=r"a_bark_colour.png: exists already"):
        write_mesh(wood, tmp_path / "a.obj")
    assert [path.name for path in tmp_path.iterdir()] == ["a_bark_colour.png"]
    write_mesh(wood, tmp_path / "a.obj", overwrite=True)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_path_that_no_file_can_have(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        check_target(tmp_path / ("a" * 300 + ".glb"), overwrite=False)
