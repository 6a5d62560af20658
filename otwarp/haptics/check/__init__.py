"""What `otwarp haptics check` measures, and what bounds the force that an operator feels.

`run_check` here puts it together: devices, what the system grants, costs of calls, and of the files beside it (open
`zwidth` first):

timing    jitter of a loop, latency of a force in the servo process
zwidth    the stiffest wall that a chain renders on a bare device
fidelity  the force that a chain renders while a hand sweeps through a trap, beside the model's
"""

from __future__ import annotations

import gc
import math
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.check.timing import (
    CURVE,
    FASTEST,
    LONGEST,
    SHORTEST,
    TRAPS,
    VIRTUAL,
    Jitter,
    Percentiles,
    ServoLatency,
    check_hand,
    check_scene,
    measure_jitter,
    measure_latency,
)
from otwarp.haptics.check.zwidth import FeltLimit, Width, limits, widths
from otwarp.haptics.core import DeviceSample, ServoFrame
from otwarp.haptics.core.config import PAPER_CHAIN, CouplingConfig, HandConfig, LowPass
from otwarp.haptics.core.realtime import Grant
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices import KINDS, Kind, parse_devices
from otwarp.haptics.force import Code, local_model
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw
from otwarp.haptics.servo.link import HandLayout, SceneLayout, SceneReader

BUSY = 2
"""Processes that compute beside the loop in its loaded measurement."""

Progress = Callable[[str], None]

ADVICE = {
    "SCHED_FIFO": "in /etc/security/limits.d/95-otwarp.conf: `@realtime - rtprio 95`, yourself in the group realtime, "
    "and a new login; in a container: --ulimit rtprio=95",
    "nice": "in /etc/security/limits.d/95-otwarp.conf: `@realtime - rtprio 95` and `@realtime - nice -20`, yourself in "
    "the group realtime, and a new login; in a container: --cap-add=SYS_NICE, or --ulimit rtprio=95",
    "locked memory": "in /etc/security/limits.d/95-otwarp.conf: `@realtime - memlock unlimited`, yourself in the group "
    "realtime, and a new login; in a container: --ulimit memlock=-1",
    "timer slack": "nothing: the system has no call for it, or forbids it",
    "affinity": "name a core that this process may use",
    "priority class": "start it as administrator",
    "timer period": "nothing is known to help",
}
"""What a user can do about a grant that was refused, by `Grant.what`."""

STEPS = 2000
"""Steps that are timed."""

BOX_SPHERES, BOX_TRAPS = 16, 6
"""Capacity of the mailbox that is timed, full."""

PERIOD = 1e-3

CHECKED: dict[int, tuple[Law, ...]] = {0: (IsotropicLaw(CURVE), SplitLaw(CURVE, CURVE))}
"""The laws whose cost is measured, as those of a trap."""


@dataclass(frozen=True, slots=True)
class CallCost:
    """Time of one call.

    Attributes:
        what: Was called.
        time: [s].
    """

    what: str
    time: Percentiles


