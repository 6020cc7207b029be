"""Runs, stands and scenes' files as meshes, and the command that makes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from forest.errors import InputError
from forest.record.run import open_run
from forest.simulation import simulate
from forest.stand import Stand
from forest.view.scenery import scene_of
from tests.surface.gltf import Gltf
from tests.tiny import forest, tiny, write_tiny

TREES = """
[[tree]]
x_m = 15.0
y_m = 18.0
species = "lilac"
most_leaves = 500
height_m = 6.0
"""


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    assert forest("run", write_tiny(folder), "--out", folder / "run.h5")[0] == 0
    return folder / "run.h5"


def test_trees_of_a_year_stand_where_the_table_says(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "stand.glb"
    code, out, err = forest("scene", run_file, "--year", "2007", "--to", to)
    assert code == 0, err
    assert "living trees in 2007" in err and "shapes" in err
    file = Gltf(to)
    file.check()
    nodes = [node for node in file.json["nodes"] if "extras" in node]
    with open_run(run_file) as run:
        trees = run.read("trees", years=(2007, 2007))
    trees = trees[trees["status"] == "living"]
    assert f"{len(trees)} trees of {len(file.json['meshes']) - 1} shapes" in out
    extras = [node["extras"] for node in nodes]
    assert [e["tree_id"] for e in extras] == trees["tree_id"].tolist()
    assert [e["species"] for e in extras] == trees["species"].astype(str).tolist()
    dbh = [e.get("dbh_cm", np.nan) for e in extras]
    np.testing.assert_allclose(dbh, trees["dbh_cm"], atol=0.001)
    place = np.array([node["translation"] for node in nodes])
    np.testing.assert_allclose(place[:, 0], trees["x_m"], rtol=1e-6)
    np.testing.assert_allclose(-place[:, 2], trees["y_m"], rtol=1e-6)
    for node, height in zip(nodes, trees["height_m"], strict=True):
        wood = file.json["meshes"][node["mesh"]]["primitives"][0]["attributes"]["POSITION"]
        top = file.json["accessors"][wood]["max"][1] * node["scale"][1]
        assert top == pytest.approx(height, rel=0.1, abs=0.05)


def test_winter_without_leaves_and_ground(run_file: Path, tmp_path: Path) -> None:
    words = ("scene", run_file, "--to", tmp_path / "s.glb", "--force")
    assert forest(*words, "--season", "winter", "--no-ground")[0] == 0
    file = Gltf(tmp_path / "s.glb")
    named = {material["name"] for material in file.json["materials"]}
    assert named == {
        "bark of fagus_sylvatica",
        "bark of pinus_sylvestris",
        "leaves of pinus_sylvestris",
    }
    assert all(node["name"].startswith("tree ") for node in file.json["nodes"])
    assert forest(*words, "--no-leaves")[0] == 0
    materials = Gltf(tmp_path / "s.glb").json["materials"]
    assert all(material["alphaMode"] == "OPAQUE" for material in materials)


def test_a_stand_is_as_its_run(tmp_path: Path) -> None:
    scenario = tiny("years=4")
    with simulate(scenario, out=tmp_path / "run.h5") as run:
        shapes = []
        stand = Stand(scenario)
        for _ in range(4):
            stand.step()
        shapes = [stand.skeleton(int(i)) for i in stand.rows.tree_id]
        of_run = scene_of(run, 2004, shapes=shapes, tile=2)
    of_stand = scene_of(stand, tile=2)
    np.testing.assert_array_equal(of_run.census.tree_id, of_stand.census.tree_id)
    np.testing.assert_allclose(of_run.instances.place, of_stand.instances.place, rtol=1e-6)
    np.testing.assert_allclose(of_run.instances.scale, of_stand.instances.scale, rtol=1e-5)
    assert sum(of_run.standing_triangles) == sum(of_stand.standing_triangles)
    with pytest.raises(InputError, match="a run only"):
        scene_of(stand, 2004)


def test_residual_trees_stand_with_numbers_below_0(tmp_path: Path) -> None:
    tree = '{name="old", species="lilac", x_m=5.0, y_m=5.0, height_m=4.0}'
    stand = Stand(tiny("years=1", f"residual_trees=[{tree}]"))
    stand.step()
    census = scene_of(stand, detail="far").census
    assert census.tree_id[-1] == -1 and census.species[-1] == "lilac"
    assert census.dbh_cm[-1] == pytest.approx(stand.residual.trees[0].dbh_cm)


def test_the_command_draws_and_writes_for_vtk(run_file: Path, tmp_path: Path) -> None:
    to = tmp_path / "s.png"
    assert forest("scene", run_file, "--to", to, "--detail", "50")[0] == 0
    with Image.open(to) as image:
        assert np.asarray(image, float).std() > 15.0
    assert forest("scene", run_file, "--to", tmp_path / "s.vtm", "--tile", "2")[0] == 0
    assert len(list((tmp_path / "s").iterdir())) == 5


def test_scenes_of_files_become_meshes(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(TREES)
    to = tmp_path / "s.glb"
    code, out, err = forest("scene", tmp_path / "scene.toml", "--to", to, "--detail", "tree")
    assert code == 0, err
    assert "1 trees of 1 shapes" in out
    (tree,) = (node for node in Gltf(to).json["nodes"] if "extras" in node)
    assert tree["extras"] == {"tree_id": 0, "species": "lilac"}
    assert tree["translation"] == [15.0, 0.0, -18.0]
    assert Gltf(to).json["scenes"][0]["extras"] == {"origin_m": [0.0, 0.0]}
    code, _, err = forest("scene", tmp_path / "scene.toml", "--to", to, "--year", "5", "--force")
    assert code == 2 and "run files" in err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--detail", "stnd"), "did you mean 'stand'"),
        (("--detail", "-5"), "a range of 0.1 to 100,000 m"),
        (("--detail", "1e-9"), "--detail is 1e-09"),
        (("--detail", "inf"), "--detail is inf"),
        (("--year", "1900"), "a year from 2001 to 2008"),
        (("--season", "sumer"), "did you mean 'summer'"),
        (("--quality", "0"), "--quality is 0"),
        (("--quality", "1e9"), "above 0 and at most 10"),
        (("--tile", "0"), "--tile"),
        (("--to", "s.gltf"), "a name that ends in .glb"),
        (("--to", "s.vtp", "--instanced"), "--instanced"),
    ],
)
def test_bad_options_are_refused(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[str, ...],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    words = () if "--to" in options else ("--to", "s.glb")
    code, _, err = forest("scene", run_file, *words, *options)
    assert code == 2
    assert says in err.splitlines()[-1]
    assert not list(tmp_path.iterdir())
