"""How punctual a loop of this machine is: its period and its lateness, idle and beside a busy process.

The loop runs in a fresh interpreter, as the servo does, with what `platform.request_realtime` got there.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from otwarp.errors import InputError
from otwarp.haptics.core.realtime import Clock, Grant, RealClock, next_deadline, request_realtime

if TYPE_CHECKING:
    from rich.table import Table

LONGEST = 3600.0
FASTEST = 20_000.0
_START_UP = 30.0
"""Seconds that a fresh interpreter may take on a busy machine."""


@dataclass(frozen=True, slots=True)
class Percentiles:
    """How a time was spread over the cycles of a loop [s]: median, 99 %, 99.9 %, largest."""

    p50: float
    p99: float
    p999: float
    max: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Percentiles:
        """Percentiles of `values` by the nearest rank."""
        ordered = sorted(values)
        p50, p99, p999 = (ordered[math.ceil(q * len(ordered)) - 1] for q in (0.5, 0.99, 0.999))
        return cls(p50, p99, p999, ordered[-1])


@dataclass(frozen=True, slots=True)
class Jitter:
    """What was measured.

    Attributes:
        rate: Cycles asked for per second [Hz].
        cycles: Cycles measured.
        busy: Processes that computed beside it.
        spin: Last part of each wait that was not slept [s].
        period: From one wake to the next [s].
        lateness: From a deadline to the wake [s].
        skipped: Deadlines that passed before the loop could wait for them.
        grants: What the operating system gave.
    """

    rate: float
    cycles: int
    busy: int
    spin: float
    period: Percentiles
    lateness: Percentiles
    skipped: int
    grants: tuple[Grant, ...]


def loop_times(
    clock: Clock, rate: float, cycles: int, work: Callable[[], None] | None = None
) -> tuple[list[float], list[float], int]:
    """Periods [s], latenesses [s] and skipped deadlines of a loop on a grid of deadlines, as the servo keeps it."""
    step = 1.0 / rate
    periods, latenesses, skipped = [], [], 0
    deadline = last = clock.now()
    for _ in range(cycles):
        deadline, missed = next_deadline(deadline, step, clock.now())
        skipped += missed
        clock.sleep_until(deadline)
        now = clock.now()
        periods.append(now - last)
        latenesses.append(now - deadline)
        last = now
        if work is not None:
            work()
    return periods, latenesses, skipped


def measure_jitter(
    seconds: float = 5.0, rate: float = 1000.0, *, busy: int = 0, spin: float = 0.0, realtime: bool = True
) -> Jitter:
    """Run an empty loop in a process of its own and say how punctual it was.

    Args:
        seconds: How long [s].
        rate: Cycles per second [Hz].
        busy: How many processes compute beside it meanwhile; they end by themselves.
        spin: See `clock.RealClock` [s].
        realtime: Whether to ask for what a servo asks for.

    Raises:
        InputError: An argument out of range, or the process failed.
    """
    for name, value, low, high in (
        ("seconds", seconds, 1.0 / rate if rate > 0 else 0.0, LONGEST),
        ("rate", rate, 1.0, FASTEST),
        ("busy", busy, 0, 1024),
        ("spin", spin, 0.0, 1.0 / rate if rate > 0 else 0.0),
    ):
        if not low <= value <= high:
            raise InputError(f"{name} = {value!r}: must be from {low:g} to {high:g}")
    order = json.dumps({"seconds": seconds, "rate": rate, "spin": spin, "realtime": realtime})
    with ExitStack() as stack:
        for _ in range(busy):
            _start(stack, f"import time\nend = time.time() + {seconds + _START_UP!r}\n{_BUSY}")
        loop = _start(stack, "from otwarp.haptics.check.jitter import _child; _child()")
        answer, _ = loop.communicate(order.encode())
    if loop.returncode:
        raise InputError(f"jitter loop at {rate:g} Hz for {seconds:g} s: its process ended with {loop.returncode}")
    found = json.loads(answer)
    return Jitter(
        rate=rate,
        cycles=found["cycles"],
        busy=busy,
        spin=spin,
        period=Percentiles(**found["period"]),
        lateness=Percentiles(**found["lateness"]),
        skipped=found["skipped"],
        grants=tuple(Grant(**grant) for grant in found["grants"]),
    )


_BUSY = "while time.time() < end: sum(range(1000))"


def _start(stack: ExitStack, code: str) -> subprocess.Popen[bytes]:
    """A fresh interpreter that ends with the stack, however that is left."""
    with _interrupts_wait():  # none comes before the stack knows of it
        process = stack.enter_context(_python(code))
        stack.callback(process.wait)
        stack.callback(process.kill)  # the last is called first
    return process


def _python(code: str) -> subprocess.Popen[bytes]:
    """A fresh interpreter; a terminal sends Ctrl-C to all processes, and its parent shall end it, with one line."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, "-c", f"import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n{code}"]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Ctrl-C is held back meanwhile; a process that is started then begins with it held back, where systems can."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _child() -> None:
    """The process that measures: its order on stdin, its answer on stdout."""
    import gc

    order = json.loads(sys.stdin.read())
    gc.disable()
    grants = request_realtime() if order["realtime"] else ()
    cycles = max(1, round(order["seconds"] * order["rate"]))
    periods, latenesses, skipped = loop_times(RealClock(order["spin"]), order["rate"], cycles)
    answer = {
        "cycles": cycles,
        "period": asdict(Percentiles.of(periods)),
        "lateness": asdict(Percentiles.of(latenesses)),
        "skipped": skipped,
        "grants": [asdict(grant) for grant in grants],
    }
    print(json.dumps(answer))


def jitter_table(measured: Sequence[Jitter]) -> Table:
    """A table to print: one row per measurement, times in µs."""
    from rich.table import Table

    table = Table(title="Loop jitter [µs]")
    for column in ("rate [Hz]", "beside", "spin", "what", "p50", "p99", "p99.9", "max", "skipped", "granted"):
        table.add_column(column, justify="left" if column in ("beside", "what", "granted") else "right")
    for one in measured:
        beside = f"{one.busy} busy" if one.busy else "idle"
        granted = ", ".join(f"{g.what} {g.detail}" for g in one.grants if g.granted) or "nothing"
        front = (f"{one.rate:g}", beside, f"{1e6 * one.spin:g}")
        for what, spread in (("period", one.period), ("lateness", one.lateness)):
            numbers = (f"{1e6 * v:.0f}" for v in (spread.p50, spread.p99, spread.p999, spread.max))
            ends = (str(one.skipped), granted) if what == "period" else ("", "")
            table.add_row(*(front if what == "period" else ("", "", "")), what, *numbers, *ends)
    return table
