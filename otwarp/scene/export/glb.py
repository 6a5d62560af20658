"""The binary container of glTF 2.0: arrays, their accessors, and the file.

Khronos Group, glTF 2.0 specification, 2021 (ISO/IEC 12113:2022).
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.files import written

_FLOAT, _UNSIGNED = 5126, 5125
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
VERTICES, INDICES = 34962, 34963
"""What a buffer view is for; animations leave it out."""


class Arrays:
    """Arrays of a file, each stored once.

    Attributes:
        accessors, views: As JSON.
        data: The buffer so far.
    """

    def __init__(self) -> None:
        self.accessors: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []
        self.data = bytearray()
        self._known: dict[tuple[bytes, int | None], int] = {}

    def add(self, values: np.ndarray, target: int | None = None, *, bounds: bool = False) -> int:
        """Index of the accessor of rows (n,) or (n, k): indices as unsigned integers, all else as float32.

        Args:
            values: The rows.
            target: `VERTICES` or `INDICES`; None for samples of an animation.
            bounds: Say the least and the largest value, as positions and times must.
        """
        rows = np.ascontiguousarray(values, dtype=np.uint32 if target == INDICES else np.float32)
        content = rows.tobytes()
        key = (content + bytes(rows.shape[1:]), target)
        if key in self._known:
            return self._known[key]
        width = rows.shape[1] if rows.ndim > 1 else 1
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        if target is not None:
            view["target"] = target
        accessor: dict[str, Any] = {
            "bufferView": len(self.views),
            "componentType": _UNSIGNED if target == INDICES else _FLOAT,
            "count": len(rows),
            "type": _TYPES[width],
        }
        if bounds:
            table = rows.reshape(len(rows), width)
            accessor |= {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        self.views.append(view)
        self.accessors.append(accessor)
        self.data += content  # all are multiples of four bytes, as they have to be
        self._known[key] = len(self.accessors) - 1
        return self._known[key]


def write_glb(path: Path, document: dict[str, Any], arrays: Arrays) -> Path:
    """Write a glTF document with its arrays as one file: the whole file or none.

    Raises:
        InputError: The file cannot be written.
    """
    document = document | {
        "accessors": arrays.accessors,
        "bufferViews": arrays.views,
        "buffers": [{"byteLength": len(arrays.data)}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(arrays.data)
    if size >= 2**32:
        raise InputError(
            f"{path}: size = {size:.3g} bytes: a glTF file holds at most 4.29e9; take fewer frames (--fps)"
        )
    with written(path, str(path)) as part, part.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, size))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(arrays.data), b"BIN\0"))
        file.write(arrays.data)
    return path
