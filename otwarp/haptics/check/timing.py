"""How punctual a loop of this machine is, and how late its forces are.

Jitter: period and lateness of an empty loop, idle and beside busy processes. It runs in a fresh interpreter, as the
servo does, with what `realtime.request_realtime` got there. Latency: how long a force takes in the real servo process,
from a sample of the device and from a state of the simulation. The chain of that process keeps the times itself and
writes them down when it has enough: nothing stands in the loop that would not be there otherwise, but a look at the
clock.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain, within
from otwarp.haptics.core import DeviceInfo, DeviceSample, SceneFrame, ServoFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import TOUCH_CHAIN, TOUCH_SAFETY, HandConfig
from otwarp.haptics.core.realtime import Clock, Grant, RealClock, next_deadline, request_realtime
from otwarp.haptics.force import Code, local_model
from otwarp.haptics.force.law import IsotropicLaw
from otwarp.haptics.servo.link import HandSetup
from otwarp.haptics.servo.process import ServoProcess
from otwarp.laws import TrapLaw

LONGEST = 3600.0
FASTEST = 20_000.0
_START_UP = 30.0
"""Seconds that a fresh interpreter may take on a busy machine."""
_BUSY = "while time.time() < end: sum(range(1000))"

SHORTEST = 0.05
"""Seconds of a measurement of latency: less has too few states."""

STATE_RATE = 120.0
"""States of the simulation per second, as the live loop publishes them."""

SPHERES, TRAPS, POWER = 10, 3, 20.0
"""Of the scene that is rendered: two robots of five elements, three traps of one hand, 20 mW each."""

CURVE = TrapLaw(stiffness=0.6, threshold=0.6, inverse_square=0.17, offset=-0.1122, cutoff=1.2, power=1.0)
"""Per mW; its values do not matter for times."""

VIRTUAL = "virtual:circle,radius=0.003,period=1"
"""The hand of the measurement: within reach of the curve all the time."""

SETTLING = 100
"""First cycles that do not count: pages are touched and caches filled in them."""

DEADLINE = 10.0
"""Seconds that the servo may take longer than the measurement lasts."""


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
        loop = _start(stack, "from otwarp.haptics.check.timing import _child; _child()")
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


def check_scene(beat: int, now: float, *, spheres: int = SPHERES, traps: int = TRAPS) -> SceneFrame:
    """A state with all spheres within reach of all traps, published at `now` [s]."""
    balls = tuple(SphereFrame((0.1 * i, 0.0, 0.0), i // 5) for i in range(spheres))
    foci = tuple(TrapFrame(i, (0.05 * i, 0.1, 0.0), POWER) for i in range(traps))
    return SceneFrame(beat, now, balls, foci)


def check_hand() -> HandConfig:
    """The hand of the measurements: the Touch's preset with `TRAPS` traps."""
    return HandConfig(traps=tuple(range(TRAPS)), chain=TOUCH_CHAIN, safety=TOUCH_SAFETY)


class TimedChain(Chain):
    """A chain that keeps how late its force is, and writes it to a file once.

    Args:
        file: Takes `{"sample": [...], "state": [...], "fresh": n, "cycles": n}` in seconds.
        cycles: After how many, the first `SETTLING` not counted.
        config, info: Of the hand and the device.
        code: Of the law, None for plain Python.
    """

    def __init__(self, file: str, cycles: int, config: HandConfig, info: DeviceInfo, *, code: Code | None = None):
        config = replace(config, safety=within(config.safety, info))
        super().__init__(config, local_model(config, {i: (IsotropicLaw(CURVE),) for i in config.traps}, code=code))
        self._file, self._cycles = file, cycles
        self._samples, self._states = array("d"), array("d")
        self._steps = self._fresh = 0
        self._seen = 0

    def step(self, sample: DeviceSample, scene: SceneFrame) -> ServoFrame:
        """See `Chain.step`."""
        state = super().step(sample, scene)
        now = time.perf_counter()
        self._steps += 1
        if SETTLING < self._steps <= SETTLING + self._cycles:
            self._samples.append(now - sample.time)
            self._fresh += sample.fresh
            if scene.beat != self._seen:
                self._states.append(now - scene.time)
        elif self._steps == SETTLING + self._cycles + 1:
            self._tell()
        self._seen = scene.beat
        return state

    def _tell(self) -> None:
        found = {"sample": list(self._samples), "state": list(self._states)}
        part = Path(self._file + ".part")
        part.write_text(json.dumps(found | {"fresh": self._fresh, "cycles": len(self._samples)}))
        part.rename(self._file)


@dataclass(frozen=True, slots=True)
class ServoLatency:
    """Times in the servo process.

    Attributes:
        device: That was read and written.
        cycles: Measured.
        sample: From the time of a sample, of a virtual device the start of its cycle, to the force for it [s].
        state: From a state of the simulation, just before it is published, to the first force that knows it [s]. Up to
            a servo period of it is waiting for the next cycle.
        late: Deadlines that were dropped.
        fresh: Part of the cycles in which the device had a new word [1].
        armed: Whether the hand was armed, as only a virtual one is.
    """

    device: str
    cycles: int
    sample: Percentiles
    state: Percentiles
    late: int
    fresh: float
    armed: bool


def measure_latency(
    seconds: float = 3.0, *, device: str = VIRTUAL, rate: float = 1000.0, code: Code | None = None
) -> ServoLatency:
    """Run the servo for a moment and say how late its forces are.

    Args:
        seconds: How long [s], 0.05 to 3600.
        device: See `otwarp.haptics.devices`. A device other than a virtual one is read and gets zero force: it is not
            armed.
        rate: Cycles per second [Hz].
        code: Of the force law, None for plain Python.

    Raises:
        InputError: A number out of range, a device that is not there or went away, or a servo that ended.
    """
    if not SHORTEST <= seconds <= LONGEST:
        raise InputError(f"seconds = {seconds!r}: must be from {SHORTEST:g} to {LONGEST:g}")
    armed = device.partition(":")[0].strip() == "virtual"
    cycles = round(seconds * rate)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "times.json"
        hand = HandSetup(device, partial(TimedChain, str(file), cycles, check_hand(), code=code))
        with ServoProcess([hand], spheres=SPHERES, traps=TRAPS, rate=rate) as servo:
            late = _feed(servo, file, seconds, armed)
        found = json.loads(file.read_text())
    return ServoLatency(
        device=device,
        cycles=found["cycles"],
        sample=Percentiles.of(found["sample"]),
        state=Percentiles.of(found["state"]),
        late=late,
        fresh=found["fresh"] / found["cycles"],
        armed=armed,
    )


def _feed(servo: ServoProcess, file: Path, seconds: float, armed: bool) -> int:
    """Publish states until the times are there; deadlines that the servo dropped meanwhile."""
    begun, beat = time.perf_counter(), 0
    first = servo.status()
    while not file.exists():
        beat += 1
        servo.publish(check_scene(beat, time.perf_counter()))
        if armed and beat == 10:
            servo.arm()
        status = servo.status()
        if status is not None and not status.hands[0].present:
            raise InputError(status.hands[0].message or "the device went away")
        if not servo.alive or time.perf_counter() - begun > seconds + DEADLINE:
            raise InputError("servo: it ended, or reported no times, before the measurement was over")
        time.sleep(1.0 / STATE_RATE)
    last = servo.status()
    return (last.late if last else 0) - (first.late if first else 0)
