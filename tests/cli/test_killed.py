"""A run that is killed at its work: its checkpoint is that of its beginning or of its end, and goes on bit for bit."""

from __future__ import annotations

import dataclasses
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from otwarp.scene import Scene
from tests.simulation.test_checkpoint import authored
from tests.simulation.test_determinism import crowd_scene

HALF, WHOLE = "0.5", "4"
"""Durations of the first run and of both [s]."""


def spread_crowd() -> Scene:
    """The heap of the crowd, with gaps between its cells."""
    heap = crowd_scene()
    spread = (dataclasses.replace(b, position=tuple(1.1 * np.array(b.position))) for b in heap.bodies)
    return dataclasses.replace(heap, bodies=tuple(spread))


def command(scene: Path, out: Path, duration: str, checkpoint: Path, *more: str) -> list[str]:
    """A run of many bodies on a CPU, where threads share out its worlds."""
    to = ["-o", str(out), "--duration", duration, "--fps", "20", "--checkpoint", str(checkpoint), "--device", "cpu"]
    return [sys.executable, "-m", "otwarp", "run", str(scene), *to, *more]


def arrays(checkpoint: Path) -> dict[str, np.ndarray]:
    """All numbers of a checkpoint."""
    with np.load(checkpoint, allow_pickle=False) as data:
        return {name: data[name] for name in data.files if data[name].dtype.kind in "fiu"}


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    """Bit for bit."""
    return one.keys() == other.keys() and all(a.tobytes() == other[name].tobytes() for name, a in one.items())


@pytest.mark.cpu_forms
def test_a_killed_run_of_many_bodies_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    authored(spread_crowd(), scene := tmp_path / "crowd.usda")
    first, last, ours = (tmp_path / f"{name}.npz" for name in ("first", "last", "ours"))
    subprocess.run(command(scene, tmp_path / "a", HALF, first, "--worlds", "3"), check=True, capture_output=True)
    again = ("--resume", str(first))
    subprocess.run(command(scene, tmp_path / "b", WHOLE, last, *again), check=True, capture_output=True)
    begun, ended = arrays(first), arrays(last)
    assert not same(begun, ended)
    for delay in (0.0, 0.05, 0.3):
        shutil.copy(first, ours)
        out = tmp_path / f"killed{delay}"
        with subprocess.Popen(
            command(scene, out, WHOLE, ours, "--resume", str(ours)),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as run:
            while not (out / "run.nc").exists() and run.poll() is None:
                time.sleep(0.01)
            time.sleep(delay)
            run.kill()
        assert (out / "run.nc").exists()
        assert same(arrays(ours), begun) or same(arrays(ours), ended)
    subprocess.run(command(scene, tmp_path / "c", WHOLE, ours, "--resume", str(ours)), check=True, capture_output=True)
    assert same(arrays(ours), ended)
