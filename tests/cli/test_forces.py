"""`otwarp forces` as typed: points in, efficiencies out; models, tables, curves, fits, pictures; bad input."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from otwarp.cli.main import main

SPHERE = ["forces", "--radius", "1.0", "--index", "1.59", "--na", "1.2", "--polarization", "x"]
SMALL = ["forces", "--radius", "0.5", "--index", "1.59", "--na", "1.2", "--polarization", "x", "--tolerance", "1e-2"]
PNG = b"\x89PNG"


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory):
    """A cache of the module's own: its one table is built once."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("tables")
        patch.setenv("OTWARP_CACHE", str(folder))
        yield folder


def points_file(folder, rows, header="x_um,y_um,z_um"):
    path = folder / "points.csv"
    path.write_text("\n".join([header, *(",".join(str(v) for v in row) for row in rows), ""]))
    return path


def output(capfd):
    captured = capfd.readouterr()
    assert captured.err == ""
    return captured.out


@pytest.mark.quick
def test_points_to_forces(tmp_path, capfd):
    points, out = points_file(tmp_path, [(0, 0, 0.0534000319), (1.0, 0, 0.0534000319)]), tmp_path / "forces.csv"
    assert main([*SPHERE, "--points", str(points), "--out", str(out), "--model", "exact"]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert list(rows[0]) == ["x_um", "y_um", "z_um", "Qx", "Qy", "Qz"]
    assert abs(float(rows[0]["Qz"])) < 1e-8 and float(rows[1]["Qx"]) < -0.3
    assert "2 points, estimated error of Q" in output(capfd)


def test_a_table_of_a_spreadsheet_is_read(tmp_path, capfd):
    """Spreadsheets put a byte-order mark before the first column's name, and other columns beside ours."""
    points, out = tmp_path / "points.csv", tmp_path / "forces.csv"
    points.write_bytes(b"\xef\xbb\xbfx_um,name,y_um,z_um\r\n0.1,a,0,0\r\n")
    assert main([*SMALL, "--points", str(points), "--out", str(out)]) == 0
    assert len(out.read_text().splitlines()) == 2
    assert "1 points" in output(capfd)


@pytest.mark.parametrize("model", ["table", "piecewise", "piecewise-isotropic", "harmonic"])
def test_a_model_prints_its_error_against_exact(model, tmp_path, capfd):
    rows = np.random.default_rng(3).uniform(-0.4, 0.4, (30, 3))
    points, out, exact = points_file(tmp_path, rows), tmp_path / "forces.csv", tmp_path / "exact.csv"
    assert main([*SMALL, "--points", str(points), "--out", str(exact)]) == 0
    assert main([*SMALL, "--points", str(points), "--out", str(out), "--model", model]) == 0
    assert "error against exact on these points" in output(capfd)
    assert main([*SMALL, "--points", str(points), "--out", str(out), "--model", model, "--json"]) == 0
    found, truth = (np.loadtxt(path, delimiter=",", skiprows=1)[:, 3:] for path in (out, exact))
    gap = np.linalg.norm(found - truth, axis=1)
    error = json.loads(output(capfd))["points"]["error"]
    assert error["largest"] == pytest.approx(gap.max(), rel=1e-6)
    assert error["rms"] == pytest.approx(np.sqrt(np.mean(gap**2)), rel=1e-6)
    assert (error["largest"] < 1e-2 * error["peak"]) == (model == "table")


def test_of_many_points_some_are_compared_with_exact(tmp_path, capfd, monkeypatch):
    from otwarp.cli import forces

    monkeypatch.setattr(forces, "MOST_POINTS", 20)
    monkeypatch.setattr(forces, "SOME_POINTS", 10)
    points, out = points_file(tmp_path, [(0.01 * i, 0, 0) for i in range(21)]), tmp_path / "forces.csv"
    assert main([*SMALL, "--points", str(points), "--out", str(out), "--model", "table"]) == 0
    assert len(out.read_text().splitlines()) == 22
    assert "10 of them, drawn at random" in output(capfd)


def test_a_warp_device_gives_the_same_forces(tmp_path, capfd, device):
    points = points_file(tmp_path, [(0.1, 0.2, 0.3), (-0.5, 0.4, 0.0)])
    numpy, warp = tmp_path / "numpy.csv", tmp_path / "warp.csv"
    assert main([*SMALL, "--points", str(points), "--out", str(numpy)]) == 0
    assert main([*SMALL, "--points", str(points), "--out", str(warp), "--device", device]) == 0
    a, b = (np.loadtxt(path, delimiter=",", skiprows=1) for path in (numpy, warp))
    assert b == pytest.approx(a, abs=1e-9)
    assert "exact" in capfd.readouterr().out


def test_curves_and_their_picture(tmp_path, capfd):
    picture = tmp_path / "force.png"
    assert main([*SPHERE, "--curves"]) == 0
    assert "1.0497, 1.0224, 0.55442 pN/µm" in output(capfd)
    assert main([*SMALL, "--plot", str(picture), "--json"]) == 0
    assert picture.read_bytes().startswith(PNG)
    rmse = json.loads(output(capfd))["curves"]["rmse"]
    assert rmse["table"]["radial"] < 0.1 * rmse["piecewise"]["radial"] < rmse["harmonic"]["radial"]


def test_fits_joined_and_free(capfd):
    found = {}
    for way in ("continuous", "free"):
        assert main([*SMALL, "--fit", "piecewise", f"--{way}", "--json"]) == 0
        found[way] = json.loads(output(capfd))["fit"]
    for name in ("radial", "axial", "isotropic"):
        joined, free = found["continuous"][name], found["free"][name]
        assert free["mse"] <= 1.01 * joined["mse"] and joined["jump"] == 0.0 != free["jump"]
        assert joined["region"] == pytest.approx(1.5 * 0.5 + 2.0 * 1.064)
    assert main([*SMALL, "--fit", "piecewise"]) == 0
    text = output(capfd)
    assert "trap region: up to 2.878 µm" in text and "joined at δ" in text
    assert text.count("worst") == text.count("R²") == 3
    assert main([*SMALL, "--fit", "harmonic", "--json"]) == 0
    assert json.loads(output(capfd))["fit"]["radial"]["law"]["cutoff"] is None


def test_the_table_describes_itself(cache, capfd):
    command = [*SMALL, "--interpolation", "bicubic", "--table"]
    assert main(command) == 0
    text = output(capfd)
    assert "made in" in text and "layers    2: both helicities" in text
    assert main(command) == 0
    assert "cached    read in" in output(capfd)
    assert main([*command, "--json"]) == 0
    table = json.loads(output(capfd))["table"]
    assert table["cached"] is True and (cache / table["file"]).is_file()
    assert 0.0 < table["error"] <= table["tolerance"] == 0.01
    assert table["levels"][-1]["radius"] == table["cutoff"]
    assert table["bytes"] == sum(4 * np.prod(level["shape"]) for level in table["levels"])
    (cache / table["file"]).write_bytes(b"not a table")
    assert main(command) == 0
    assert "made in" in output(capfd)


def test_a_map_with_its_basin_and_everything_in_one_json(tmp_path, capfd):
    picture = tmp_path / "map.png"
    assert main([*SMALL, "--map", str(picture), "--curves", "--table", "--json"]) == 0
    found = json.loads(output(capfd))
    assert set(found) == {"map", "curves", "table"}
    assert picture.read_bytes().startswith(PNG)
    assert found["map"]["equilibrium"] == pytest.approx(found["curves"]["equilibrium"])
    assert found["map"]["escape_contour"]["upstream"] is None
    assert found["map"]["escape_contour"]["downstream"] > found["curves"]["escape_distance"][2]


def test_a_beam_that_does_not_hold_the_sphere(tmp_path, capfd):
    """Curves cannot be; the map can."""
    picture = tmp_path / "map.png"
    loose = ["forces", "--radius", "0.5", "--index", "2.0", "--na", "0.6", "--tolerance", "0.05"]
    assert main([*loose, "--map", str(picture)]) == 0
    assert "none on the axis" in output(capfd) and picture.read_bytes().startswith(PNG)
    assert main([*loose, "--curves"]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and "no stable point" in error


def test_help_is_grouped_and_has_examples(capfd):
    assert main(["forces", "--help"]) == 0
    text = output(capfd)
    for title in ("Sphere and medium:", "Beam, ", "Forces at points:", "Force table:", "Curves, fits", "Examples:"):
        assert title in text
    for option in ("--radius µm", "--points CSV", "--map FILE", "--tolerance T", "--continuous / --free", "--json"):
        assert option in text


@pytest.mark.quick
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--na", "1.4", "--curves"], ["1.4", "1.33", "immersion"]),
        (["--na", "nan", "--curves"], ["--na", "nan"]),
        (["--radius", "0", "--curves"], ["radius", "0"]),
        (["--radius", "-1", "--curves"], ["radius", "-1"]),
        (["--radius", "1e-9", "--curves"], ["--radius", "1e-09"]),
        (["--radius", "90", "--curves"], ["90", "up to"]),
        (["--radius", "90", "--table"], ["90", "up to"]),
        (["--radius", "wide", "--curves"], ["--radius", "wide"]),
        (["--index", "glass", "--curves"], ["--index", "glass"]),
        (["--index", "1.33", "--curves"], ["index", "medium"]),
        (["--index", "1e9", "--curves"], ["--index", "1e9", "100"]),
        (["--index", "1.5-0.1i", "--curves"], ["index", "imaginary"]),
        (["--polarization", "0,0", "--curves"], ["polarization", "both 0"]),
        (["--polarization", "nan,1", "--curves"], ["polarization", "finite"]),
        (["--polarization", "z", "--curves"], ["polarization", "'z'"]),
        (["--polarization", "1,2,3", "--curves"], ["--polarization", "1,2,3"]),
        (["--beam", "bessel", "--curves"], ["bessel", "gaussian"]),
        (["--power", "0", "--curves"], ["--power", "above 0"]),
        (["--power", "-3", "--curves"], ["power", "-3"]),
        (["--wavelength", "0", "--curves"], ["wavelength", "0"]),
        (["--filling", "1e-6", "--curves"], ["--filling", "0.01"]),
        (["--charge", "1000000", "--curves"], ["--charge", "30"]),
        (["--depth", "5", "--curves"], ["depth", "5", "glass"]),
        (["--depth", "-1", "--glass-index", "1.5", "--curves"], ["depth", "-1"]),
        (["--depth", "5", "--glass-index", "1.2", "--curves"], ["glass_index", "1.2", "numerical aperture"]),
        (["--glass-index", "nan", "--curves"], ["--glass-index", "nan"]),
        (["--tolerance", "0.5", "--table"], ["tolerance", "0.5", "1e-05 to 0.1"]),
        (["--tolerance", "nan", "--curves"], ["tolerance", "nan"]),
        (["--interpolation", "cubic", "--table"], ["cubic", "bilinear, bicubic"]),
        (["--model", "cubic", "--points", "p.csv", "--out", "o.csv"], ["cubic", "piecewise-isotropic"]),
        (["--fit", "cubic"], ["--fit", "cubic"]),
        (["--plot", "force.jpeg"], ["force.jpeg", ".png"]),
        (["--map", "map"], ["map", ".png"]),
        (["--curves", "--points", "nowhere.csv"], ["--points", "--out"]),
        (["--points", "nowhere.csv", "--out", "o.csv"], ["nowhere.csv"]),
        (["--points", "same.csv", "--out", "same.csv"], ["--out", "same.csv"]),
        ([], ["nothing to do"]),
    ],
)
def test_bad_input(arguments, words, capfd):
    assert main([*SPHERE, *arguments]) == 2
    captured = capfd.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    for word in words:
        assert word in captured.err


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_um,y_um\n0,0\n", ["z_um", "missing"]),
        ("", ["x_um", "missing"]),
        ("x_um,y_um,z_um\n0,0,0\n0,nan,0\n", ["line 3", "y_um", "nan"]),
        ("x_um,y_um,z_um\n0,0\n", ["line 2", "z_um"]),
        ("x_um,y_um,z_um\n0,zero,0\n", ["line 2", "y_um", "zero"]),
        ("x_um,y_um,z_um\n1e6,0,0\n", ["line 2", "1e+06", "200"]),
        (b"\xff\xfe\x00", ["not a CSV file"]),
    ],
)
def test_bad_points(text, words, tmp_path, capfd):
    points, out = tmp_path / "points.csv", tmp_path / "forces.csv"
    points.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert main([*SPHERE, "--points", str(points), "--out", str(out)]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and str(points) in error and not out.exists()
    for word in words:
        assert word in error


@pytest.mark.parametrize("option", ["--out", "--map"])
def test_a_folder_that_is_not_there(option, tmp_path, capfd):
    points = points_file(tmp_path, [(0, 0, 0)])
    where = tmp_path / "nowhere" / "result.png"
    wanted = ["--points", str(points), "--out", str(where)] if option == "--out" else ["--map", str(where)]
    assert main([*SMALL, *wanted]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and str(where) in error
