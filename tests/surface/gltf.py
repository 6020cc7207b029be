"""A reader of .glb files that knows no more than a test needs."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

_TYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Gltf:
    """What a .glb file holds; its numbers are checked against what it says of them."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        magic, version, length, size, kind = struct.unpack("<4sIII4s", content[:20])
        assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
        assert size % 4 == 0
        self.json: dict[str, Any] = json.loads(content[20 : 20 + size])
        self.blob = content[28 + size :]
        assert content[24 + size : 28 + size] == b"BIN\0"

    def array(self, accessor: int) -> np.ndarray:
        """Read an accessor's rows."""
        told = self.json["accessors"][accessor]
        view = self.json["bufferViews"][told["bufferView"]]
        kind, width = np.dtype(_TYPES[told["componentType"]]), _WIDTHS[told["type"]]
        stride = view.get("byteStride", kind.itemsize * width)
        begin = view.get("byteOffset", 0) + told.get("byteOffset", 0)
        assert begin % kind.itemsize == 0 and stride % kind.itemsize == 0
        need = (told["count"] - 1) * stride + kind.itemsize * width
        assert told["count"] > 0 and need <= view["byteLength"]
        assert view.get("byteOffset", 0) + view["byteLength"] <= len(self.blob)
        rows = np.ndarray((told["count"], width), kind, self.blob, begin, (stride, kind.itemsize))
        if "min" in told:
            np.testing.assert_array_equal(rows.min(axis=0), np.array(told["min"], kind))
            np.testing.assert_array_equal(rows.max(axis=0), np.array(told["max"], kind))
        return rows

    def check(self) -> None:
        """Check what the specification demands of meshes, nodes and materials."""
        for mesh in self.json["meshes"]:
            for primitive in mesh["primitives"]:
                arrays = {k: self.array(v) for k, v in primitive["attributes"].items()}
                counts = {len(rows) for rows in arrays.values()}
                assert len(counts) == 1
                assert "min" in self.json["accessors"][primitive["attributes"]["POSITION"]]
                assert self.array(primitive["indices"]).max() < counts.pop()
                assert primitive["material"] < len(self.json["materials"])
                for name in {"NORMAL"} & arrays.keys():
                    np.testing.assert_allclose(np.linalg.norm(arrays[name], axis=1), 1.0, atol=1e-4)
        borne = [k for node in self.json["nodes"] for k in node.get("children", [])]
        roots = self.json["scenes"][0]["nodes"]
        assert sorted(borne + roots) == list(range(len(self.json["nodes"])))
        shared: dict[int, set[str]] = {}
        for mesh in self.json["meshes"]:
            for primitive in mesh["primitives"]:
                for name, k in primitive["attributes"].items():
                    shared.setdefault(self.json["accessors"][k]["bufferView"], set()).add(name)
        assert all(len(names) == 1 for names in shared.values())
