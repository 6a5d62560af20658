"""How soon the driver of a device has zero force after the servo was killed (SIGKILL) or stopped (SIGSTOP).

Whole sessions (parent, servo, guardian) run at the drivers of the tests: a ROS 1 node by a double of its master and by
Debian's, a Haply service, a pseudo-terminal for a controller. The driver notes what it is told; the clock starts at the
signal. From then on the driver has real-time priority where that is allowed, below that of the guardian, so that a busy
machine does not keep the witness waiting; it is idle but for that, and beside 3 and 25 processes that compute. Linux,
with the extras of the devices; what cannot be run is left out, and said.
"""

from __future__ import annotations

import itertools
import os
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.haptics.core.realtime import schedule_threads
from tests.haptics.drivers import DRIVERS, Session

WITNESS = 60
"""Of SCHED_FIFO: of the driver, below the guardian's 70."""

BUSY = (0, 3, 25)
"""Processes that compute beside the session."""

SIGNALS = (signal.SIGKILL, signal.SIGSTOP)


@contextmanager
def punctual() -> Iterator[None]:
    """All threads of this process are scheduled before ordinary ones, where the system allows it."""
    schedule_threads(WITNESS)
    try:
        yield
    finally:
        for thread in Path("/proc/self/task").iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_OTHER, os.sched_param(0))


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes compute."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def zero_after(driver: str, what: signal.Signals) -> float:
    """Seconds from a signal to the servo of a session to the zero force that stays, as the driver heard it.

    A busy machine may have let the watchdog take the force away just then: such a session does not count.
    """
    while True:
        with (
            tempfile.TemporaryDirectory() as folder,
            pytest.MonkeyPatch.context() as environment,
            DRIVERS[driver](Path(folder), environment) as heard,
        ):
            run = Session(heard)
            try:
                with punctual():
                    since = run.signal("servo", what)
                    after = heard.falls(since)
            finally:
                run.close()
        if heard.at(since) > 0.0:
            return after


def measure(
    device: str = "cpu", *, rounds: int = 4, drivers: Sequence[str] = tuple(DRIVERS), loads: Sequence[int] = BUSY
) -> Section:
    """Each driver and each signal, `rounds` times beside each number of busy processes. No GPU takes part."""
    machine, rows, data, missing = Machine.look(pick_device(device)), [], {}, []
    for driver, count in itertools.product(drivers, loads):
        try:
            with busy(count):
                found = {what.name: [zero_after(driver, what) for _ in range(rounds)] for what in SIGNALS}
        except pytest.skip.Exception as why:
            missing.append(f"{driver}: {why}")
            continue
        data[f"{driver}, {count} busy"] = found
        for name, times in found.items():
            spans = (f"{1e3 * one(times):.0f}" for one in (min, statistics.median, max))
            rows.append((driver, str(count), name, *spans))
    return Section(
        name="guardian",
        kind="cpu",
        machine=machine,
        tables=[
            Table(
                title=f"From the signal to zero force at the driver [ms], {rounds} sessions each",
                head=("driver", "busy beside", "servo gets", "least", "median", "most"),
                rows=rows,
                note="\n".join(missing),
            )
        ],
        data=data,
    )


if __name__ == "__main__":
    command(measure, __doc__ or "", rounds=4)
