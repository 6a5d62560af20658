"""What is implausible is said once by every command, before anything is compiled; `--strict` makes it an error."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from otwarp.cli.main import main
from otwarp.cli.validate import SLOW

SCENES = Path(__file__).parents[2] / "scenes"
HOT = ("temperature = 298.15", "temperature = 25")


def slip(tmp_path: Path, scene: str, *changes: tuple[str, str]) -> Path:
    """A copy of a shipped scene with a slip in it."""
    text = (SCENES / f"{scene}.usda").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / f"{scene}.usda"
    path.write_text(text)
    return path


def otwarp(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "otwarp", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=os.environ | environment, check=False)


def test_every_command_says_it_once_in_one_line(tmp_path: Path, device: str) -> None:
    path = slip(tmp_path, "single_bead", HOT)
    run = ("run", path, "--out", tmp_path / "out", "--duration", "0.02", "--fps", "100", "--device", device)
    live = ("teleop", path, "--duration", "0.1", "--no-open", "--no-page", "--device", device)
    for command in (("info", path, "--device", device), run, live):
        done = otwarp(*command)
        said = [line for line in done.stderr.splitlines() if "25 K" in line]
        assert done.returncode == 0, done.stderr
        assert len(said) == 1, (command, done.stderr)
        assert said[0].startswith(f"otwarp: warning: {path}: /World: ot:medium:temperature = 25 K; usual: 250 … 400 K")
        assert "UserWarning" not in done.stderr and "PlausibilityWarning" not in done.stderr


def test_validate_says_it_and_strict_refuses_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = slip(tmp_path, "single_bead", HOT)
    assert main(["validate", str(path)]) == 0
    out = capfd.readouterr().out.splitlines()
    assert len(out) == 2 and out[1] == f"{path}: valid"
    assert out[0].startswith(f"warning: {path}: /World: ot:medium:temperature = 25 K")
    assert main(["validate", "--strict", str(path)]) == 2
    out, error = capfd.readouterr()
    assert (
        out == ""
        and error.startswith(f"error: {path}: /World: ot:medium:temperature = 25 K")
        and error.count("\n") == 1
    )
    assert main(["validate", "--strict", "--json", str(path)]) == 2
    report = json.loads(capfd.readouterr().out)
    assert not report["valid"] and [f["severity"] for f in report["findings"]] == ["error"]


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.usda")), ids=lambda path: path.stem)
def test_shipped_scenes_pass_strictly(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "--strict", str(path)]) == 0
    out, error = capfd.readouterr()
    assert out == f"{path}: valid\n"
    assert error in ("", f"otwarp: {SLOW}\n")  # whoever waits on a busy machine is told for what


def test_a_task_that_is_lost_is_told_without_compiling(tmp_path: Path, device: str) -> None:
    # with one robot instead of two, the cell is far from the midpoint of its robots
    path = slip(
        tmp_path, "cell_delivery", ("ot:goal:robots = [\n            </World/Robots/left>,\n", "ot:goal:robots = [\n")
    )
    for command in (("info", path, "--device", device), ("validate", path)):
        done = otwarp(*command, WARP_CACHE_PATH=str(tmp_path / "kernels"))
        assert done.returncode == 0
        assert "the task is lost at t = 0" in done.stdout + done.stderr
        assert not list((tmp_path / "kernels").rglob("*.o"))


def test_a_piped_run_says_what_it_compiles_and_only_then(tmp_path: Path, device: str) -> None:
    path = SCENES / "single_bead.usda"
    run = ("run", path, "--duration", "0.02", "--fps", "100", "--device", device, "--out")
    kernels = str(tmp_path / "kernels")
    first, second = (otwarp(*run, tmp_path / out, WARP_CACHE_PATH=kernels) for out in ("first", "second"))
    told, *each = first.stderr.splitlines()
    assert told.startswith(f"otwarp: compiling 3 of 3 kernel modules for {device}, some seconds each")
    assert each == [f"otwarp: compiled {n} of 3" for n in (1, 2, 3)]
    assert (second.returncode, second.stderr) == (0, "")
