"""`otwarp forces` as typed: points in, efficiencies out; curves; bad input."""

from __future__ import annotations

import csv
import json

import pytest

from otwarp.cli.main import main

SPHERE = ["forces", "--radius", "1.0", "--index", "1.59", "--na", "1.2", "--polarization", "x"]


def test_points_to_forces(tmp_path, capfd):
    points, out = tmp_path / "points.csv", tmp_path / "forces.csv"
    points.write_text("x_um,y_um,z_um\n0,0,0.0534000319\n1.0,0,0.0534000319\n")
    assert main([*SPHERE, "--points", str(points), "--out", str(out), "--model", "exact"]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert list(rows[0]) == ["x_um", "y_um", "z_um", "Qx", "Qy", "Qz"]
    assert abs(float(rows[0]["Qz"])) < 1e-8 and float(rows[1]["Qx"]) < -0.3
    assert "2 points" in capfd.readouterr().out


def test_curves_and_fit(tmp_path, capfd):
    picture = tmp_path / "force.png"
    assert main([*SPHERE, "--curves", "--plot", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "1.0497, 1.0224, 0.55442 pN/µm" in capfd.readouterr().out
    assert main([*SPHERE, "--fit", "piecewise", "--json"]) == 0
    assert set(json.loads(capfd.readouterr().out)) == {"radial", "axial", "isotropic"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--na", "1.4", "--curves"], ["1.4", "1.33", "immersion"]),
        (["--radius", "0", "--curves"], ["radius", "0"]),
        (["--polarization", "0,0", "--curves"], ["polarization"]),
        (["--index", "glass", "--curves"], ["--index", "glass"]),
        (["--radius", "90", "--curves"], ["90", "up to"]),
        (["--curves", "--points", "nowhere.csv"], ["--points", "--out"]),
        (["--points", "nowhere.csv", "--out", "o.csv"], ["nowhere.csv"]),
        ([], ["nothing to do"]),
    ],
)
def test_bad_input(arguments, words, capfd):
    assert main([*SPHERE, *arguments]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word in error


def test_points_with_a_missing_column(tmp_path, capfd):
    points, out = tmp_path / "points.csv", tmp_path / "forces.csv"
    points.write_text("x_um,y_um\n0,0\n")
    assert main([*SPHERE, "--points", str(points), "--out", str(out)]) == 2
    assert "z_um" in capfd.readouterr().err and not out.exists()
