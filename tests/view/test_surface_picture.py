"""Pictures of meshes, the command that writes them, and meshes at the end of a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from forest.errors import InputError
from forest.record.run import Run, open_run
from forest.simulation import simulate
from forest.surface.blend import blended, reaction_wood
from forest.surface.export import Material, Part, leaf_parts
from forest.surface.mesh import Mesh
from forest.surface.tubes import tubes
from forest.trees.leaves import leaves_of
from forest.trees.skeleton import Skeleton
from forest.view import tree_mesh
from forest.view.surface_picture import draw_mesh
from forest.view.tree_mesh import species_of
from tests.surface.bushes import bush
from tests.tiny import forest, tiny


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    to = tmp_path_factory.mktemp("runs") / "tiny.h5"
    simulate(tiny("output.sample_trees.meshes=ply"), to).close()
    return to


def _pixels(to: Path) -> np.ndarray:
    return np.asarray(Image.open(to).convert("RGB"), np.float64)


def test_meshes_of_sample_trees_are_written_at_the_end(run_file: Path) -> None:
    with open_run(run_file) as run:
        years = {tree_id: int(run.sample_years(tree_id)[-1]) for tree_id in run.samples}
    folder = run_file.with_name("tiny_meshes")
    assert {p.name for p in folder.iterdir()} == {f"tree_{i}_{y}.ply" for i, y in years.items()}
    for path in folder.iterdir():
        assert trimesh.load(path).is_watertight


def test_a_resumed_run_may_ask_for_other_meshes(tmp_path: Path) -> None:
    to = tmp_path / "run.h5"
    simulate(tiny("years=3"), to).close()
    assert not (tmp_path / "run_meshes").exists()
    simulate(tiny("years=4", "output.sample_trees.meshes=vtp"), to, resume=True).close()
    assert all(p.suffix == ".vtp" for p in (tmp_path / "run_meshes").iterdir())


def test_meshes_at_the_end_may_be_blended(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tree that cannot be is written as tubes, and the others are written all the same."""
    whole = tree_mesh.blended
    refused = 4

    def blend(skeleton: Skeleton) -> Mesh:
        if skeleton.tree_id == refused:
            raise InputError("no memory")
        return whole(skeleton, cell_m=0.004)

    monkeypatch.setattr(tree_mesh, "blended", blend)
    said: list[str] = []
    with open_run(run_file) as run:
        run.path = tmp_path / "run.h5"
        files = tree_mesh.write_samples(run, ".ply", surface="blended", say=said.append)
        assert len(files) == len(run.samples)
    assert said == ["tree 4 is written as tubes: no memory"]
    for to in files:
        pieces = trimesh.load(to).body_count
        assert (pieces > 1) == (f"tree_{refused}_" in to.name)


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply", ".vtp", ".png"])
def test_the_command_writes_a_sample_tree(run_file: Path, tmp_path: Path, suffix: str) -> None:
    to = tmp_path / f"tree{suffix}"
    code, out, err = forest("mesh", run_file, "--tree", "1", "--to", to)
    assert (code, err) == (0, "")
    assert "tree 1 in 2008" in out
    assert to.stat().st_size > 1000
    if suffix == ".ply":
        bare, green = trimesh.load(to), tmp_path / "green.ply"
        assert bare.is_watertight
        forest("mesh", run_file, "--tree", "1", "--to", green, "--leaves")
        assert len(trimesh.load(green, process=False).faces) > len(bare.faces)


def test_the_command_writes_over_nothing_unasked(run_file: Path, tmp_path: Path) -> None:
    for to in (tmp_path / "tree.ply", tmp_path / "tree.png"):  # a mesh, and a picture of it
        to.write_text("mine")
        words = ("mesh", run_file, "--tree", "1", "--kind", "tubes", "--to", to)
        assert forest(*words)[0] == 2
        assert to.read_text() == "mine"
        assert forest(*words, "--force")[0] == 0
        assert to.stat().st_size > 1000


