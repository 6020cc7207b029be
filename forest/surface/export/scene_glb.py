"""A scene as glTF 2.0 in one binary file: a mesh for each shape, a node for each tree."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.surface.export.glb import _ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER, Y_UP, GltfFile
from forest.surface.export.parts import Material, leaf_image, linear
from forest.surface.mesh import Mesh
from forest.surface.scene import Scene, Shape
from forest.trees.leaves import LEAF_SHAPES, Leaves

INSTANCING = "EXT_mesh_gpu_instancing"

_UNSIGNED_BYTE, _UNSIGNED_SHORT, _UNSIGNED_INT, _FLOAT = 5121, 5123, 5125, 5126
_TRIANGLES = 4
#: Corners of a card: shares of the length from the petiole, and of the width to the right.
CARD = np.array([(0.0, -0.5), (0.0, 0.5), (1.0, 0.5), (1.0, -0.5)])
_CARD_TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)])
_LEAF_ROUGHNESS, _BARK_ROUGHNESS = 0.6, 0.9

_Say = Callable[[str], object]
_Floats = NDArray[np.float64]


def write_scene_glb(
    scene: Scene, draft: Path, *, instanced: bool = False, say: _Say = lambda line: None
) -> None:
    """Write a scene.

    Parameters
    ----------
    scene : Scene
    draft : path
        The file.
    instanced : bool
        Whether leaves are a card and many transforms (`EXT_mesh_gpu_instancing`), which some
        viewers do not know and then refuse the file; else each shape has its leaves as one mesh
        of cards, which all viewers know.
    say : callable
        Is told, in a line, how far it is.

    Notes
    -----
    Trees of one shape share its mesh. A node has the tree's place, scale and, as extras, its
    `tree_id`, `species` and `dbh_cm`; the scene has its `origin_m`. Cards have no normals: glTF
    then takes that of the face, and the front is the upper face. Their texture coordinates and
    corners are the same in every mesh and stand in the file once.
    """
    file = _SceneFile(scene, instanced)
    if scene.ground is not None:
        file.add_ground()
    for number, shape in enumerate(scene.shapes):
        file.add_shape(shape)
        if (number + 1) % 50 == 0 or number + 1 == len(scene.shapes):
            say(f"{number + 1} of {len(scene.shapes)} shapes in the file")
    file.add_trees()
    file.save(draft)


class _SceneFile(GltfFile):
    """A scene's file in the making."""

    def __init__(self, scene: Scene, instanced: bool) -> None:
        super().__init__()
        self._scene, self._instanced = scene, instanced
        self._known: dict[tuple[object, ...], Material] = {}
        self._images = [leaf_image(code) for code in range(len(LEAF_SHAPES))]
        self._shapes: list[int] = []
        self._carriers: list[list[tuple[int, dict[str, int]]]] = []  # of each shape's leaves
        self._cards: dict[int, int] = {}  # the one card of each material
        self._most = 1 if instanced else _most_cards(scene)
        self._index_view = self._texture_view = -1
        if instanced:
            self._gltf.extensionsUsed = [INSTANCING]
            self._gltf.extensionsRequired = [INSTANCING]
        self._gltf.scenes[0].extras = {"origin_m": list(map(float, scene.origin_m))}

    def add_ground(self) -> None:
        """Add the ground's mesh and its node."""
        ground = self._scene.ground
        assert ground is not None
        material = self._plain("ground", ground.colour, _BARK_ROUGHNESS)
        self._mesh_of("ground", [self._wood(ground.mesh, material)])
        self._root(self._lib.Node(name="ground", mesh=len(self._gltf.meshes) - 1))

    def add_shape(self, shape: Shape) -> None:
        """Add the mesh of a shape: a primitive of wood, and one of each outline of leaves."""
        bark = self._plain(f"bark of {shape.species}", shape.bark, _BARK_ROUGHNESS)
        primitives = [self._wood(shape.wood, bark)]
        carriers = []
        for code in np.unique(shape.leaves.shape).tolist():
            here = shape.leaves.shape == code
            leaves = Leaves._make(column[here] for column in shape.leaves)
            material = self._leafy(shape, code)
            if self._instanced:
                carriers.append((self._card(material), self._transforms(leaves)))
            else:
                primitives.append(self._merged(leaves, material))
        self._shapes.append(self._mesh_of(f"{shape.species} {len(self._shapes)}", primitives))
        self._carriers.append(carriers)

    def add_trees(self) -> None:
        """Add a node for each tree."""
        scene, lib = self._scene, self._lib
        for k, shape in enumerate(scene.instances.model.tolist()):
            tree_id, species = int(scene.census.tree_id[k]), str(scene.census.species[k])
            extras: dict[str, Any] = {"tree_id": tree_id, "species": species}
            if math.isfinite(dbh := float(scene.census.dbh_cm[k])):
                extras["dbh_cm"] = round(dbh, 3)
            node = lib.Node(
                name=f"tree {tree_id}" if tree_id else f"tree at {k}",
                mesh=self._shapes[shape],
                translation=(Y_UP @ scene.instances.place[k]).tolist(),
                scale=[float(scene.instances.scale[k])] * 3,
                extras=extras,
                children=[],
            )
            self._root(node)
            for mesh, attributes in self._carriers[shape]:
                node.children.append(len(self._gltf.nodes))
                self._gltf.nodes.append(
                    lib.Node(
                        name="leaves",
                        mesh=mesh,
                        extensions={INSTANCING: {"attributes": attributes}},
                    )
                )

    def _root(self, node: Any) -> None:
        self._gltf.scenes[0].nodes.append(len(self._gltf.nodes))
        self._gltf.nodes.append(node)

    def _mesh_of(self, name: str, primitives: list[Any]) -> int:
        self._gltf.meshes.append(self._lib.Mesh(name=name, primitives=primitives))
        return len(self._gltf.meshes) - 1

    def _primitive(self, attributes: dict[str, int], indices: int, material: Material) -> Any:
        return self._lib.Primitive(
            attributes=self._lib.Attributes(**attributes),
            indices=indices,
            material=self._material(material),
            mode=_TRIANGLES,
        )

    def _wood(self, mesh: Mesh, material: Material) -> Any:
        attributes = {
            "POSITION": self._points("POSITION", mesh.points @ Y_UP.T),
            "NORMAL": self._points("NORMAL", mesh.normals() @ Y_UP.T),
        }
        if len(mesh.points) > 65535:  # the highest index itself is kept for other ends
            return self._primitive(attributes, self._indices(mesh.triangles), material)
        flat = mesh.triangles.ravel().astype("<u2")
        view = self._view(flat.tobytes(), _ELEMENT_ARRAY_BUFFER)
        bounds = {"min": [int(flat.min())], "max": [int(flat.max())]}
        indices = self._accessor(view, _UNSIGNED_SHORT, len(flat), "SCALAR", bounds)
        return self._primitive(attributes, indices, material)

    def _merged(self, leaves: Leaves, material: Material) -> Any:
        return self._of_cards(card_corners(leaves, CARD).reshape(-1, 3), material)

    def _of_cards(self, corners: _Floats, material: Material) -> Any:
        """Make a primitive of cards; those who have made the two shared views share them."""
        if self._index_view < 0:
            self._share_views()
        cards = len(corners) // 4
        bounds = {"min": [0], "max": [4 * cards - 1]}
        attributes = {
            "POSITION": self._points("POSITION", corners @ Y_UP.T),
            "TEXCOORD_0": self._accessor(
                self._texture_view, _UNSIGNED_BYTE, 4 * cards, "VEC2", {"normalized": True}
            ),
        }
        indices = self._accessor(self._index_view, _UNSIGNED_INT, 6 * cards, "SCALAR", bounds)
        return self._primitive(attributes, indices, material)

    def _share_views(self) -> None:
        number = 4 * np.arange(self._most, dtype=np.uint32)
        triangles = (number[:, None, None] + _CARD_TRIANGLES.astype(np.uint32)).astype("<u4")
        self._index_view = self._view(triangles.tobytes(), _ELEMENT_ARRAY_BUFFER)
        # glTF counts v from the upper edge of an image, where the tip is; rows of four bytes.
        corner = np.zeros((4, 4), np.uint8)
        corner[:, 0], corner[:, 1] = 255.0 * (CARD[:, 1] + 0.5), 255.0 * (1.0 - CARD[:, 0])
        self._texture_view = self._view(np.tile(corner, (self._most, 1)).tobytes(), _ARRAY_BUFFER)
        self._gltf.bufferViews[self._texture_view].byteStride = 4

    def _card(self, material: Material) -> int:
        """Give the mesh of one card, a metre long and wide."""
        if id(material) not in self._cards:
            corners = np.column_stack((CARD, np.zeros(4)))
            primitive = self._of_cards(corners, material)
            self._cards[id(material)] = self._mesh_of(material.name, [primitive])
        return self._cards[id(material)]

    def _transforms(self, leaves: Leaves) -> dict[str, int]:
        """Give the accessors of the leaves' places, turns and sizes."""
        n = len(leaves.shape)
        size = np.column_stack((leaves.length, np.ones(n), leaves.width))  # y up
        values = {
            "TRANSLATION": leaves.position.astype(np.float64) @ Y_UP.T,
            "ROTATION": _quaternions(leaves),
            "SCALE": size,
        }
        kinds = {3: "VEC3", 4: "VEC4"}
        found = {}
        for name, rows in values.items():
            view = self._view(rows.astype("<f4").tobytes())
            found[name] = self._accessor(view, _FLOAT, n, kinds[rows.shape[1]], {})
        return found

    def _plain(self, name: str, colour: tuple[float, float, float], roughness: float) -> Material:
        key = (name, colour)
        if key not in self._known:
            self._known[key] = Material(name, colour=linear(colour), roughness=roughness)
        return self._known[key]

    def _leafy(self, shape: Shape, code: int) -> Material:
        key = (shape.species, shape.foliage, code)
        if key not in self._known:
            self._known[key] = Material(
                f"leaves of {shape.species}",
                colour=linear(shape.foliage),
                roughness=_LEAF_ROUGHNESS,
                colour_image=self._images[code],
                cut_out=True,
                double_sided=True,
            )
        return self._known[key]