@contextmanager
def _no_collection():
    """As in the servo: no garbage collection meanwhile."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


def time_calls(call: Callable[[int], object], count: int) -> Percentiles:
    """Percentiles of the times of `call(0)` … `call(count − 1)` [s].

    Raises:
        InputError: No calls.
    """
    if count < 1:
        raise InputError(f"count = {count!r}: must be 1 or more")
    found = []
    with _no_collection():
        for n in range(count):
            begun = time.perf_counter()
            call(n)
            found.append(time.perf_counter() - begun)
    return Percentiles.of(found)


Compiler = Callable[[Mapping[int, Sequence[Law]]], tuple[Code | None, str]]
"""Compiles laws of traps, or says why the law in Python must do, see `otwarp.teleop.operators.servo.compile_laws`."""


def step_cost(*chains: Chain, steps: int = STEPS) -> Percentiles:
    """Time of a step of all chains [s] while the hands go round within reach of all spheres.

    A new state comes every eighth period.
    """
    for chain in chains:
        chain.arm()
    samples = [
        DeviceSample(n * PERIOD, (0.003 * math.cos(0.006 * n), 0.003 * math.sin(0.006 * n), 0.0)) for n in range(steps)
    ]
    scenes = [check_scene(n // 8 + 1, n // 8 * 8 * PERIOD) for n in range(steps)]
    return time_calls(lambda n: [chain.step(samples[n], scenes[n]) for chain in chains], steps)


def law_costs(
    what: str, config: HandConfig, law: Law, code: Code | None, *, hands: int = 1, steps: int = STEPS
) -> list[CallCost]:
    """Steps of chains that feel a law on every trap: compiled, if there is code, and in Python."""
    laws, found = {i: (law,) for i in config.traps}, []
    for one, name in ((code, "compiled"), (None, "in Python")):
        if one is not None or name == "in Python":
            chains = [Chain(config, local_model(config, laws, code=one)) for _ in range(hands)]
            found.append(CallCost(f"step: {what}, {name}", step_cost(*chains, steps=steps)))
    return found


def chain_costs(steps: int = STEPS, code: Code | None = None) -> tuple[CallCost, ...]:
    """Steps of the chains that a session may use, with 10 spheres and 3 traps, all in reach of each other.

    Args:
        steps: That are timed.
        code: Compiled, of `CHECKED`.
    """
    plain = check_hand()
    low = LowPass(alpha=0.5, rate=1000.0)
    filters = replace(
        plain,
        chain=replace(
            plain.chain, motion_filter=low, force_filter=low, pose_filter=low, coupling=CouplingConfig(), damping=0.5
        ),
    )
    (iso, split), paper = CHECKED[0], replace(plain, chain=PAPER_CHAIN)
    return (
        *law_costs("stable, eq. 1 in all directions", plain, iso, code, steps=steps),
        *law_costs("stable, radial and axial curve", plain, split, code, steps=steps),
        *law_costs("stable, all filters and coupling", filters, iso, code, steps=steps),
        *law_costs("paper", paper, iso, None, steps=steps),
    )


def mailbox_costs(count: int = STEPS) -> tuple[CallCost, ...]:
    """Publishing and taking states and hands."""
    scenes = [check_scene(n + 1, 0.0, spheres=BOX_SPHERES, traps=BOX_TRAPS) for n in range(count)]
    box = Mailbox.create(SceneLayout(BOX_SPHERES, BOX_TRAPS))
    other = Mailbox.create(HandLayout(TRAPS))
    try:
        reader = SceneReader(box)
        write = time_calls(lambda n: box.write(scenes[n]), count)
        found = []
        with _no_collection():
            for scene in scenes:
                box.write(scene)
                begun = time.perf_counter()
                reader.latest()
                found.append(time.perf_counter() - begun)
        none = time_calls(lambda n: reader.latest(), count)
        traps = tuple((i, (0.0, 0.0, 0.0)) for i in range(TRAPS))
        hand = ServoFrame(1, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), traps, "armed", 0.0)
        tell = time_calls(lambda n: other.write(hand), count)
    finally:
        box.close()
        other.close()
    size = f"{BOX_SPHERES} spheres, {BOX_TRAPS} traps"
    return (
        CallCost(f"mailbox: publish a state ({size})", write),
        CallCost("mailbox: take a new state", Percentiles.of(found)),
        CallCost("mailbox: see that there is none", none),
        CallCost(f"mailbox: publish a hand ({TRAPS} traps)", tell),
    )


@dataclass(frozen=True, slots=True)
class FoundDevices:
    """What there is of one kind of device.

    Attributes:
        kind: Row of `KINDS`.
        software: Whether it is made by software, and so always there.
        found: A line for each that is there; it begins with what to type after `--left`.
        trouble: Why none could be looked for, or "".
    """

    kind: str
    software: bool
    found: tuple[str, ...]
    trouble: str


def find_all_devices(kinds: Mapping[str, Kind] = KINDS, progress: Progress = lambda line: None) -> list[FoundDevices]:
    """Ask every kind of device what is there.

    A package or library that is absent is no error here: it is what the user wants to know.
    """
    found = []
    for name, kind in kinds.items():
        progress(f"looking for {name}")
        look = None
        try:
            look = getattr(import_module(kind.home.split(":")[0]), "find_devices", None)
            lines = tuple(look()) if look is not None else ()
            found.append(FoundDevices(name, look is None, lines, ""))
        except InputError as error:
            found.append(FoundDevices(name, False, (), str(error)))
        except Exception as error:  # whatever a driver's library raises, the other kinds are still of interest
            found.append(FoundDevices(name, False, (), f"{type(error).__name__}: {error}"))
    return found


@dataclass(frozen=True, slots=True)
class Advised:
    """A grant, and what can be done where it was refused."""

    grant: Grant
    advice: str


def advised(grants: tuple[Grant, ...]) -> list[Advised]:
    """Grants with advice: a nice value in place of SCHED_FIFO is half a grant and gets it too."""
    return [Advised(g, "" if g.granted and g.what != "nice" else ADVICE.get(g.what, "")) for g in grants]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """All that was found.

    Attributes:
        system: Operating system, release, machine, Python, and whether the kernel is a real-time one.
        devices: By kind.
        grants: What the system gave to a servo.
        jitter: Of an empty loop: idle, and beside `BUSY` processes.
        latency: In the servo process; None where it could not be measured, see `trouble`.
        costs: Of steps and mailboxes.
        widths: Z-width.
        limits: What bounds what is felt.
        trouble: What could not be measured, and why.
        scene: What a scene costs, if one was given; see the command.
        page: How long a state takes to the page, if it was measured; see the command.
        law: What computes the force on hands here: `compiled`, or `in Python` and why.
    """

    system: str
    devices: list[FoundDevices]
    grants: list[Advised]
    jitter: list[Jitter]
    latency: ServoLatency | None
    costs: list[CallCost]
    widths: list[Width]
    limits: list[FeltLimit]
    trouble: list[str]
    scene: dict[str, Any] | None = None
    page: dict[str, Any] | None = None
    law: str = ""

    def json(self) -> dict[str, Any]:
        """For a program; times in seconds."""
        return asdict(self)


def system_text() -> str:
    """Operating system and Python in a line."""
    kernel = platform.uname()
    realtime = ", real-time kernel" if "PREEMPT_RT" in kernel.version else ""
    return f"{kernel.system} {kernel.release} {kernel.machine}{realtime}, Python {platform.python_version()}"


def check_numbers(seconds: float, rate: float) -> None:
    """See that `run_check` can use its numbers.

    Raises:
        InputError: One is out of range.
    """
    if not 1.0 <= rate <= FASTEST:
        raise InputError(f"rate = {rate!r}: must be from 1 to {FASTEST:g} Hz")
    low = max(SHORTEST, 1.0 / rate)
    if not low <= seconds <= LONGEST:
        raise InputError(f"seconds = {seconds!r}: must be from {low:g} to {LONGEST:g} s")


def run_check(
    seconds: float = 3.0,
    *,
    device: str = VIRTUAL,
    rate: float = 1000.0,
    width: bool = True,
    steps: int = STEPS,
    progress: Progress = lambda line: None,
    compiler: Compiler = lambda laws: (None, "in Python"),
) -> Check:
    """Look for devices and measure; takes four times `seconds`, and some 15 s for the Z-width.

    Args:
        seconds: Length of each measurement with a clock [s].
        device: For the latency; it is read and written, and armed only if it is virtual.
        rate: Of the servo [Hz].
        width: Whether to compute the table of Z-widths, which is the same on every machine.
        steps: Steps that are timed for each cost.
        progress: Called with a line before each part.
        compiler: Of force laws; by default they are measured in Python.

    Raises:
        InputError: A number out of range, or a `device` that is not there.
    """
    check_numbers(seconds, rate)  # what is bad is an error before anything is looked for or measured
    parse_devices([device])
    progress(f"latency in the servo process, {device}")  # first: a device that is not there is an error at once
    code, law = compiler(CHECKED)
    latency, trouble = None, []
    try:
        latency = measure_latency(seconds, device=device, rate=rate, code=code)
    except InputError as error:
        if device != VIRTUAL:
            raise
        trouble.append(f"latency: {error}")
    devices = find_all_devices(progress=progress)
    progress("loop jitter, idle")
    idle = measure_jitter(seconds, rate)
    progress(f"loop jitter, beside {BUSY} busy processes")
    loaded = measure_jitter(seconds, rate, busy=BUSY)
    progress("cost of a step and of the mailboxes")
    costs = [*chain_costs(steps, code), *mailbox_costs(steps)]
    return Check(
        system=system_text(),
        devices=devices,
        grants=advised(idle.grants),
        jitter=[idle, loaded],
        latency=latency,
        costs=costs,
        widths=list(widths(progress)) if width else [],
        limits=list(limits()),
        trouble=trouble,
        law=law,
    )
