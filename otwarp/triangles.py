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
        raise InputError(f"{name}: has no triangles; allowed: {allowed}")
    wrong = np.flatnonzero(~np.isfinite(mesh.vertices[mesh.faces]).all(axis=(1, 2)))
    if len(wrong):
        corners = mesh.vertices[mesh.faces[wrong[0]]].tolist()
        raise InputError(f"{name}: triangle {wrong[0]} has the corners {corners}; allowed: finite numbers")
    return name, trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
