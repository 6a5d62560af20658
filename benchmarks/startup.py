"""How long a user waits: `import otwarp`, `otwarp --help`, and from the command to the first step of each scene."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles
from otwarp.device import pick_device
from otwarp.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
SCENES = sorted(file.stem for file in (ROOT / "scenes").glob("*.usda"))
PHASES = ("interpreter", "imports", "Warp start", "scene", "model", "kernels", "first frame", "first step")
COMMANDS = {
    "Python alone": ["-c", "pass"],
    "`import otwarp`": ["-c", "import otwarp"],
    "`otwarp --help`": ["-m", "otwarp.cli.main", "--help"],
}


def _run(arguments: list[str], cache: Path | None = None) -> tuple[float, float, str]:
    """Run Python in a fresh process: when it was asked for, when it had ended [s], and what it printed."""
    environment = dict(os.environ)
    if cache is not None:
        environment |= {"WARP_CACHE_PATH": str(cache), "CUDA_CACHE_PATH": str(cache / "cuda")}
    start = time.monotonic()
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    end = time.monotonic()
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise InputError(f"python {' '.join(arguments)} failed with exit code {done.returncode}: {reason}")
    return start, end, done.stdout


def first_step(scene: str, device: str, cache: Path) -> dict[str, float]:
    """Seconds of each phase, and of all together, from the command to the first step in a fresh process.

    And what else `benchmarks.first_step` tells.
    """
    with tempfile.TemporaryDirectory(prefix="otwarp-run-") as folder:
        start, _, text = _run(["-m", "benchmarks.first_step", f"scenes/{scene}.usda", device, folder], cache)
    marks = json.loads(text.splitlines()[-1])
    ends = [start, *(marks.pop(phase) for phase in PHASES)]
    seconds = {phase: b - a for phase, a, b in zip(PHASES, ends[:-1], ends[1:], strict=True)}
    return {**seconds, "total": ends[-1] - start, **marks}


def measure_commands(rounds: int) -> dict[str, Quartiles]:
    """Wall seconds of the commands that should cost nothing."""
    out = {}
    for name, arguments in COMMANDS.items():
        runs = [_run(arguments) for _ in range(rounds)]
        out[name] = Quartiles.of([end - start for start, end, _ in runs])
    return out


def measure_scene(scene: str, device: str, rounds: int) -> dict[str, Any]:
    """One cold run with an empty kernel cache, then `rounds` warm ones with the cache it filled."""
    with tempfile.TemporaryDirectory(prefix="otwarp-cold-") as folder:
        cold = first_step(scene, device, Path(folder))
        warm = [first_step(scene, device, Path(folder)) for _ in range(rounds)]
    return {"cold": cold, "warm": {name: Quartiles.of([run[name] for run in warm]) for name in cold}}


def memory_table(found: dict[str, Any]) -> Table:
    """Memory of the device after the first step, of fresh processes that were alone on it."""
    rows = [
        (f"`{scene}`", *(f"{f['warm'][name].median / 2**30:.3f}" for name in ("in use", "reserved")))
        for scene, f in found.items()
    ]
    head = ("scene", "in use", "of it reserved by the largest kernel")
    return Table(title="Device memory after the first step of one world [GiB]", head=head, rows=rows)


def measure(device: str = "cpu", *, scenes: Sequence[str] = SCENES, rounds: int = 3) -> Section:
    """All of it; `rounds` fresh processes behind each warm figure."""
    place = pick_device(device)
    machine = Machine.look(place)
    commands = measure_commands(rounds)
    found = {scene: measure_scene(scene, place.alias, rounds) for scene in scenes}
    rows = [
        (
            f"`{scene}`",
            f"{f['cold']['total']:.2f}",
            f"{f['cold']['kernels'] + f['cold']['first frame']:.2f}",
            f["warm"]["total"].text(".2f"),
        )
        for scene, f in found.items()
    ]
    phases = [(f"`{scene}`", *(f"{f['warm'][p].median:.3f}" for p in PHASES)) for scene, f in found.items()]
    tables = [
        Table(
            title="A fresh process, start to exit [s]",
            head=("command", "wall"),
            rows=[(name, spread.text(".3f")) for name, spread in commands.items()],
        ),
        Table(
            title="From the command to the first step [s]",
            head=("scene", "cold", "of it kernels and first frame", "warm"),
            rows=rows,
        ),
        Table(title="The warm wait by phases, medians [s]", head=("scene", *PHASES), rows=phases),
    ]
    if place.is_cuda:
        tables.append(memory_table(found))
    data = {
        "commands": {name: vars(spread) for name, spread in commands.items()},
        "scenes": {
            scene: {"cold": f["cold"], "warm": {p: vars(s) for p, s in f["warm"].items()}} for scene, f in found.items()
        },
    }
    kind = "cpu" if place.is_cpu else "cuda"
    return Section(name="startup", kind=kind, machine=machine, tables=tables, data=data)


if __name__ == "__main__":
    command(
        measure,
        "Time from a command to its first step.",
        rounds=3,
        scenes={"nargs": "+", "choices": SCENES, "default": SCENES, "help": "scenes that are started"},
    )
