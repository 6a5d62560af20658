"""Legacy VTK files: those that VTK 9.7 wrote, and what is refused of others. Image data: see `test_flow_file`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene.read.flow_file import read_flow_grid

DATA = Path(__file__).parent / "data"
"""Written by vtkStructuredPointsWriter and vtkRectilinearGridWriter: u = 3·(node number) + (0, 1, 2) µm/s on 3 × 2 × 2
nodes, the last index fastest; behind scalars, before normals, with component names, or in a field of float32."""

TEXT = (DATA / "rectilinear_text.vtk").read_text()
POINTS = (
    "# vtk DataFile Version 2.0\n\nascii\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nORIGIN -1e-5 0 2e-6\n"
    "ASPECT_RATIO 2e-6 4e-6 5e-7\nPOINT_DATA 12\n"
)
"""Head of an older file."""


@pytest.mark.parametrize("name", ["rectilinear_text", "points_bytes", "field_bytes"])
def test_files_of_vtk_itself(name):
    found = read_flow_grid(DATA / f"{name}.vtk")
    np.testing.assert_allclose(found.low, (-10.0, 0.0, 2.0), atol=1e-12)
    np.testing.assert_allclose(found.spacing, (2.0, 4.0, 0.5), rtol=1e-12)
    np.testing.assert_allclose(found.velocity, np.arange(36.0).reshape(3, 2, 2, 3), atol=2e-6)


def test_whatever_stands_before_the_velocity(tmp_path):
    """Attributes of every kind, in either case, and Windows' ends of lines."""
    before = (
        "COLOR_SCALARS c 2\n" + "0.5 " * 24 + "\nLOOKUP_TABLE t 2\n" + "1 " * 8 + "\nTENSORS t float\n" + "9 " * 108
        + "\nTEXTURE_COORDINATES x 2 int\n" + "3 " * 24 + "\nnormals n float\n" + "1 " * 36
        + "\nFIELD f 2\nmeasured 1 12 int\n" + "4 " * 12 + "\nway 3 2 double\n" + "5 " * 6 + "\n"
    )  # fmt: skip
    numbers = 1e-6 * np.arange(36.0).reshape(3, 2, 2, 3).transpose(2, 1, 0, 3).ravel()
    (tmp_path / "a.vtk").write_text(
        (
            POINTS + before + "SCALARS u double 3\nLOOKUP_TABLE default\n" + " ".join(map(repr, numbers.tolist()))
        ).replace("\n", "\r\n"),
        newline="",
    )
    found = read_flow_grid(tmp_path / "a.vtk")
    np.testing.assert_allclose(found.velocity, np.arange(36.0).reshape(3, 2, 2, 3), rtol=1e-12)
    np.testing.assert_allclose((*found.low, *found.spacing), (-10.0, 0.0, 2.0, 2.0, 4.0, 0.5), rtol=1e-12)


def test_cells_may_come_before_points(tmp_path):
    """As VTK itself writes a grid that has data of both."""
    cells = "CELL_DATA 2\nSCALARS p float\nLOOKUP_TABLE default\n1 2\nVECTORS c float\n9 9 9 9 9 9\n"
    cells += "FIELD f 1\nd 3 2 float\n8 8 8 8 8 8\n"
    (tmp_path / "a.vtk").write_text(TEXT.replace("POINT_DATA", cells + "POINT_DATA"))
    np.testing.assert_array_equal(
        read_flow_grid(tmp_path / "a.vtk").velocity, read_flow_grid(DATA / "rectilinear_text.vtk").velocity
    )
    (tmp_path / "b.vtk").write_text(TEXT[: TEXT.index("POINT_DATA")] + cells)
    with pytest.raises(InputError, match="no point array of three components"):
        read_flow_grid(tmp_path / "b.vtk")


BAD = {
    "no vtk": (TEXT[1:], r"first line = ' vtk DataFile Version 5.1': must be '# vtk DataFile Version"),
    "no format": (TEXT.replace("ASCII", "asciii"), "third line = 'ASCIII': must be ASCII or BINARY"),
    "unstructured": (
        TEXT.replace("RECTILINEAR_GRID", "UNSTRUCTURED_GRID"),
        "DATASET = UNSTRUCTURED_GRID: must be STRUCTURED_POINTS or RECTILINEAR_GRID",
    ),
    "uneven": (TEXT.replace("-6e-06 \n", "-5e-06 \n"), "x = 3 places: must be 2 or more, rising by equal steps"),
    "other points": (TEXT.replace("POINT_DATA 12", "POINT_DATA 9"), "must be an attribute of points"),
    "nodes": (TEXT.replace("Y_COORDINATES 2", "Y_COORDINATES 1"), "line '4e-06': must be what a STRUCTURED_POINTS"),
    "truncated": (TEXT[:560], r"ends after \d+ of 36 numbers: must hold all of them"),
    "type": (TEXT.replace("U double", "U string"), "data type = string: must be one of char, unsigned_char"),
    "cells": (TEXT.replace("POINT_DATA", "CELL_DATA"), "no point array of three components: must hold one"),
    "no velocity": (TEXT.replace("VECTORS", "NORMALS"), "no point array of three components: must hold one"),
    "no data": (TEXT[:300], "no point array of three components|ends after"),
    "words": (TEXT.replace("1e-06 2e-06", "here there"), "line 'VECTORS U double': must be as VTK's legacy format"),
    "few words": (TEXT.replace("DATASET RECTILINEAR_GRID", "DATASET"), "line 'DATASET': must be as VTK's legacy"),
    "count": (
        POINTS.replace("POINT_DATA 12", "POINT_DATA 1") + "VECTORS u float\n1 2 3",
        "POINT_DATA = 1: must be 3 × 2 × 2, one per node",
    ),
    "no grid": (POINTS.replace("DIMENSIONS 3 2 2", "") + "VECTORS u float\n" + "1 " * 36, "legacy format has it"),
    "nan": (POINTS + "VECTORS u float\n" + "nan " * 36, r"velocity\[0\]\[0\]\[0\]\[0\] = nan: must be finite"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_refused_in_one_line(case, tmp_path):
    text, message = BAD[case]
    (tmp_path / "field.vtk").write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read_flow_grid(tmp_path / "field.vtk")
    assert "\n" not in str(error.value) and str(error.value).startswith(str(tmp_path))
