"""`otwarp bench forces` and `integrators` as typed: table, files, overlay; bad input; no need of USD or netCDF."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from pathlib import Path

import pytest

from otwarp.bench.terms import measure
from otwarp.bench.terms.scenes import COMPARISONS
from otwarp.cli.main import main

BENCH = ["bench", "forces", "--device", "cpu"]
QUICK = [*BENCH, "--radius", "0.5", "--worlds", "8", "--rounds", "1", "--model", "bilinear-1e-2"]


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OTWARP_CACHE", str(tmp_path_factory.mktemp("tables")))
        yield


@pytest.fixture(scope="module")
def numbers(cache, tmp_path_factory) -> Path:
    """JSON of a run in an interpreter that finds neither USD nor netCDF, as a bare GPU machine may not."""
    file = tmp_path_factory.mktemp("bench") / "numbers.json"
    script = (
        "import sys\n"
        "class Bare:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in ('pxr', 'netCDF4', 'xarray', 'torch'):\n"
        "            raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, Bare())\n"
        "from otwarp.cli.main import main\n"
        f"sys.exit(main({[*QUICK, '--out', str(file)]!r}))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "bilinear table 1e-2" in done.stdout and f"wrote {file}" in done.stdout
    assert "table [kB]" in done.stdout and "build [s]" in done.stdout
    return file


def test_json_holds_the_rows(numbers):
    data = json.loads(numbers.read_text())
    assert [row["name"] for row in data["rows"]] == ["harmonic", "bilinear-1e-2"]
    assert data["worlds"] == 8 and data["kind"] == "cpu"
    assert data["rows"][1]["errors"]["largest"] <= 1e-2 and data["rows"][1]["build_seconds"] > 0.0


def test_plot_with_another_run(numbers, tmp_path, capfd):
    picture = tmp_path / "bench.png"
    assert main([*BENCH, *QUICK[4:-2], "--model", "none", "--plot", str(picture), "--with", str(numbers)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    out = capfd.readouterr().out
    assert "no trap" in out and "harmonic" in out and str(picture) in out


@pytest.mark.quick
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "cubic"], ["--model", "'cubic'", "bilinear-1e-2"]),
        (["--rounds", "0"], ["--rounds", "0"]),
        (["--worlds", "-3"], ["--worlds", "-3"]),
        (["--radius", "0"], ["radius", "0"]),
        (["--na", "1.4"], ["1.4", "1.33"]),
        (["--power", "0"], ["--power", "0"]),
        (["--polarization", "oblique"], ["polarization", "oblique"]),
        (["-o", "absent/x.json"], ["--out", "absent"]),
        (["--plot", "absent/x.png"], ["--plot", "absent"]),
        (["--plot", "x.png", "--with", "absent.json"], ["--with", "absent.json"]),
        (["--with", "absent.json"], ["--with", "--plot"]),
        (["--device", "cuda:77"], ["cuda:77"]),
        (["--index", "glass"], ["--index", "glass"]),
    ],
)
def test_bad_input(arguments, words, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([*BENCH, *arguments]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word in error
    assert list(tmp_path.iterdir()) == []


def test_a_run_of_another_bead_is_refused(numbers, capfd, tmp_path):
    picture = tmp_path / "x.png"
    assert main([*BENCH, "--radius", "0.6", "--plot", str(picture), "--with", str(numbers)]) == 2
    error = capfd.readouterr().err
    assert "another bead" in error and "r = 0.5 µm" in error and not picture.exists()


@pytest.mark.quick
def test_help_names_the_benchmarks(capfd):
    assert main(["bench", "--help"]) == 0
    out = capfd.readouterr().out
    assert "forces" in out and "integrators" in out


INTEGRATORS = ["bench", "integrators", "--device", "cpu"]


def test_integrators(tmp_path, capfd):
    file, picture = tmp_path / "numbers.json", tmp_path / "bench.png"
    quick = ["--radius", "0.5", "--worlds", "8", "--rounds", "1", "--seconds", "0.01", "--axis", "precision"]
    assert main([*INTEGRATORS, *quick, "--out", str(file), "--plot", str(picture)]) == 0
    data = json.loads(file.read_text())
    assert [line["name"] for line in data["lines"]][:2] == ["heun", "float32"] and data["worlds"] == 8
    assert picture.read_bytes().startswith(b"\x89PNG")
    out = capfd.readouterr().out
    assert "Heun, default" in out and "float32" in out and f"wrote {file}" in out
    assert main([*INTEGRATORS, "--radius", "0.6", "--plot", str(picture), "--with", str(file)]) == 2
    assert "another bead" in capfd.readouterr().err


@pytest.mark.quick
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--axis", "colour"], ["--axis", "'colour'", "precision"]),
        (["--seconds", "-1"], ["--seconds", "-1"]),
        (["--worlds", "1"], ["--worlds", "1"]),
        (["--polarization", "x"], ["--polarization", "'x'", "circular"]),
        (["-o", "absent/x.json"], ["--out", "absent"]),
        (["--with", "absent.json"], ["--with", "--plot"]),
        (["--plot", "x.png", "--with", "absent.json"], ["--with", "absent.json"]),
    ],
)
def test_bad_input_of_integrators(arguments, words, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([*INTEGRATORS, *arguments]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word in error
    assert list(tmp_path.iterdir()) == []


def test_terms_prints_costs_and_writes_numbers(tmp_path, capfd, monkeypatch):
    few = [c for c in COMPARISONS if c.with_ in ("noise", "harmonic")]
    monkeypatch.setattr(measure, "bench_terms", functools.partial(measure.bench_terms, comparisons=few, beads=256))
    file = tmp_path / "terms.json"
    options = ["--rounds", "1", "--seconds", "0.001", "--bodies", "64", "--device", "cpu", "--out", str(file)]
    assert main(["bench", "terms", *options]) == 0
    out = capfd.readouterr().out
    assert "Cost of each term" in out and "Brownian noise" in out
    terms = json.loads(file.read_text())["terms"]["terms"]
    assert set(terms) == {c.term for c in few}
    assert terms["Brownian noise"]["on"]["median"] > 0.0


@pytest.mark.quick
def test_terms_refuses_a_time_that_is_none(capfd):
    assert main(["bench", "terms", "--seconds", "-1"]) == 2
    assert capfd.readouterr().err == "otwarp: --seconds is -1; allowed: above 0 and up to 60 s\n"
