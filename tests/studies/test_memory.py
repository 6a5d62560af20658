"""Studies that do not fit into memory at once: batches that do, to the same bits."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from otwarp.studies.axes import values
from otwarp.studies.engines import memory
from otwarp.studies.observables import first_passage, trapped
from otwarp.studies.rare.study import EscapeStudy
from otwarp.studies.stopping.rules import trials
from otwarp.studies.study import Study
from tests.studies.scenes import bead_in_a_well

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return bead_in_a_well(tmp_path_factory.mktemp("well"))


def study_of(scene, count: int) -> Study:
    axes = {"trap_power": values([0.2, 1.0], unit="mW")}
    return Study(scene, axes=axes, observables=[trapped(until=0.002), first_passage()], stop=trials(count), seed=3)


def test_little_memory_gives_the_same_bits(scene, monkeypatch):
    """Room for 100 trials and for a million; batches are as large as the room, and no larger."""
    study = study_of(scene, 256)
    plenty = study.compute([0], device="cpu")[0]
    assert memory.worlds_at_once(study, "cpu") == memory.LARGEST
    each = memory.room_of(study, "cpu").each
    assert 100 < each < 10_000  # a bead and a trap: some forty numbers, three times
    batches = []
    start = type(study.runner).start
    monkeypatch.setattr(memory, "free_bytes", lambda device: int(100 * each / memory.SHARE))
    monkeypatch.setattr(
        type(study.runner), "start", lambda self, *a, **how: batches.append(len(a[2])) or start(self, *a, **how)
    )
    assert memory.worlds_at_once(study, "cpu") == 100
    little = study.compute([0], device="cpu")[0]
    assert max(batches) == 100 and sum(batches) == 512
    assert all(np.array_equal(plenty[n], little[n], equal_nan=plenty[n].dtype.kind == "f") for n in plenty)


CHILD = """
import sys
from pathlib import Path
from otwarp.studies.engines.memory import room_of
from tests.studies.test_memory import study_of

def memory(name):
    row = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(name))
    return 1024 * int(row.split()[1])

study_of(sys.argv[1], 1).compute([0], device="cpu")
study = study_of(sys.argv[1], int(sys.argv[2]))
room, before = room_of(study, "cpu"), memory("VmRSS:")
study.compute([0], device="cpu", worlds=room.worlds)
print(room.each * int(sys.argv[2]), memory("VmHWM:") - before)
"""
"""A process that says what `plan` says of as many trials, and by how much its memory grew at its highest [bytes].

VmHWM is this program's own peak; `ru_maxrss` begins at that of the process that started it.
"""

ALLOCATORS = 2**24
"""What a process takes beside its arrays: pages that were free before, threads, code."""


@pytest.mark.thorough
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is counted as Linux does")
def test_a_run_takes_what_the_plan_says(scene):
    """2^18 trials in one batch: their peak is no higher than what is said of them, and not far below."""
    line = [sys.executable, "-c", CHILD, str(scene), str(2**18)]
    said, took = map(
        int, subprocess.run(line, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()[-2:]
    )
    assert said > 4 * ALLOCATORS
    assert 0.25 * said < took < said + ALLOCATORS


def test_a_million_trials_are_bounded(scene, monkeypatch):
    """2^20 trials at a point where memory has room for some: known before any of them is made."""
    study = study_of(scene, 2**20)
    monkeypatch.setattr(memory, "free_bytes", lambda device: 2**24)
    assert 1_000 < memory.worlds_at_once(study, "cpu") < 2**15


def test_escapes_too(scene, monkeypatch):
    """Runs side by side become fewer: each needs all of its branches."""
    study = EscapeStudy(scene, runs=3, branches=64, relax=0.1, halved=False, seed=3)
    assert memory.rough_worlds(study.design.scene, "float32", "cpu") > 192
    monkeypatch.setattr(memory, "free_bytes", lambda device: 1)
    assert memory.rough_worlds(study.design.scene, "float32", "cpu") == 1


def test_free_memory_is_that_of_this_machine():
    """Above 1 MiB, and less than all there is."""
    free = memory.free_bytes("cpu")
    assert 2**20 < free < 2**50
