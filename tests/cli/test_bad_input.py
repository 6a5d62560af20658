"""Bad input at the command line: one line on standard error, exit code 2, nothing written."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path

import pytest

from otwarp.cli.main import main

SCENES = Path(__file__).parents[2] / "scenes"
BEAD = str(SCENES / "single_bead.usda")


def _replaced(tmp_path: Path, old: str, new: str, *, scene: str = "single_bead") -> str:
    """A copy of a shipped scene with one authored line changed."""
    text = (SCENES / f"{scene}.usda").read_text()
    assert old in text
    path = tmp_path / f"{scene}.usda"
    path.write_text(text.replace(old, new, 1))
    return str(path)


def _truncated_crate(tmp_path: Path) -> str:
    from pxr import Sdf

    path = tmp_path / "cut.usdc"
    Sdf.Layer.FindOrOpen(BEAD).Export(str(path))
    path.write_bytes(path.read_bytes()[:600])
    return str(path)


def _stray_bytes(tmp_path: Path) -> str:
    path = tmp_path / "stray.usda"
    path.write_bytes(Path(BEAD).read_bytes().replace(b"double ot:trap:power", b"double ot:trap:po\xff\xfewer", 1))
    return str(path)


def _text_file(tmp_path: Path) -> str:
    path = tmp_path / "notes.usda"
    path.write_text("these are not USD\n")
    return str(path)


CASES = {
    "missing file": (lambda t: [str(t / "absent.usda")], ["absent.usda"]),
    "not USD": (lambda t: [_text_file(t)], ["notes.usda"]),
    "truncated crate": (lambda t: [_truncated_crate(t)], ["cut.usdc"]),
    "no default prim": (
        lambda t: [_replaced(t, 'defaultPrim = "World"', 'doc = ""')],
        ["single_bead.usda", "defaultPrim"],
    ),
    "metersPerUnit 0": (
        lambda t: [_replaced(t, "metersPerUnit = 0.000001", "metersPerUnit = 0")],
        ["metersPerUnit", "0"],
    ),
    "metersPerUnit negative": (
        lambda t: [_replaced(t, "metersPerUnit = 0.000001", "metersPerUnit = -1")],
        ["metersPerUnit", "-1"],
    ),
    "metersPerUnit absent": (
        lambda t: [_replaced(t, "metersPerUnit = 0.000001", 'comment = ""')],
        ["metersPerUnit"],
    ),
    "misspelt attribute": (
        lambda t: [_replaced(t, "double ot:trap:power =", "double ot:trap:powr =")],
        ["/World", "ot:trap:powr", "ot:trap:power"],
    ),
    "wrong type": (
        lambda t: [_replaced(t, "double ot:trap:power =", 'string ot:trap:power = "one" #')],
        ["ot:trap:power", "string", "double"],
    ),
    "unknown force model": (
        lambda t: [_replaced(t, 'ot:trap:model = "harmonic"', 'ot:trap:model = "magic"')],
        ["ot:trap:model", "magic", "harmonic", "piecewise"],
    ),
    "NA at the medium index": (
        lambda t: [_replaced(t, "ot:trap:numericalAperture = 1.2", "ot:trap:numericalAperture = 1.4")],
        ["ot:trap:numericalAperture", "1.4", "1.33"],
    ),
    "negative duration": (lambda t: [BEAD, "--duration", "-1"], ["duration", "-1"]),
    "no worlds": (lambda t: [BEAD, "--worlds", "0"], ["worlds", "0", "1"]),
    "worlds beyond memory": (lambda t: [BEAD, "--worlds", "3000000000"], ["worlds is 3000000000", "1 … ", "memory"]),
    "trap speed beyond a step": (lambda t: [BEAD, "--trap-speed", "1e9"], ["duration is 1e-09 s", "at least one"]),
    "not UTF-8": (lambda t: [_stray_bytes(t)], ["stray.usda", "contents", "valid"]),
    "worlds not a number": (lambda t: [BEAD, "--worlds", "many"], ["--worlds", "many"]),
    "seed out of range": (lambda t: [BEAD, "--seed", "-5"], ["seed", "-5"]),
    "unstable step": (lambda t: [BEAD, "--time-step", "1.0"], ["time step", "unstable", "below"]),
    "no such device": (lambda t: [BEAD, "--device", "cuda:9"], ["device", "cuda:9", "cpu"]),
    "no frames": (lambda t: [BEAD, "--fps", "0"], ["--fps", "0", "above 0"]),
    "trap speed 0": (lambda t: [BEAD, "--trap-speed", "0"], ["--trap-speed", "0"]),
    "trap speed inf": (lambda t: [BEAD, "--trap-speed", "inf"], ["--trap-speed", "inf", "finite"]),
    "worlds of a checkpoint": (lambda t: [BEAD, "--resume", "x.npz", "--worlds", "2"], ["--worlds is 2", "--resume"]),
    "seed of a checkpoint": (lambda t: [BEAD, "--resume", "x.npz", "--seed", "0"], ["--seed is 0", "--resume"]),
    "step of a checkpoint": (
        lambda t: [BEAD, "--resume", "x.npz", "--time-step", "1e-3"],
        ["--time-step is 0.001", "--resume"],
    ),
    "samples too short": (
        lambda t: [str(SCENES / "cell_delivery.usda"), "--duration", "1000"],
        ["/World/Traps", "1000"],
    ),
    "unknown option": (lambda t: [BEAD, "--warp-factor", "9"], ["--warp-factor"]),
    "not a checkpoint": (lambda t: [BEAD, "--resume", str(SCENES / "single_bead.usda")], ["checkpoint"]),
}


@pytest.mark.parametrize("name", CASES)
def test_run_refuses(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    arguments, words = CASES[name]
    out = tmp_path / "out"
    code = main(["run", *arguments(tmp_path), "--out", str(out)])
    *said, error = capfd.readouterr().err.splitlines()
    assert code == 2
    # with an empty cache
    assert error.startswith("otwarp: ") and all(line.startswith("otwarp: compil") for line in said)
    for word in words:
        assert word in error
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", BEAD, "--worlds", f"{2**40}"], "which fit into the memory of this machine"),
        (["info", BEAD, "--worlds", f"{10**30}"], "which fit into the memory of this machine"),
        pytest.param(
            ["bench", "integrators", "--rounds", "1", "--worlds", f"{2**40}"],
            "which fit into the memory of this machine",
            marks=pytest.mark.thorough,
        ),
        (["run", BEAD, "--record-worlds", f"{2**40}"], "allowed: 1 to 1"),
        (["run", BEAD, "--duration", "1e300"], "allowed: up to 1e+12 steps"),
        (["run", BEAD, "--time-step", "5e-324"], "allowed: up to 1e+12 steps"),
        (["bench", "forces", "--model", "harmonic", "--rounds", "1", "--radius", "1e300"], "allowed: up to"),
        (["teleop", BEAD, "--no-page", "--budget", "5e-324"], "a share of a core from"),
        (["forces", "--radius", "0.5", "--curves", "--na", "1e-300"], "numerical_aperture is 1e-300; allowed: 0.001"),
    ],
    ids=lambda v: " ".join(v[2:]) if isinstance(v, list) else None,
)
def test_absurd_sizes_are_one_line(
    arguments: list[str], words: str, device: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "out")] if arguments[0] == "run" else []
    assert main([*arguments, "--device", device, *out]) == 2
    *said, error = capfd.readouterr().err.splitlines()
    assert error.startswith("otwarp: ") and words in error
    # steps that rounding falsifies are warned of first, and an empty cache is told
    assert all(line.startswith(("otwarp: warning: ", "otwarp: compil")) for line in said)
    assert list(tmp_path.iterdir()) == []


def test_steps_that_no_number_holds_are_told(device: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["info", BEAD, "--time-step", "5e-324", "--device", device]) == 0
    assert "more than there are numbers" in capfd.readouterr().out


def test_run_refuses_a_folder_it_cannot_write(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("in the way")
    code = main(["run", BEAD, "--out", str(blocker / "out")])
    error = capfd.readouterr().err
    assert code == 2
    assert error.count("\n") == 1 and str(blocker) in error
    assert blocker.read_text() == "in the way"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(28, "No space left on device", "run.nc"), "run.nc: No space left on device"),
        (OSError("trajectory.usdc: could not be written"), "trajectory.usdc: could not be written"),
        (MemoryError("24 GiB"), "the memory of this machine does not suffice: 24 GiB"),
        (
            RuntimeError("Failed to allocate 8 bytes on device 'cuda:0'"),
            "the memory of the device does not suffice: Failed to allocate 8 bytes on device 'cuda:0'",
        ),
    ],
)
def test_a_full_disk_or_memory_is_one_line(
    error: Exception, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("otwarp.record.run.record_run", full)
    assert main(["run", BEAD, "--out", str(tmp_path / "out")]) == 1
    assert capfd.readouterr().err == f"otwarp: {words}\n"


def test_unknown_command_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["fly"]) == 2
    said = capfd.readouterr().err
    assert said.startswith("otwarp: No such command 'fly'; allowed: run, info, ") and said.count("\n") == 1


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["runn"], "No such command 'runn'; did you mean run?"),
        (["run", "single_bed"], "did you mean single_bead? `otwarp scenes list` names all of them"),
        (["run", "single_bead", "--resume", "nope.npz"], "cannot be read: No such file or directory; allowed: a file"),
        (["forces", "--radius", "1", "--table", "--index", "nan"], "--index is nan; allowed: real part above 0"),
    ],
)
def test_slips_name_what_was_meant(typed: list[str], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(typed) == 2
    assert said in capfd.readouterr().err


def test_validate_refuses_with_exit_code_2(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = _replaced(tmp_path, "double ot:trap:power =", "double ot:trap:powr =")
    assert main(["validate", path]) == 2
    name = "ot:trap:powr = (unknown attribute): must be a name of the vocabulary; did you mean ot:trap:power?"
    assert capfd.readouterr().err == f"error: {path}: /World/Traps/trap: {name}\n"
    assert main(["validate", str(tmp_path / "absent.usda")]) == 2
    problem = "there is no such file; a scene must be a USD"
    assert capfd.readouterr().err.startswith(f"error: {tmp_path / 'absent.usda'}: /: {problem}")


def test_a_short_row_of_points_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    points = tmp_path / "points.csv"
    points.write_text("x_um,y_um,z_um\n0,0,0\n1,2\n")
    assert main(["forces", "--radius", "1", "--points", str(points), "--out", str(tmp_path / "forces.csv")]) == 2
    words = f"otwarp: {points}: line 3 ends before column z_um; allowed: x_um, y_um, z_um\n"
    assert capfd.readouterr().err == words


SMALL_DISK = """
set -e
mkdir -p "$0" && mount -t tmpfs -o size=300k tmpfs "$0"
trap 'umount "$0"' EXIT
set +e
"$1" -m otwarp run "$2" --worlds 200 --duration 2 --device cpu --out "$0/run"; echo "run $?"; rm -rf "$0/run"
head -c 290000 /dev/zero > "$0/full"
"$1" -m otwarp preview "$2" -o "$0/bead.png"; echo "preview $?"
"$1" -m otwarp forces --radius 1 --plot "$0/force.png"; echo "forces $?"
cat /dev/zero > "$0/more" 2> /dev/null
"$1" -m otwarp run "$2" --device cpu --out "$0/run"; echo "run $?"
"$1" -m otwarp preview "$2" -o "$0/bead.png"; echo "preview $?"
ls -A "$0"
"""
"""Commands that write on a disk of 300 kB: folder, Python, scene."""


@pytest.mark.thorough
@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
def test_a_disk_that_is_really_full_is_named(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    command = ["unshare", "--mount", "bash", "-c", SMALL_DISK, str(disk), sys.executable, BEAD]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(BEAD).parents[1])
    if "mount" in done.stderr.split(":")[0] or "unshare" in done.stderr.split(":")[0]:
        pytest.skip(f"no mounting here: {done.stderr.strip()}")
    assert " ".join(done.stdout.split()) == "run 1 preview 1 forces 1 run 2 preview 2 full more"
    # the first run may have to compile
    said = itertools.dropwhile(lambda line: line.startswith("otwarp: compil"), done.stderr.splitlines())
    ran, drawn, curves, *before = said
    full = "No space left on device"
    assert str(disk / "run") in ran and full in ran
    assert f"{disk / 'bead.png'}" in drawn and full in drawn
    assert f"{disk / 'force.png'}" in curves and full in curves
    # without a word of compiling
    assert [line.partition(";")[0] for line in before] == [
        f"otwarp: --out is {disk / name}, which cannot be written ({full})" for name in ("run", "bead.png")
    ]
