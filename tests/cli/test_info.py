"""`otwarp info` answers for the run that would be started with the same options."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import warp as wp

from otwarp.cli.main import main
from otwarp.simulation.drivers.compilation import resident_threads

SCENES = Path(__file__).parents[2] / "scenes"
BEAD, CROWD = str(SCENES / "single_bead.usda"), str(SCENES / "ten_thousand_cells.usda")


def ask(capfd: pytest.CaptureFixture[str], device: str, *options: str) -> dict:
    assert main(["info", BEAD, "--device", device, "--json", *options]) == 0
    return json.loads(capfd.readouterr().out)


def test_info_has_the_precision_of_the_run(device: str, capfd: pytest.CaptureFixture[str]) -> None:
    single, double = (ask(capfd, device, "--precision", p, "--worlds", "100") for p in ("float32", "float64"))
    assert (single["precision"], double["precision"]) == ("float32", "float64")
    # nearly all of it are real numbers, and all of these twice as large
    assert 1.5 < double["memory"] / single["memory"] < 2.0
    assert (ask(capfd, device)["fast_math"], ask(capfd, device, "--fast-math")["fast_math"]) == (False, True)


def test_info_names_the_precision_beside_the_driver(device: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["info", BEAD, "--device", device, "--precision", "float64"]) == 0
    assert "(driver: solo, float64)" in capfd.readouterr().out
    assert main(["info", BEAD, "--device", device, "--fast-math"]) == 0
    assert "(driver: solo, float32, fast math)" in capfd.readouterr().out


@pytest.mark.thorough
def test_info_refuses_what_the_run_would(device: str, capfd: pytest.CaptureFixture[str]) -> None:
    for command in (["info", CROWD], ["run", CROWD, "--out", "never-made"]):
        assert main([*command, "--device", device, "--precision", "float64"]) == 2
        error = capfd.readouterr().err
        assert "precision is 'float64'; allowed: float32 in a scene of" in error and error.count("\n") == 1
    assert not Path("never-made").exists()


@pytest.mark.thorough
def test_info_says_what_a_world_takes(device: str, capfd: pytest.CaptureFixture[str]) -> None:
    few, many = (ask(capfd, device, "--worlds", n) for n in ("100", "1100"))
    assert many["memory"] - few["memory"] == 1000 * few["memory_per_world"]["state"] > 0
    assert few["memory_per_world"]["scratch"] == 0
    assert main(["info", CROWD, "--device", device, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["memory_per_world"]["scratch"] > 1e6
    assert main(["info", CROWD, "--device", device]) == 0
    assert "of scratch" in capfd.readouterr().out


def test_info_says_what_the_device_keeps_for_the_kernels(device: str, capfd: pytest.CaptureFixture[str]) -> None:
    rows = ask(capfd, device, "--kernels")["kernels"]
    assert main(["info", BEAD, "--device", device, "--kernels"]) == 0
    said = "Memory that the device keeps for the kernels" in capfd.readouterr().out
    # threads of a CPU use the stack
    assert said == bool(rows) == (device != "cpu")
    for row in rows:
        assert 0 < row["registers"] <= 255 and row["reserved"] == row["local"] * resident_threads(wp.get_device(device))
