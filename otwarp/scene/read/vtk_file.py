"""Reads velocities on the nodes of a grid from VTK files: image data (XML) and the legacy format of text or bytes.

VTK's own reader is a package of several hundred megabytes, and meshio turns grids into hexahedra; both formats are
short (VTK File Formats, docs.vtk.org/en/latest/vtk_file_formats; Schroeder, Martin, Lorensen, The Visualization
Toolkit, 4th ed. 2006).
"""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from otwarp.errors import InputError

Field = tuple[dict[str, np.ndarray], np.ndarray]
"""Places of the nodes along x, y and z, and (nx, ny, nz, 3) velocities, as the file has them."""

_ALONG = "1 0 0 0 1 0 0 0 1"
_MISSING = "no point array of three components: must hold one, the velocity"


def read_image_data(path: Path) -> Field:
    """The first point array of three components of an XML file (`.vti`); ascii, or base64 in place, zlib or not.

    Raises:
        InputError: No such array, turned axes, or data appended behind the XML.
    """
    root = ElementTree.parse(path).getroot()
    image = root.find("ImageData")
    if image is None or image.get("Direction", _ALONG).split() != _ALONG.split():
        raise InputError("no ImageData along the axes: must be VTK image data without a Direction of its own")
    pieces = image.findall("Piece")
    if len(pieces) > 1:
        raise InputError(f"{len(pieces)} pieces: must be one that holds all nodes")
    piece = pieces[0] if pieces else None
    arrays = [] if piece is None else [a for a in piece.iterfind("PointData/DataArray")]
    array = next((a for a in arrays if a.get("NumberOfComponents") == "3"), None)
    if piece is None or array is None:
        raise InputError(_MISSING)
    extent = [int(n) for n in piece.get("Extent", image.get("WholeExtent", "")).split()]
    count = [b - a + 1 for a, b in zip(extent[::2], extent[1::2], strict=True)]
    spacing = [float(v) for v in image.get("Spacing", "1 1 1").split()]
    origin = [float(v) for v in image.get("Origin", "0 0 0").split()]
    start = [v + a * h for v, a, h in zip(origin, extent[::2], spacing, strict=True)]
    axes = {name: s + h * np.arange(n) for name, s, h, n in zip("xyz", start, spacing, count, strict=True)}
    return axes, _on_nodes(_xml_numbers(root, array), count)


def _on_nodes(numbers: np.ndarray, count: list[int]) -> np.ndarray:
    """(nx, ny, nz, 3) from numbers whose x changes fastest."""
    return numbers.reshape(*count[::-1], 3).transpose(2, 1, 0, 3)


