"""A binary glTF 2.0 file with one mesh, its morph targets and their animation."""

import json
from typing import Any, Literal

import numpy as np

from model.types import Array

FLOAT, UNSIGNED = 5126, 5125
TARGETS = {"vertices": 34962, "indices": 34963}
KINDS = {1: "SCALAR", 3: "VEC3"}
UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Quaternion x y z w that takes z up to glTF's y up."""


class GltfWriter:
    """Collects accessors, a mesh and its animation; `encode` gives the file.

    Args:
        text: For the reader of the file; stored in `asset.extras.readme`.
        generator: Who wrote it.

    Reference:
        Khronos Group (2021), glTF 2.0 specification.
    """

    def __init__(self, text: str, generator: str) -> None:
        """See the class."""
        root = {"name": "twin", "rotation": UPRIGHT, "children": list[int]()}
        self._content: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": generator, "extras": {"readme": text}},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [root],
            "accessors": [],
            "bufferViews": [],
        }
        self._data = bytearray()

    def add(
        self, values: Array, *, bounds: bool = False, target: Literal["vertices", "indices"] | None = None
    ) -> int:
        """Store float32 or uint32 numbers, [n] or [n, 3]; return the number of their accessor.

        Args:
            values: The numbers.
            bounds: Also store the smallest and the largest.
            target: What the numbers are for, where they are for drawing.
        """
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._data), "byteLength": values.nbytes}
        if target is not None:
            view["target"] = TARGETS[target]
        kind = "<u4" if values.dtype.kind == "u" else "<f4"
        self._data += np.ascontiguousarray(values, kind).tobytes()
        accessor: dict[str, Any] = {
            "bufferView": len(self._content["bufferViews"]),
            "componentType": UNSIGNED if kind == "<u4" else FLOAT,
            "count": len(values),
            "type": KINDS[1 if values.ndim == 1 else values.shape[1]],
        }
        if bounds:
            columns = values.reshape(len(values), -1)
            accessor |= {"min": columns.min(axis=0).tolist(), "max": columns.max(axis=0).tolist()}
        self._content["bufferViews"].append(view)
        self._content["accessors"].append(accessor)
        return len(self._content["accessors"]) - 1

    def add_mesh(
        self, name: str, attributes: dict[str, int], indices: int, targets: list[dict[str, int]]
    ) -> int:
        """A mesh of triangles and a node that shows it; return the number of the node."""
        primitive: dict[str, Any] = {"attributes": attributes, "indices": indices, "material": 0}
        mesh: dict[str, Any] = {"name": name, "primitives": [primitive]}
        if targets:
            primitive["targets"] = targets
            mesh["weights"] = [0.0] * len(targets)
        rough = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
        self._content["materials"] = [{"name": "matt", "pbrMetallicRoughness": rough}]
        self._content["meshes"] = [mesh]
        self._content["nodes"].append({"name": name, "mesh": 0})
        self._content["nodes"][0]["children"].append(1)
        return 1

    def animate(self, node: int, name: str, times: Array, weights: Array) -> None:
        """Move the weights of a node's morph targets: those of every time [s], in a row."""
        sampler = {
            "input": self.add(times, bounds=True),
            "output": self.add(weights),
            "interpolation": "LINEAR",
        }
        channel = {"sampler": 0, "target": {"node": node, "path": "weights"}}
        self._content["animations"] = [{"name": name, "samplers": [sampler], "channels": [channel]}]

    def encode(self) -> bytes:
        """The bytes of the GLB."""
        self._content["buffers"] = [{"byteLength": len(self._data)}]
        text = json.dumps(self._content, ensure_ascii=False, allow_nan=False).encode()
        chunks = b""
        for kind, body, filler in ((b"JSON", text, b" "), (b"BIN\0", bytes(self._data), b"\0")):
            body += filler * (-len(body) % 4)
            chunks += len(body).to_bytes(4, "little") + kind + body
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks
