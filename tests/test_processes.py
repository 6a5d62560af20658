"""Processes for tasks: what they are told first, and what is said where one of them dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.processes import worker_processes

_told: list[object] = []

UNGUARDED = """
from otwarp.processes import worker_processes
with worker_processes(2, print, (bytes(1_000_000),)) as pool:
    pool.submit(len, "four").result()
"""
ORPHANS = """
import os, time
from otwarp.processes import worker_processes
if __name__ == "__main__":
    with worker_processes(1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        pool.submit(time.sleep, 1000)
        time.sleep(1000)
"""


def _begin(*told: object) -> None:
    _told.extend(told)


def _sum(extra: int) -> int:
    return sum(len(part) for part in _told if isinstance(part, bytes)) + extra


def test_processes_begin_with_what_they_are_given() -> None:
    with worker_processes(2, _begin, (bytes(10), bytes(200_000))) as pool:
        assert [pool.submit(_sum, n).result() for n in range(4)] == [200_010 + n for n in range(4)]


def test_one_that_is_killed_is_told() -> None:
    with (
        pytest.raises(InputError, match="one of 2 processes ended before its work was done"),
        worker_processes(2) as pool,
    ):
        os.kill(pool.submit(os.getpid).result(), signal.SIGKILL)
        pool.submit(time.sleep, 0.1).result()


def test_they_end_in_the_middle_of_a_task_where_something_is_wrong() -> None:
    class Stopped(Exception):
        pass

    begun = time.monotonic()
    with pytest.raises(Stopped), worker_processes(1) as pool:
        pool.submit(os.getpid).result()
        pool.submit(time.sleep, 600.0)
        raise Stopped
    assert time.monotonic() - begun < 300.0


def test_a_script_without_a_guard_is_told(tmp_path: Path) -> None:
    """Its processes begin it again and die, before they have read a megabyte: once that waited for ever."""
    script = tmp_path / "unguarded.py"
    script.write_text(UNGUARDED)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert 'in a script, calls under if __name__ == "__main__":' in done.stderr.splitlines()[-1]


def test_they_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "orphans.py"
    script.write_text(ORPHANS)
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    for _ in range(600):
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{child}/stat").read_text().split(")")[-1].split()[0] == "Z":
            return  # of whoever adopts orphans here
        time.sleep(0.1)
    pytest.fail(f"process {child} outlives its parent")
