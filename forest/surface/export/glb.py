"""glTF 2.0 in one binary file (.glb): metres, y up, materials of metallic-roughness."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.export.parts import Image, Material, Part, encoded, mime_type
from forest.surface.mesh import Mesh, Split

_FLOAT, _UNSIGNED_INT = 5126, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_LINEAR, _LINEAR_MIPMAP_LINEAR, _REPEAT = 9729, 9987, 10497
_TRIANGLES = 4
_MOST_BYTES = 2**32 - 2**20  # a .glb counts them in 32 bits; the rest is for its head
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}

#: From z up to y up, a turn about the x axis.
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

_Floats = NDArray[np.float64]


def write_glb(parts: Sequence[Part], draft: Path) -> None:
    """Write parts as nodes of one scene.

    Parameters
    ----------
    parts : sequence of Part
        Meshes with triangles; equal meshes and materials are kept once.
    draft : path
        The file.

    Raises
    ------
    InputError
        If it would be larger than the 4 GB that a .glb file can hold.

    Notes
    -----
    Points lie around a node's translation, so that single precision is enough anywhere on a plot.
    `Mesh.data` become attributes of the points, ``_RADIUS_M`` and so on, as floats: glTF knows no
    integers of 32 bits there; those that are 0 everywhere are left out. Points are doubled at
    seams of the texture coordinates.
    """
    file = GltfFile()
    for part in parts:
        file.add(part)
    file.save(draft)


class GltfFile:
    """A glTF file in the making."""

    def __init__(self) -> None:
        import pygltflib

        self._lib = pygltflib
        self._gltf = pygltflib.GLTF2(
            asset=pygltflib.Asset(version="2.0", generator="forest"),
            scene=0,
            scenes=[pygltflib.Scene(nodes=[])],
        )
        self._bytes = bytearray()
        self._meshes: dict[tuple[int, int], tuple[int, _Floats]] = {}
        self._materials: dict[int, int] = {}
        self._textures: dict[int, int] = {}
        self._alive: list[object] = []  # what the keys above name by id

    def add(self, part: Part) -> None:
        """Add a part: a node for each of its places."""
        mesh, middle = self._mesh(part)
        places = [np.eye(4)] if part.places is None else part.places
        for place in places:
            turn = Y_UP @ place[:3, :3] @ Y_UP.T
            shift = Y_UP @ (place[:3, :3] @ middle + place[:3, 3])
            node = self._lib.Node(name=part.name, mesh=mesh)
            if np.array_equal(turn, np.eye(3)):
                node.translation = shift.tolist()
            else:
                whole = np.eye(4)
                whole[:3, :3], whole[:3, 3] = turn, shift
                node.matrix = whole.T.ravel().tolist()  # by columns
            self._gltf.scenes[0].nodes.append(len(self._gltf.nodes))
            self._gltf.nodes.append(node)

    def save(self, draft: Path) -> None:
        """Write the file."""
        if len(self._bytes) > _MOST_BYTES:
            what = f"would hold {len(self._bytes) / 1e9:.1f} GB"
            raise InputError(what, where=draft.name, expected="at most 4; try it without leaves")
        self._gltf.buffers = [self._lib.Buffer(byteLength=len(self._bytes))]
        self._gltf.set_binary_blob(bytes(self._bytes))
        self._gltf.save_binary(str(draft))

    def _mesh(self, part: Part) -> tuple[int, _Floats]:
        key = (id(part.mesh), id(part.material))
        if key not in self._meshes:
            self._alive.append(part)
            mesh, split = part.mesh, part.mesh.split_at_seams()
            middle = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))
            middle[2] = mesh.points[:, 2].min()
            normals = mesh.normals()[split.source]
            attributes = {
                "POSITION": (mesh.points - middle)[split.source] @ Y_UP.T,
                "NORMAL": normals @ Y_UP.T,
                "TEXCOORD_0": split.uv / part.material.tile_m * (1.0, -1.0) + (0.0, 1.0),
            }
            if part.material.normal_image is not None:
                along = tangents(mesh, split, normals) @ Y_UP.T
                attributes["TANGENT"] = np.column_stack((along, np.ones(len(along))))
            for name, values in mesh.data.items():
                if np.any(values):
                    attributes[f"_{name.upper()}"] = values[split.source].astype(np.float64)
            primitive = self._lib.Primitive(
                attributes=self._lib.Attributes(
                    **{name: self._points(name, values) for name, values in attributes.items()}
                ),
                indices=self._indices(split.triangles),
                material=self._material(part.material),
                mode=_TRIANGLES,
            )
            self._gltf.meshes.append(self._lib.Mesh(name=part.name, primitives=[primitive]))
            self._meshes[key] = len(self._gltf.meshes) - 1, middle
        return self._meshes[key]

    def _points(self, name: str, values: _Floats) -> int:
        single = values.astype("<f4")
        bounds = {}
        if name == "POSITION":
            bounds = {"min": single.min(axis=0).tolist(), "max": single.max(axis=0).tolist()}
        width = single.shape[1] if single.ndim > 1 else 1
        view = self._view(single.tobytes(), _ARRAY_BUFFER)
        return self._accessor(view, _FLOAT, len(single), _KINDS[width], bounds)

    def _indices(self, triangles: NDArray[np.int32]) -> int:
        flat = triangles.ravel().astype("<u4")
        bounds = {"min": [int(flat.min())], "max": [int(flat.max())]}
        view = self._view(flat.tobytes(), _ELEMENT_ARRAY_BUFFER)
        return self._accessor(view, _UNSIGNED_INT, len(flat), "SCALAR", bounds)

    def _accessor(
        self, view: int, component: int, count: int, kind: str, bounds: dict[str, Any]
    ) -> int:
        self._gltf.accessors.append(
            self._lib.Accessor(
                bufferView=view,
                byteOffset=0,
                componentType=component,
                count=count,
                type=kind,
                **bounds,
            )
        )
        return len(self._gltf.accessors) - 1

    def _view(self, content: bytes, target: int | None = None) -> int:
        """Append bytes to the buffer, each run on a multiple of four."""
        self._bytes += b"\0" * (-len(self._bytes) % 4)
        self._gltf.bufferViews.append(
            self._lib.BufferView(
                buffer=0, byteOffset=len(self._bytes), byteLength=len(content), target=target
            )
        )
        self._bytes += content
        return len(self._gltf.bufferViews) - 1

    def _material(self, material: Material) -> int:
        if id(material) in self._materials:
            return self._materials[id(material)]
        lib = self._lib
        shine = lib.PbrMetallicRoughness(
            baseColorFactor=[*material.colour, 1.0],
            metallicFactor=material.metallic,
            roughnessFactor=material.roughness,
        )
        made = lib.Material(
            name=material.name,
            pbrMetallicRoughness=shine,
            doubleSided=material.double_sided,
            alphaMode="MASK" if material.cut_out else "OPAQUE",
            alphaCutoff=0.5 if material.cut_out else None,
        )
        if material.colour_image is not None:
            shine.baseColorTexture = lib.TextureInfo(index=self._texture(material.colour_image))
        if material.normal_image is not None:
            made.normalTexture = lib.NormalMaterialTexture(
                index=self._texture(material.normal_image)
            )
        if material.rough_image is not None:
            index = self._texture(material.rough_image)
            shine.metallicRoughnessTexture = lib.TextureInfo(index=index)
            made.occlusionTexture = lib.OcclusionTextureInfo(index=index)
        self._gltf.materials.append(made)
        self._alive.append(material)
        self._materials[id(material)] = len(self._gltf.materials) - 1
        return self._materials[id(material)]

    def _texture(self, image: Image) -> int:
        if id(image) in self._textures:
            return self._textures[id(image)]
        lib, content = self._lib, encoded(image)
        if not self._gltf.samplers:
            self._gltf.samplers.append(
                lib.Sampler(
                    magFilter=_LINEAR,
                    minFilter=_LINEAR_MIPMAP_LINEAR,
                    wrapS=_REPEAT,
                    wrapT=_REPEAT,
                )
            )
        self._gltf.images.append(
            lib.Image(bufferView=self._view(content), mimeType=mime_type(content))
        )
        source = len(self._gltf.images) - 1
        self._gltf.textures.append(lib.Texture(sampler=0, source=source))
        self._alive.append(image)
        self._textures[id(image)] = len(self._gltf.textures) - 1
        return self._textures[id(image)]


def tangents(mesh: Mesh, split: Split, normals: _Floats) -> _Floats:
    """Give the direction of growing u at each point of a split mesh, square to its normal.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    split : Split
        Its points, doubled at seams.
    normals : float64 (k, 3)
        Unit normals of these points.

    Returns
    -------
    float64 (k, 3)
        Unit vectors; any across the normal where the texture has no direction.
    """
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    one, two = mesh.uv[:, 1] - mesh.uv[:, 0], mesh.uv[:, 2] - mesh.uv[:, 0]
    turned = np.sign(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    way = turned[:, None] * ((b - a) * two[:, 1:] - (c - a) * one[:, 1:])
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    total = np.zeros((len(split.source), 3))
    for j in range(3):
        total[:, j] = np.bincount(
            split.triangles.ravel(), np.repeat(way[:, j], 3), minlength=len(total)
        )
    total -= np.sum(total * normals, axis=1, keepdims=True) * normals
    least = np.argmin(np.abs(normals), axis=1)
    other = -np.take_along_axis(normals, least[:, None], axis=1) * normals
    other[np.arange(len(other)), least] += 1.0
    none = np.linalg.norm(total, axis=1, keepdims=True) < 1e-9
    total = np.where(none, other, total)
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True), np.float64)
