"""`forest bark`, and bark on the meshes at the end of a run."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from forest import simulate
from forest.errors import InputError
from forest.record.run import open_run
from forest.surface.bark.axes import LEAST_RADIUS_M
from forest.surface.tubes import tubes
from forest.view import tree_mesh
from forest.view.tree_mesh import barked_parts
from tests.tiny import forest, tiny

#: The trees are eight years old.
THIN = ("--least-radius", "0.006")


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    to = tmp_path_factory.mktemp("bark") / "tiny.h5"
    simulate(tiny(), to).close()
    return to


def thick(run_file: Path) -> tuple[int, int]:
    """Give the thickest sample tree, and its last year."""
    with open_run(run_file) as run:
        last = {tree: int(run.sample_years(tree)[-1]) for tree in run.samples}
        tree = max(last, key=lambda tree: run.skeleton(tree, last[tree]).radius[0])
    return tree, last[tree]


def test_list_names_the_presets() -> None:
    code, out, _ = forest("bark", "--list")
    assert code == 0
    assert "Quercus robur" in out
    assert len(out.splitlines()) >= 7


def test_maps_of_all_axes(run_file: Path, tmp_path: Path) -> None:
    tree, _ = thick(run_file)
    to = tmp_path / "bark"
    words = ("bark", run_file, "--tree", tree, "--to", to, "--size", 256, "--preset", "oak", *THIN)
    code, out, err = forest(*words)
    assert code == 0, err
    assert "oak bark" in out
    names = {path.name for path in (to / "trunk").iterdir()}
    assert names >= {"colour.png", "normal.png", "height.png", "roughness.png", "occlusion.png"}
    assert Image.open(to / "trunk" / "colour.png").width == 256
    code, _, err = forest(*words)
    assert code == 2
    assert "not empty" in err


def test_mesh_with_bark(run_file: Path, tmp_path: Path) -> None:
    tree, year = thick(run_file)
    for name, options in (
        ("maps.glb", ("--kind", "tubes", "--size", 256)),
        ("relief.ply", ("--cell", 0.004, "--shrink")),
    ):
        to = tmp_path / name
        words = ("bark", run_file, "--tree", tree, "--year", year, "--to", to, *options, *THIN)
        code, _, err = forest(*words)
        assert code == 0, err
        assert to.stat().st_size > 10_000


def test_pictures_by_year_grow(run_file: Path, tmp_path: Path) -> None:
    tree, year = thick(run_file)
    to = tmp_path / "film.png"
    film = f"{year - 3},{year}"
    part = ("--from", 0.0, "--height", 0.3)
    words = ("bark", run_file, "--tree", tree, "--film", film, *part, "--to", to, *THIN)
    code, _, err = forest(*words)
    assert code == 0, err
    picture = np.asarray(Image.open(to).convert("L"))
    young, old = np.hsplit(picture, 2)
    assert 0 < (young < 250).sum() < (old < 250).sum()


def test_flow_bark(run_file: Path, tmp_path: Path) -> None:
    tree, _ = thick(run_file)
    to = tmp_path / "flow.ply"
    words = ("--tree", tree, "--model", "flow", "--preset", "maple", "--to", to)
    code, out, err = forest("bark", run_file, *words)
    assert code == 0, err
    assert "flow bark" in out
    assert to.stat().st_size > 1000


def test_a_parametric_tree_and_a_tile(tmp_path: Path) -> None:
    to = tmp_path / "tile"
    words = ("bark", "--parametric", "quaking_aspen", "--tile", "--size", 256, "--to", to)
    code, out, err = forest(*words)
    assert code == 0, err
    assert "aspen" in out
    colour = np.asarray(Image.open(to / "colour.png")).astype(float)
    wrap = np.abs(colour[:, 0] - colour[:, -1]).mean()
    assert wrap < 3.0 * np.abs(np.diff(colour, axis=1)).mean() + 1.0


def test_measured_girths_drive_the_cracks(tmp_path: Path) -> None:
    girths, to = tmp_path / "girths.csv", tmp_path / "trunk.png"
    girths.write_text("year,girth_cm\n1990,30\n2005,45\n2020,70\n")
    words = ("bark", "--parametric", "quaking_aspen", "--least-radius", 0.15, "--history", girths)
    code, out, err = forest(*words, "--film", "1990,2020", "--to", to)
    assert code == 0, err
    assert "aspen bark" in out and to.stat().st_size > 1000
    code, _, err = forest(*words, "--film", "1980", "--to", to, "--force")
    assert code == 2 and "a year from 1990 to 2020" in err
    code, _, err = forest(*words, "--shrink", "--to", to, "--force")
    assert code == 2 and "--history does not go with --shrink" in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--to", "x.glb"), "which tree?"),
        (("--parametric", "quaking_aspen"), "nothing to write"),
        (("--parametric", "quaking_aspen", "--to", "x.glb", "--preset", "oka"), "oak"),
        (("--parametric", "quaking_aspen", "--to", "x.gif"), "unknown format '.gif'"),
        (("--parametric", "quaking_aspen", "--to", "x", "--size", 1000), "--size 1000"),
        (("--parametric", "quaking_aspen", "--to", "x.glb", "--film", "1990"), "--film draws"),
        (("--parametric", "quaking_aspen", "--to", "x.png", "--film", "may"), "'may'"),
        (("--parametric", "quaking_aspen", "--to", "x.glb", "--kind", "cone"), "unknown kind"),
        (("--parametric", "quaking_aspen", "--to", "x.glb", "--tile"), "a folder"),
        (("--parametric", "quaking_aspen", "--to", "x.png", "--cell", 0.1), "--cell"),
        (("--parametric", "quaking_aspen", "--to", "x", "--height", -1), "--height is -1"),
        (("--parametric", "quaking_aspen", "--to", "x", "--year", 3), "for a run"),
        (("--parametric", "quaking_aspen", "--to", "x", "--model", "flow"), "flow with --to"),
    ],
)
def test_bad_input_is_one_line(
    words: tuple[object, ...], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = forest("bark", *words)
    assert code == 2
    assert says in err
    assert len(err.strip().splitlines()) == 1


def test_an_unknown_tree_or_none(run_file: Path, tmp_path: Path) -> None:
    for words, says in (((), "--tree"), (("--tree", 999), "nearest")):
        code, _, err = forest("bark", run_file, *words, "--to", tmp_path / "a.glb")
        assert code == 2
        assert says in err


def test_meshes_at_the_end_of_a_run_have_bark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trees thick enough do; others have plain wood."""
    small = partial(tree_mesh.dressed_parts, size=256)  # pixels: large maps take long
    monkeypatch.setattr(tree_mesh, "dressed_parts", small)
    samples = "output.sample_trees"
    simulate(tiny(f"{samples}.meshes=obj", f"{samples}.bark=true"), tmp_path / "run.h5").close()
    barked = {
        int(to.name.split("_")[1]): "usemtl bark_0" in to.read_text()
        for to in (tmp_path / "run_meshes").glob("*.obj")
    }
    with open_run(tmp_path / "run.h5") as run:
        last = {tree: int(run.sample_years(tree)[-1]) for tree in run.samples}
        stout = {t: run.skeleton(t, y).radius.max() >= LEAST_RADIUS_M for t, y in last.items()}
    assert barked == stout
    assert set(stout.values()) == {True, False}


def test_bark_or_a_blend_at_the_end_of_a_run_needs_meshes() -> None:
    for key in ("bark=true", "surface=blended"):
        with pytest.raises(InputError, match="meshes"):
            tiny(f"output.sample_trees.{key}")


def test_bark_for_a_mesh(run_file: Path) -> None:
    tree, year = thick(run_file)
    with open_run(run_file) as run:
        skeleton = run.skeleton(tree, year)
        wood = tubes(skeleton)
        parts = barked_parts(run, skeleton, year, wood, least_radius_m=0.006)
    assert parts[0].name == "bark_0"
    assert sum(len(part.mesh.triangles) for part in parts) == len(wood.triangles)