def _xml_numbers(root: Any, array: Any) -> np.ndarray:
    """The numbers of a DataArray, as float64."""
    text = (array.text or "").split()
    how = array.get("format", "ascii")
    if how == "ascii":
        return np.array(text, dtype=float)
    if how != "binary":
        raise InputError(f"DataArray format = {how}: must be ascii or binary")
    order = "<" if root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
    head = np.dtype({"UInt64": "u8", "UInt32": "u4"}[root.get("header_type", "UInt32")]).newbyteorder(order)
    kind = np.dtype({"Float32": "f4", "Float64": "f8"}[array.get("type", "Float32")]).newbyteorder(order)
    packed = "".join(text)
    if root.get("compressor") is None:
        return np.frombuffer(base64.b64decode(packed), np.uint8)[head.itemsize :].view(kind).astype(float)
    # the header, (blocks, size, size of the last, sizes compressed …), is encoded by itself
    width = -(-head.itemsize // 3) * 4
    blocks = int(np.frombuffer(base64.b64decode(packed[:width])[: head.itemsize], head)[0])
    width = -(-(3 + blocks) * head.itemsize // 3) * 4
    sizes = np.frombuffer(base64.b64decode(packed[:width]), head)[3:].astype(int)
    body, at, raw = base64.b64decode(packed[width:]), 0, b""
    for size in sizes:
        raw += zlib.decompress(body[at : at + size])
        at += size
    return np.frombuffer(raw, kind).astype(float)


GRIDS = ("STRUCTURED_POINTS", "RECTILINEAR_GRID")
"""Datasets of legacy files whose nodes lie along the axes."""

_TYPES = {
    "char": "i1", "unsigned_char": "u1", "short": ">i2", "unsigned_short": ">u2", "int": ">i4", "unsigned_int": ">u4",
    "vtkidtype": ">i4", "long": ">i8", "unsigned_long": ">u8", "vtktypeint64": ">i8", "vtktypeuint64": ">u8",
    "float": ">f4", "double": ">f8",
}  # fmt: skip

_TUPLES = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}
"""Attributes `KEYWORD name type` → components."""


class _LegacyText:
    """A legacy file from its first line on: lines of words, and numbers in between as text or as big-endian bytes."""

    def __init__(self, data: bytes):
        self.rest, self.last = data, ""
        title = self.line()
        if not title.startswith("# vtk DataFile Version"):
            raise InputError(f"first line = {title[:40]!r}: must be '# vtk DataFile Version …'")
        self.line()
        how = self.line().strip().upper()
        if how not in ("ASCII", "BINARY"):
            raise InputError(f"third line = {how[:40]!r}: must be ASCII or BINARY")
        self.ascii = how == "ASCII"

    def line(self) -> str:
        """The next line, '' at the end."""
        line, _, self.rest = self.rest.partition(b"\n")
        return line.decode("latin-1")

    def words(self) -> list[str]:
        """Of the next line that has some, behind metadata, which go on to an empty line; [] at the end."""
        while self.rest:
            words = self.line().split()
            if words[:1] == ["METADATA"]:
                while self.line().strip():
                    pass
            elif words:
                self.last = " ".join(words)[:40]
                return words
        return []

    def numbers(self, count: int, kind: str) -> np.ndarray:
        """The next `count` numbers.

        Raises:
            InputError: An unknown type, or fewer numbers than said.
        """
        if kind.lower() not in _TYPES:
            raise InputError(f"data type = {kind}: must be one of {', '.join(_TYPES)}")
        dtype = np.dtype(_TYPES[kind.lower()])
        if self.ascii:
            found = self.rest.split(None, count)
            self.rest = found[count] if len(found) > count else b""
            values = np.array(found[:count], dtype=float)
        else:
            values = np.frombuffer(self.rest[: count * dtype.itemsize], dtype).astype(float)
            self.rest = self.rest[count * dtype.itemsize :]
        if len(values) < count:
            raise InputError(f"ends after {len(values)} of {count} numbers: must hold all of them")
        return values


def read_legacy(path: Path) -> Field:
    """The first point array of three components of a legacy file (`.vtk`): vectors, scalars of three, or of a field.

    Raises:
        InputError: Another dataset, no such array, or a file that breaks off or is damaged.
    """
    text = _LegacyText(path.read_bytes())
    try:
        return _legacy_field(text)
    except (IndexError, KeyError, ValueError) as error:
        raise InputError(f"line {text.last!r}: must be as VTK's legacy format has it ({error})") from None


def _legacy_field(text: _LegacyText) -> Field:
    """What follows the first three lines."""
    grid: dict[str, list[float]] = {}
    axes: dict[str, np.ndarray] = {}
    while words := text.words():
        key = words[0].upper()
        if key == "DATASET" and words[1].upper() not in GRIDS:
            raise InputError(f"DATASET = {words[1]}: must be {' or '.join(GRIDS)}")
        if key in ("DIMENSIONS", "ORIGIN", "SPACING", "ASPECT_RATIO"):
            grid[key] = [float(w) for w in words[1:4]]
        elif key in ("X_COORDINATES", "Y_COORDINATES", "Z_COORDINATES"):
            axes[key[0].lower()] = text.numbers(int(words[1]), words[2])
        elif key == "FIELD":  # of the dataset as a whole, such as its time
            _field_vectors(text, int(words[2]), -1)
        elif key in ("POINT_DATA", "CELL_DATA"):
            numbers = _of_points(text, words)
            break
        elif key != "DATASET":
            raise InputError(f"line {text.last!r}: must be what a {' or '.join(GRIDS)} begins with")
    else:
        numbers = None
    if numbers is None:
        raise InputError(_MISSING)
    if not axes:
        spacing = grid.get("SPACING", grid.get("ASPECT_RATIO", [1.0] * 3))
        parts = zip("xyz", grid.get("ORIGIN", [0.0] * 3), spacing, grid["DIMENSIONS"], strict=True)
        axes = {name: start + h * np.arange(int(n)) for name, start, h, n in parts}
    count = [len(axes[name]) for name in "xyz"]
    if 3 * np.prod(count) != len(numbers):
        raise InputError(f"POINT_DATA = {len(numbers) // 3}: must be {' × '.join(map(str, count))}, one per node")
    return axes, _on_nodes(numbers, count)


def _of_points(text: _LegacyText, words: list[str]) -> np.ndarray | None:
    """Numbers of the first array of three components that points have; VTK writes those of cells first."""
    while words:
        wanted = words[0].upper() == "POINT_DATA"
        found, words = _vectors(text, int(words[1]), wanted=wanted)
        if found is not None:
            return found
    return None


def _vectors(text: _LegacyText, count: int, *, wanted: bool) -> tuple[np.ndarray | None, list[str]]:
    """Numbers of the first array of three components that is no normal, None without one or where none is wanted, and
    the line at which the next data begin.
    """
    while words := text.words():
        key = words[0].upper()
        if key in ("CELL_DATA", "POINT_DATA"):
            break
        if key == "FIELD":
            found = _field_vectors(text, int(words[2]), count if wanted else -1)
            if found is not None:
                return found, []
            continue
        if key in _TUPLES:
            width, kind = _TUPLES[key], words[2]
        elif key == "SCALARS":
            width, kind = int(words[3]) if len(words) > 3 else 1, words[2]
            text.words()  # LOOKUP_TABLE name
        elif key == "TEXTURE_COORDINATES":
            width, kind = int(words[2]), words[3]
        elif key == "COLOR_SCALARS":
            width, kind = int(words[2]), "unsigned_char"
        elif key == "LOOKUP_TABLE":
            text.numbers(4 * int(words[2]), "unsigned_char")
            continue
        else:
            raise InputError(f"line {text.last!r}: must be an attribute of {'points' if wanted else 'cells'}")
        values = text.numbers(width * count, kind)
        if wanted and key in ("VECTORS", "SCALARS") and width == 3:
            return values, []
    return None, words


def _field_vectors(text: _LegacyText, arrays: int, points: int) -> np.ndarray | None:
    """Numbers of the first of a field's arrays of three components for each point, None without one."""
    for _ in range(arrays):
        _name, width, tuples, kind = text.words()
        values = text.numbers(int(width) * int(tuples), kind)
        if int(width) == 3 and int(tuples) == points:
            return values
    return None
