"""Triangle meshes as they are given: a file, a `trimesh.Trimesh`, or corners and triangles; read, and no further."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from otwarp.errors import InputError


def read_triangles(mesh: Any, name: str, allowed: str) -> tuple[str, Any]:
    """What errors call a mesh, and its triangles as they are, in a `trimesh.Trimesh` of its own.

    Args:
        mesh: File that trimesh reads (STL, OBJ, PLY, …), a `trimesh.Trimesh`, or (vertices, triangles).
        name: What errors call one that is no file.
        allowed: What they say is.

    Raises:
        InputError: No such file, none that can be read, no triangles, corners that are not finite, or the package
            trimesh is missing.
    """
    try:
        import trimesh
    except ImportError:
        raise InputError(f"{name}: needs the package trimesh: pip install 'otwarp[mesh]'") from None
    if isinstance(mesh, (str, Path)):
        name = str(mesh)
        if not Path(mesh).is_file():
            raise InputError(f"{name}: no such file; allowed: {allowed}")
        try:
            mesh = trimesh.load_mesh(mesh, process=False)  # which would drop triangles with a corner that is none
        except Exception as error:  # what its many readers raise has no common class
            raise InputError(f"{name}: cannot be read ({' '.join(str(error).split())}); allowed: {allowed}") from None
    elif isinstance(mesh, tuple):
        mesh = trimesh.Trimesh(np.asarray(mesh[0], dtype=float), np.asarray(mesh[1]), process=False)
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputError(f"{name}: {_cut_off(Path(name)) or 'has no triangles'}; allowed: {allowed}")
    wrong = np.flatnonzero(~np.isfinite(mesh.vertices[mesh.faces]).all(axis=(1, 2)))
    if len(wrong):
        corners = mesh.vertices[mesh.faces[wrong[0]]].tolist()
        raise InputError(f"{name}: triangle {wrong[0]} has the corners {corners}; allowed: finite numbers")
    return name, trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def _cut_off(file: Path) -> str:
    """What is missing of a binary STL that says how many triangles it has, which trimesh takes for an empty text."""
    if file.suffix.lower() != ".stl" or not file.is_file():
        return ""
    with file.open("rb") as opened:
        head = opened.read(84)
    there, said = (file.stat().st_size - 84) // 50, int.from_bytes(head[80:], "little")
    return f"is cut off, with {there:,} of {said:,} triangles" if b"\0" in head and 0 <= there < said else ""


SMALLEST_MESH, LARGEST_MESH = 0.1, 1e5
"""Longest side of the box around a mesh [µm]: less than a trapped sphere, more than a chip. Single precision holds
places of the largest to 8 nm."""


def check_mesh_size(name: str, length: float, metres_per_unit: float) -> None:
    """Refuse a mesh whose unit was mistaken.

    Args:
        name: What errors call it.
        length: Longest side of its box, in its units.
        metres_per_unit: Length of a unit [m].

    Raises:
        InputError: It is larger or smaller than anything under a microscope; with the units that would do.
    """
    size = length * metres_per_unit / 1e-6
    if SMALLEST_MESH <= size <= LARGEST_MESH:
        return
    units = {"µm": 1e-6, "mm": 1e-3, "m": 1.0, "nm": 1e-9, "inches": 0.0254}
    fits = [f"{m:g} ({unit})" for unit, m in units.items() if SMALLEST_MESH <= length * m / 1e-6 <= LARGEST_MESH]
    hint = f"; --scale {' or '.join(fits)} would do" if fits else ""
    raise InputError(
        f"{name}: is {size:.3g} µm long, by --scale {metres_per_unit:g} metres per unit; allowed: "
        f"{SMALLEST_MESH:g} to {LARGEST_MESH:g} µm{hint}"
    )
