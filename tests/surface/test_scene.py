"""Stands as meshes: what is drawn of a tree, and glTF and VTK files of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.surface.detail import Sight
from forest.surface.export.scene_file import write_scene
from forest.surface.export.scene_glb import CARD, INSTANCING, card_corners
from forest.surface.instances import Instances, Model
from forest.surface.scene import Census, Scene, build_scene, drawn_axes, ground_of
from forest.surface.terrain import HeightField
from forest.trees.leaves import LEAF_SHAPES
from forest.trees.skeleton import Skeleton
from tests.reference.scene import kept_axes
from tests.surface.bushes import bush
from tests.surface.gltf import Gltf
from tests.surface.stands import bushy

PLACES = [(1.0, 2.0, 0.0), (7.0, 3.0, 0.5), (4.0, 8.0, 0.0), (9.0, 9.0, 1.0)]
SCALES = [1.0, 0.5, 2.0, 1.5]


@pytest.fixture(scope="module")
def models() -> list[Model]:
    return [bushy(3, 60), bushy(5, 90, evergreen=True)]


@pytest.fixture(scope="module")
def scene(models: list[Model]) -> Scene:
    return four(models)


def four(models: list[Model], **words: object) -> Scene:
    """Put up two trees of each model."""
    census = Census(
        np.array([11, 12, 13, 14]), np.array(["beech", "fir"] * 2), np.array([9.0, np.nan, 7.5, 8])
    )
    instances = Instances.of([0, 1, 0, 1], PLACES, SCALES)
    ground = ground_of(HeightField.flat(), (0.0, 0.0, 10.0, 10.0), (0.4, 0.3, 0.2))
    return build_scene(models, instances, census=census, ground=ground, **words)  # type: ignore[arg-type]


@given(
    seed=st.integers(0, 1000),
    n=st.integers(1, 60),
    shares=st.tuples(st.just(1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
)
@settings(max_examples=25, deadline=None)
def test_axes_are_left_out_thinnest_first(
    seed: int, n: int, shares: tuple[float, float, float]
) -> None:
    tree = bush(seed, n)
    fewer = drawn_axes(tree, np.array(shares))
    kept = np.isin(tree.axis, sorted(kept_axes(tree, shares)))
    np.testing.assert_array_equal(fewer.serial, tree.serial[kept])
    np.testing.assert_array_equal(fewer.end, tree.end[kept])
    base = np.flatnonzero(fewer.parent < 0)
    assert base.tolist() == [0]  # nothing floats
    by_serial = dict(zip(tree.serial.tolist(), tree.parent.tolist(), strict=True))
    for serial, parent in zip(fewer.serial[1:].tolist(), fewer.parent[1:].tolist(), strict=True):
        assert fewer.serial[parent] == tree.serial[by_serial[serial]]


def test_less_is_drawn_of_what_is_farther(models: list[Model]) -> None:
    counts = [four(models, detail=d).triangles for d in ("tree", "stand", "far", 3000.0)]
    assert counts == sorted(counts, reverse=True)
    near, stand, far, _ = counts
    leaves = sum(len(model.description.leaves.shape) for model in models)
    assert near[1] == 2 * leaves  # every leaf
    assert stand[1] < near[1] and far[1] == pytest.approx(near[1] / 8.0, rel=0.2)
    assert far[0] < 0.5 * near[0]


def test_leaves_that_are_left_have_the_area_of_all(models: list[Model]) -> None:
    for shape, model in zip(four(models, detail="far").shapes, models, strict=True):
        assert shape.leaves.area.sum() == pytest.approx(model.description.leaves.area.sum())


def test_the_season_takes_leaves_and_colours_them(models: list[Model]) -> None:
    bare, evergreen = four(models, sight=Sight("winter")).shapes
    assert not len(bare.leaves.shape) and len(evergreen.leaves.shape)
    assert evergreen.foliage == models[1].foliage["winter"]
    assert four(models, leaves=False).triangles[1] == 0


def test_sums_count_shapes_once_or_as_they_stand(scene: Scene) -> None:
    once, standing = np.array(scene.triangles), np.array(scene.standing_triangles)
    np.testing.assert_array_equal(standing, 2 * once)


def test_wood_is_closed(scene: Scene) -> None:
    for shape in scene.shapes:
        assert shape.wood.is_watertight and shape.wood.volume > 0.0


def test_the_ground_follows_the_terrain() -> None:
    slope = HeightField(np.repeat(np.arange(20.0, 0.0, -1.0)[:, None], 20, 1), 1.0)
    mesh = ground_of(slope, (0.0, 0.0, 20.0, 20.0), (0.4, 0.3, 0.2)).mesh
    assert len(mesh.triangles) == 2 * 20 * 20
    x, y, z = mesh.points.T
    np.testing.assert_array_equal(z, slope.at(x, y))
    assert (mesh.face_normals()[:, 2] > 0.0).all()
    flat = ground_of(HeightField.flat(2.0), (0.0, 0.0, 20.0, 10.0), (0.4, 0.3, 0.2)).mesh
    assert len(flat.triangles) == 2 and flat.area == pytest.approx(200.0)


@pytest.fixture(scope="module")
def glb(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(scene, tmp_path_factory.mktemp("scene") / "s.glb")


def test_trees_are_nodes_that_share_meshes(glb: Path, scene: Scene) -> None:
    file = Gltf(glb)
    file.check()
    trees = [node for node in file.json["nodes"] if "extras" in node]
    assert [node["extras"]["tree_id"] for node in trees] == [11, 12, 13, 14]
    assert [node["extras"]["species"] for node in trees] == ["beech", "fir"] * 2
    assert [node["extras"].get("dbh_cm") for node in trees] == [9.0, None, 7.5, 8.0]
    assert trees[0]["mesh"] == trees[2]["mesh"] != trees[1]["mesh"] == trees[3]["mesh"]
    for node, place, scale in zip(trees, PLACES, SCALES, strict=True):
        x, y, z = node["translation"]
        assert (x, -z, y) == place  # y up
        assert node["scale"] == [scale] * 3
    assert len(file.json["meshes"]) == len(scene.shapes) + 1
    assert "extensionsRequired" not in file.json


def test_leaves_are_cut_out_and_face_up(glb: Path, scene: Scene) -> None:
    file = Gltf(glb)
    tree = next(node for node in file.json["nodes"] if "extras" in node)
    shape = scene.shapes[0]
    wood, *cards = file.json["meshes"][tree["mesh"]]["primitives"]
    assert len(cards) == len(np.unique(shape.leaves.shape))
    assert file.json["materials"][wood["material"]]["alphaMode"] == "OPAQUE"
    found = 0
    for primitive in cards:
        material = file.json["materials"][primitive["material"]]
        assert material["alphaMode"] == "MASK" and material["doubleSided"]
        corners = file.array(primitive["attributes"]["POSITION"])
        a, b, c = corners[file.array(primitive["indices"]).reshape(-1, 3)].transpose(1, 0, 2)
        up = np.cross(b - a, c - a)[:, 1]
        assert (up >= -1e-9).all()
        uv = file.array(primitive["attributes"]["TEXCOORD_0"]) / 255.0
        np.testing.assert_allclose(uv[:4], [(0, 1), (1, 1), (1, 0), (0, 0)], atol=0.01)
        found += len(corners) // 4
    assert found == len(shape.leaves.shape)


def test_instanced_cards_lie_where_merged_ones_do(scene: Scene, glb: Path, tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    one, other = Gltf(glb), Gltf(write_scene(scene, tmp_path / "i.glb", instanced=True))
    other.check()
    assert other.json["extensionsRequired"] == [INSTANCING]
    merged, parts = one.json["meshes"], other.json["nodes"]
    trees = [node for node in parts if "extras" in node]
    for tree in trees:
        mine = next(n for n in one.json["nodes"] if n.get("extras", {}) == tree["extras"])
        cards = merged[mine["mesh"]]["primitives"][1:]
        assert len(cards) == len(tree["children"])
        for primitive, child in zip(cards, tree["children"], strict=True):
            attributes = parts[child]["extensions"][INSTANCING]["attributes"]
            shift, turn, size = (
                other.array(attributes[name]) for name in ("TRANSLATION", "ROTATION", "SCALE")
            )
            card = other.json["meshes"][parts[child]["mesh"]]["primitives"][0]
            corners = other.array(card["attributes"]["POSITION"])[None] * size[:, None]
            turned = np.einsum("nij,nkj->nki", Rotation.from_quat(turn).as_matrix(), corners)
            np.testing.assert_allclose(
                (turned + shift[:, None]).reshape(-1, 3),
                one.array(primitive["attributes"]["POSITION"]),
                atol=1e-5,
            )


def test_cards_are_as_long_and_wide_as_leaves(scene: Scene) -> None:
    leaves = scene.shapes[0].leaves
    corners = card_corners(leaves, CARD)
    wide = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    long = np.linalg.norm(corners[:, 2] - corners[:, 1], axis=1)
    np.testing.assert_allclose(wide, leaves.width)
    np.testing.assert_allclose(long, leaves.length)


def test_other_programs_open_glb(glb: Path, scene: Scene) -> None:
    import pyvista
    import trimesh

    wood, cards = scene.standing_triangles
    opened = trimesh.load_scene(glb)
    assert sum(len(mesh.faces) for mesh in opened.dump()) == wood + cards + 2
    low, high = opened.bounds
    assert low[1] <= 0.0 < high[1]
    blocks = pyvista.read(glb).combine()
    assert blocks.n_cells == wood + cards + 2


@pytest.mark.parametrize("suffix", [".vtp", ".vtm"])
def test_vtk_has_every_tree(scene: Scene, tmp_path: Path, suffix: str) -> None:
    import pyvista

    path = write_scene(scene, tmp_path / f"s{suffix}")
    read = pyvista.read(path)
    wood, cards = scene.standing_triangles
    if suffix == ".vtm":
        names = ["ground", "wood of beech", "leaves of beech", "wood of fir", "leaves of fir"]
        assert read.keys() == names
        read = read.combine()
    assert read.n_cells == wood + cards // 2 + 2
    leaf, tree_id = (np.asarray(read.cell_data[name]) for name in ("leaf", "tree_id"))
    assert leaf.sum() == cards // 2
    middle = read.cell_centers().points
    for k, (place, scale) in enumerate(zip(PLACES, SCALES, strict=True)):
        points = scene.shapes[k % 2].wood.points * scale + place
        here = middle[(tree_id == 11 + k) & (leaf == 0)]
        assert (here >= points.min(axis=0) - 1e-4).all()
        assert (here <= points.max(axis=0) + 1e-4).all()


def test_files_are_replaced_only_when_asked(scene: Scene, tmp_path: Path) -> None:
    for name in ("s.glb", "s.vtm"):
        path = write_scene(scene, tmp_path / name)
        with pytest.raises(InputError, match="exists already"):
            write_scene(scene, path)
        write_scene(scene, path, overwrite=True)
    (tmp_path / "s" / "other.txt").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        write_scene(scene, tmp_path / "s.vtm", overwrite=True)
    assert (tmp_path / "s" / "other.txt").read_text() == "mine"


def test_bad_words_are_refused(scene: Scene, models: list[Model], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'stand'"):
        four(models, detail="stnd")
    with pytest.raises(InputError, match=r"0\.1 to 100,000 m"):
        four(models, detail=0.0)
    with pytest.raises(InputError, match="no tree"):
        build_scene(models, Instances.of([], [], []))
    with pytest.raises(InputError, match="unknown format"):
        write_scene(scene, tmp_path / "s.gltf")
    with pytest.raises(InputError, match=r"\.glb files"):
        write_scene(scene, tmp_path / "s.vtp", instanced=True)


def test_what_no_memory_holds_is_refused_before(models: list[Model], tmp_path: Path) -> None:
    n = 20_000_000
    many = Instances(np.zeros(n, np.int32), np.broadcast_to(0.0, (n, 3)), np.broadcast_to(1.0, n))
    nobody = Census(*(np.broadcast_to(v, n) for v in (np.int64(0), np.str_("x"), np.float64(1.0))))
    crowd = build_scene(models, many, census=nobody)
    with pytest.raises(InputError, match="GB of memory"):
        write_scene(crowd, tmp_path / "s.vtp")
    assert not list(tmp_path.iterdir())


def test_every_outline_has_an_image() -> None:
    from forest.surface.export.parts import leaf_image
    from forest.trees.leaves import OUTLINES, outline_area

    for code in range(len(LEAF_SHAPES)):
        share = np.mean(leaf_image(code)[:, :, 3] > 127)
        assert share == pytest.approx(outline_area(OUTLINES[code]), abs=0.08)


def test_a_tree_of_one_internode(models: list[Model]) -> None:
    tree = bush(1, 1)
    lone = Skeleton(**{**tree.__dict__, "end": tree.start + np.array([0.0, 0.0, 0.1])})
    model = Model.of(
        lone,
        models[0].description.leaves,
        evergreen=False,
        bark=models[0].bark,
        foliage=models[0].foliage,
    )
    assert four([model, model]).triangles[0] > 0