def card_corners(leaves: Leaves, outline: _Floats) -> _Floats:
    """Give the corners (n, k, 3) of an outline's k points on each leaf, m.

    Parameters
    ----------
    leaves : Leaves
    outline : float64 (k, 2)
        Shares of the length from the petiole, and of the width to the right as one looks at the
        upper face with the tip up; anticlockwise, so that the front is the upper face.
    """
    direction = leaves.direction.astype(np.float64)
    right = np.cross(direction, leaves.normal) * leaves.width[:, None]
    along = direction * leaves.length[:, None]
    return np.asarray(
        leaves.position[:, None] + outline[:, :1] * along[:, None] + outline[:, 1:] * right[:, None]
    )


def _most_cards(scene: Scene) -> int:
    """Count the leaves of one outline in the shape that has most."""
    counts = [np.bincount(s.leaves.shape, minlength=1).max() for s in scene.shapes]
    return max(int(max(counts)), 1)


def _quaternions(leaves: Leaves) -> _Floats:
    """Give the turn (n, 4), x y z w, y up, of the card on each leaf.

    The card lies with its length along x and its right side along y, its upper face against z.
    """
    direction = leaves.direction.astype(np.float64)
    right = np.cross(direction, leaves.normal)
    turned = np.stack((direction, right, np.cross(direction, right)), axis=2)
    turned = Y_UP @ turned @ Y_UP.T
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(turned).as_quat(), np.float64)
