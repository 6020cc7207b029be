"""Files of meshes: valid by their formats' rules, whole or not there, and readable by others."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
import trimesh

from forest.errors import InputError
from forest.surface.export import SUFFIXES, Material, Part, leaf_parts, write_mesh
from forest.surface.export.glb import Y_UP
from forest.surface.export.parts import leaf_image
from forest.surface.mesh import Mesh
from forest.surface.tubes import tubes
from forest.trees.leaves import LEAF_SHAPES, OUTLINES, Leaves, outline_area
from tests.surface.bushes import bush

_COMPONENTS = {5126: ("<f4", 4), 5125: ("<u4", 4)}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_BUMPS = np.full((4, 4, 3), (128, 128, 255), np.uint8)


def _wood() -> Mesh:
    return tubes(bush(3, 30), tolerance_m=0.0, most_sides=8)


def _leaves(n: int = 5) -> Leaves:
    rng = np.random.default_rng(1)
    return Leaves(
        position=rng.uniform(0.0, 1.0, (n, 3)),
        direction=np.tile((1.0, 0.0, 0.0), (n, 1)),
        normal=np.tile((0.0, 0.0, 1.0), (n, 1)),
        length=np.full(n, 0.1),
        width=np.full(n, 0.05),
        shape=np.array([0, 6] * n, np.int8)[:n],
        stem=np.arange(n, dtype=np.int32),
    )


def _parts() -> list[Part]:
    bark = Material(
        "bark",
        colour_image=_BUMPS,
        normal_image=_BUMPS,
        rough_image=_BUMPS,
        tile_m=(0.2, 0.5),
    )
    return [Part(_wood(), bark), *leaf_parts(_leaves(), tree_id=7)]


def _check_gltf(path: Path) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Hold a .glb to the rules of the specification; give its JSON and its accessors' values."""
    content = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON" and size % 4 == 0
    gltf = json.loads(content[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", content, 20 + size)
    assert kind == b"BIN\0" and binary_size % 4 == 0
    binary = content[28 + size :]
    assert len(binary) == binary_size
    assert gltf["asset"]["version"] == "2.0"
    (buffer,) = gltf["buffers"]
    assert buffer["byteLength"] <= binary_size < buffer["byteLength"] + 4
    for view in gltf["bufferViews"]:
        assert view["byteOffset"] % 4 == 0 and view["byteLength"] > 0
        assert view["byteOffset"] + view["byteLength"] <= buffer["byteLength"]
    values = []
    for accessor in gltf["accessors"]:
        dtype, width = _COMPONENTS[accessor["componentType"]][0], _WIDTHS[accessor["type"]]
        view = gltf["bufferViews"][accessor["bufferView"]]
        assert accessor["count"] > 0
        assert accessor["count"] * width * 4 == view["byteLength"]
        start = view["byteOffset"] + accessor.get("byteOffset", 0)
        array = np.frombuffer(binary, dtype, accessor["count"] * width, start).reshape(-1, width)
        assert np.isfinite(array).all()
        for bound, of in (("min", array.min(axis=0)), ("max", array.max(axis=0))):
            if bound in accessor:
                assert np.array_equal(np.asarray(accessor[bound], dtype), of)
        values.append(array)
    for mesh in gltf["meshes"]:
        for primitive in mesh["primitives"]:
            _check_primitive(gltf, primitive, values)
    for node in gltf["nodes"]:
        assert 0 <= node["mesh"] < len(gltf["meshes"])
    (scene,) = gltf["scenes"]
    assert sorted(scene["nodes"]) == list(range(len(gltf["nodes"])))
    _check_materials(gltf, binary)
    return gltf, values


def _check_primitive(
    gltf: dict[str, Any], primitive: dict[str, Any], values: list[np.ndarray]
) -> None:
    attributes = {k: v for k, v in primitive["attributes"].items() if v is not None}
    points = len(values[attributes["POSITION"]])
    assert {"min", "max"} <= gltf["accessors"][attributes["POSITION"]].keys()
    for name, k in attributes.items():
        known = name in ("POSITION", "NORMAL", "TANGENT", "TEXCOORD_0")
        assert known or (name.startswith("_") and name == name.upper())
        assert len(values[k]) == points
        # Of what stands beside points, no component may be an unsigned integer.
        assert gltf["accessors"][k]["componentType"] == 5126
        assert gltf["bufferViews"][gltf["accessors"][k]["bufferView"]]["target"] == 34962
    assert np.allclose(np.linalg.norm(values[attributes["NORMAL"]], axis=1), 1.0, atol=1e-5)
    if "TANGENT" in attributes:
        tangent = values[attributes["TANGENT"]]
        assert np.allclose(np.linalg.norm(tangent[:, :3], axis=1), 1.0, atol=1e-5)
        assert np.all(np.abs(tangent[:, 3]) == 1.0)
        across = np.sum(tangent[:, :3] * values[attributes["NORMAL"]], axis=1)
        assert np.allclose(across, 0.0, atol=1e-5)
    indices = values[primitive["indices"]]
    accessor = gltf["accessors"][primitive["indices"]]
    assert accessor["componentType"] == 5125 and len(indices) % 3 == 0
    assert gltf["bufferViews"][accessor["bufferView"]]["target"] == 34963
    assert indices.max() < points
    assert primitive["mode"] == 4
    assert 0 <= primitive["material"] < len(gltf["materials"])
    material = gltf["materials"][primitive["material"]]
    assert ("TANGENT" in attributes) == ("normalTexture" in material)


def _check_materials(gltf: dict[str, Any], binary: bytes) -> None:
    for material in gltf["materials"]:
        shine = material["pbrMetallicRoughness"]
        assert all(0.0 <= c <= 1.0 for c in shine["baseColorFactor"])
        assert 0.0 <= shine["roughnessFactor"] <= 1.0 and 0.0 <= shine["metallicFactor"] <= 1.0
        assert material["alphaMode"] in ("OPAQUE", "MASK")
        assert ("alphaCutoff" in material) == (material["alphaMode"] == "MASK")
        used = [shine.get("baseColorTexture"), shine.get("metallicRoughnessTexture")]
        used += [material.get("normalTexture"), material.get("occlusionTexture")]
        assert all(t["index"] < len(gltf["textures"]) for t in used if t)
    for texture in gltf.get("textures", []):
        assert texture["source"] < len(gltf["images"])
        assert texture["sampler"] < len(gltf["samplers"])
    for image in gltf.get("images", []):
        view = gltf["bufferViews"][image["bufferView"]]
        assert "target" not in view
        assert image["mimeType"] == "image/png"
        assert binary[view["byteOffset"] :].startswith(b"\x89PNG")


def test_glb_keeps_the_rules_of_gltf(tmp_path: Path) -> None:
    parts = _parts()
    gltf, values = _check_gltf(write_mesh(parts, tmp_path / "tree.glb"))
    assert [mesh["name"] for mesh in gltf["meshes"]] == ["wood", "leaves_oval", "leaves_spray"]
    wood, leaf = gltf["materials"][:2]
    assert (
        wood["occlusionTexture"]["index"]
        == (wood["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"])
    )
    assert len(gltf["images"]) == 3  # the bark's one image, and one for each outline
    assert leaf["alphaMode"] == "MASK" and leaf["doubleSided"]
    attributes = gltf["meshes"][0]["primitives"][0]["attributes"]
    split = parts[0].mesh.split_at_seams()
    for name, known in (("_RADIUS_M", "radius_m"), ("_BIRTH_YEAR", "birth_year")):
        assert np.array_equal(
            values[attributes[name]][:, 0], parts[0].mesh.data[known][split.source]
        )
    shift = np.array(gltf["nodes"][0]["translation"])
    there = values[attributes["POSITION"]] + shift
    assert np.allclose(there, parts[0].mesh.points[split.source] @ Y_UP.T, atol=1e-6)
    texture = values[attributes["TEXCOORD_0"]]
    assert np.allclose(texture[:, 0] * 0.2, split.uv[:, 0], atol=1e-5)
    assert np.allclose((1.0 - texture[:, 1]) * 0.5, split.uv[:, 1], atol=1e-5)


def test_glb_holds_a_mesh_once_for_all_its_places(tmp_path: Path) -> None:
    turned = np.eye(4)
    turned[:3, :3] = [(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    turned[:3, 3] = (5.0, 6.0, 0.0)
    part = Part(_wood(), places=np.stack((np.eye(4), turned)))
    gltf, _ = _check_gltf(write_mesh([part], tmp_path / "two.glb"))
    assert len(gltf["meshes"]) == 1 and len(gltf["nodes"]) == 2
    seen = trimesh.load(tmp_path / "two.glb").bounds
    placed = part.placed().points @ Y_UP.T
    assert np.allclose(seen, (placed.min(axis=0), placed.max(axis=0)), atol=1e-6)


def test_trimesh_reads_what_was_written(tmp_path: Path) -> None:
    wood = _wood()
    ply = trimesh.load(write_mesh(wood, tmp_path / "wood.ply"))
    assert ply.is_watertight
    assert np.isclose(ply.volume, wood.volume)
    glb = trimesh.load(write_mesh(_parts(), tmp_path / "tree.glb"))
    assert {len(g.faces) for g in glb.geometry.values()} == {len(wood.triangles), 4, 6}
    obj = trimesh.load(write_mesh(_parts(), tmp_path / "tree.obj"))
    assert sum(len(g.faces) for g in obj.geometry.values()) == len(wood.triangles) + 10


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_vtk_reads_what_was_written(tmp_path: Path, suffix: str) -> None:
    parts = _parts()
    whole = Mesh.together([part.mesh for part in parts])
    to = write_mesh(parts, tmp_path / f"tree{suffix}")
    found = pyvista.read(to)
    if suffix == ".glb":
        found = found.combine()
    assert found.n_cells == len(whole.triangles)
    points = whole.points if suffix in (".ply", ".vtp") else whole.points @ Y_UP.T
    bounds = np.reshape(found.bounds, (3, 2)).T
    assert np.allclose(bounds, (points.min(axis=0), points.max(axis=0)), atol=1e-5)
    if suffix == ".vtp":
        assert found.n_points == len(whole.points)
        for name in ("radius_m", "order", "birth_year", "tree_id"):
            assert np.array_equal(found.point_data[name], whole.data[name])
        assert found.cell_data["leaf"].sum() == 10


def test_ply_holds_what_is_known_of_points(tmp_path: Path) -> None:
    wood = _wood()
    to = write_mesh(wood, tmp_path / "wood.ply")
    found = trimesh.load(to, process=False).metadata["_ply_raw"]["vertex"]["data"]
    for name, values in wood.data.items():
        assert np.array_equal(np.ravel(found[name]), values)


def test_obj_names_its_materials_and_images(tmp_path: Path) -> None:
    to = write_mesh(_parts(), tmp_path / "tree.obj")
    lines = to.with_suffix(".mtl").read_text().split("\n")
    named = {line.split()[-1] for line in lines if line.split()[:1] in (["map_Kd"], ["norm"])}
    assert {"tree_bark_colour.png", "tree_bark_normal.png"} <= named
    assert all((tmp_path / name).exists() for name in named)
    used = {line.split()[1] for line in to.read_text().split("\n") if line.startswith("usemtl")}
    assert used == {line.split()[1] for line in lines if line.startswith("newmtl")}


@pytest.mark.parametrize("shape", range(len(LEAF_SHAPES)))
def test_a_leaf_picture_is_as_opaque_as_its_outline_is_large(shape: int) -> None:
    opaque = (leaf_image(shape)[..., 3] >= 128).mean()
    assert abs(opaque - outline_area(OUTLINES[shape])) < 0.02


def test_leaf_cards_lie_as_the_leaves_do() -> None:
    leaves = _leaves()
    cards = Mesh.together([part.mesh for part in leaf_parts(leaves)])
    assert np.isclose(cards.area, np.sum(leaves.length * leaves.width))
    assert np.allclose(cards.face_normals()[:, :2], 0.0)
    assert np.all(cards.face_normals()[:, 2] > 0.0)  # the upper face is the front


def test_nothing_half_written_and_nothing_replaced(tmp_path: Path) -> None:
    to = write_mesh(_wood(), tmp_path / "tree.ply")
    before = to.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        write_mesh(_wood(), to)
    lost = Part(_wood(), Material("bark", colour_image=tmp_path / "lost.png"))
    for name in ("tree.glb", "tree.obj"):
        with pytest.raises(InputError, match=r"lost\.png: cannot be read"):
            write_mesh([lost], tmp_path / name)
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(InputError, match=r"text\.png: is no PNG or JPEG"):
        text = Material("bark", colour_image=tmp_path / "text.png")
        write_mesh([Part(_wood(), text)], tmp_path / "tree.glb")
    with pytest.raises(InputError, match=r"did you mean '\.glb'"):
        write_mesh(_wood(), tmp_path / "tree.gltf")
    with pytest.raises(InputError, match="nothing to write"):
        write_mesh(Mesh.together([]), tmp_path / "none.glb")
    assert to.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"tree.ply", "text.png"}