def test_a_seedling_is_written_as_tubes(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    grown = Run.skeleton

    def seedling(run: Run, tree_id: int, year: int) -> Skeleton:
        tree = grown(run, tree_id, year)
        return replace(tree, radius=np.float32(0.0019) / tree.radius.max() * tree.radius)

    monkeypatch.setattr(Run, "skeleton", seedling)
    blended, plain = tmp_path / "a.ply", tmp_path / "b.ply"
    words = ("mesh", run_file, "--tree", "4", "--year", "2001", "--to")
    code, _, err = forest(*words, blended)
    assert (code, err) == (0, "tree 4 is too thin to blend without --cell: tubes\n")
    assert forest(*words, plain, "--kind", "tubes")[::2] == (0, "")
    assert blended.read_bytes() == plain.read_bytes()
    code, _, err = forest(*words, blended, "--force", "--cell", "0.01")
    assert code == 2
    assert "the thickest internode has a radius" in err


def test_the_command_blends_as_it_is_told(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each option reaches the mesh: it is the one that Python makes with the same words."""
    grown = Run.skeleton

    def large(run: Run, tree_id: int, year: int) -> Skeleton:  # enough for a root flare
        tree = grown(run, tree_id, year)
        return replace(tree, start=4 * tree.start, end=4 * tree.end, radius=4 * tree.radius)

    monkeypatch.setattr(Run, "skeleton", large)
    with open_run(run_file) as run:
        tree = run.skeleton(1, 2004)
        wood = reaction_wood(tree, species_of(run, tree))
    said: list[tuple[tuple[str, ...], dict[str, Any]]] = [
        ((), {}),
        (("--reaction",), {"reaction": wood}),
        (("--no-flare",), {"flare": None}),
        (("--readings", "paper"), {"readings": "paper"}),
    ]
    to, volumes = tmp_path / "tree.ply", set()
    for words, same in said:
        given = ("--year", "2004", "--cell", "0.011", "--to", to, "--force", *words)
        assert forest("mesh", run_file, "--tree", "1", *given)[0] == 0
        volume = trimesh.load(to).volume
        assert volume == pytest.approx(blended(tree, cell_m=0.011, **same).volume, rel=1e-6)
        volumes.add(round(volume, 8))
    assert len(volumes) == len(said), volumes


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--tree", "9999", "--to", "x.glb"), "tree 9999 is no sample tree; expected one of its"),
        (("--tree", "1", "--to", "x.glb", "--kind", "tube"), "did you mean 'tubes'?"),
        (("--tree", "1", "--to", "x.glb", "--readings", "papr"), "did you mean 'paper'?"),
        (("--tree", "1", "--to", "x.glb", "--kind", "tubes", "--reaction"), "--reaction: tubes"),
        (("--tree", "1", "--to", "x.glb", "--kind", "tubes", "--cell", "1"), "--cell: tubes"),
        (("--tree", "1", "--to", "x.stl"), "unknown format '.stl'"),
        (("--tree", "1", "--to", "x.glb", "--year", "1900"), "not on record in 1900"),
        (("--tree", "1", "--to", "x.png", "--colour", "radius"), "did you mean 'radius_m'?"),
        (
            ("--tree", "1", "--to", "x.glb", "--kind", "tubes", "--tolerance", "-1"),
            "--tolerance is -1",
        ),
    ],
)
def test_the_command_refuses(
    run_file: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    words = tuple(str(tmp_path / w) if w.startswith("x.") else w for w in words)
    code, _, err = forest("mesh", run_file, *words)
    assert code == 2
    assert said in err
    assert not list(tmp_path.iterdir())


def test_a_tree_without_cards_is_left_by_colouring(run_file: Path, tmp_path: Path) -> None:
    with open_run(run_file) as run:
        skeleton = run.skeleton(1, 2008)
        leaves = leaves_of(skeleton, species_of(run, skeleton))
    parts = [Part(tubes(skeleton)), *leaf_parts(leaves)]
    seen = {}
    for colour in ("texture", "order"):
        draw_mesh(parts, tmp_path / "tree.png", colour_by=colour, window=(120, 160))
        seen[colour] = np.any(_pixels(tmp_path / "tree.png")[:100, 40:] < 250.0, axis=2).sum()
    assert seen["texture"] > 1.5 * seen["order"] > 0


def test_light_comes_from_where_it_is_said(tmp_path: Path) -> None:
    wood = tubes(bush(3, 8), tolerance_m=0.0)
    bumps = np.full((4, 4, 3), (128, 128, 255), np.uint8)
    for material in (Material("plain", colour=(0.5, 0.5, 0.5)), Material("b", normal_image=bumps)):
        means = []
        for side in (-1.0, 1.0):
            to = tmp_path / "pole.png"
            draw_mesh(
                [Part(wood, material)], to, window=(80, 80), light=(side, 0.0, 0.0), bearing_deg=0.0
            )
            grey = _pixels(to).mean(axis=2)
            means.append(grey[grey < 250.0].mean())
        assert means[1] > means[0] + 20.0  # seen from the east, light from the east


def test_bad_pictures_are_refused(tmp_path: Path) -> None:
    wood = tubes(bush(3, 10))
    with pytest.raises(InputError, match="cannot colour by 'ordr', did you mean 'order'"):
        draw_mesh(wood, tmp_path / "x.png", colour_by="ordr")
    bare = type(wood)(wood.points, wood.triangles, wood.uv)
    with pytest.raises(InputError, match="the mesh has no 'order'"):
        draw_mesh(bare, tmp_path / "x.png", colour_by="order")
    with pytest.raises(InputError, match="nothing to draw"):
        draw_mesh([], tmp_path / "x.png")
    assert not list(tmp_path.iterdir())
