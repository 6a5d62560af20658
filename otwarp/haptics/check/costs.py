"""What a step of a chain and the mailboxes cost, in this process, without waiting."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, replace

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.check.jitter import Percentiles
from otwarp.haptics.check.latency import CURVE, TRAPS, check_hand, check_scene
from otwarp.haptics.core.config import CouplingConfig, HandConfig, LowPass
from otwarp.haptics.core.presets import PAPER_CHAIN
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.core.types import DeviceSample, ServoFrame
from otwarp.haptics.force.law import IsotropicLaw, SplitLaw, local_model
from otwarp.haptics.servo.link import HandLayout, SceneLayout, SceneReader

STEPS = 2000
"""Steps that are timed."""

BOX_SPHERES, BOX_TRAPS = 16, 6
"""Capacity of the mailbox that is timed, full."""

PERIOD = 1e-3


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


def step_cost(chain: Chain, steps: int = STEPS) -> Percentiles:
    """Time of a step [s] while the hand goes round within reach of all spheres; a new state every eighth period."""
    chain.arm()
    samples = [
        DeviceSample(n * PERIOD, (0.003 * math.cos(0.006 * n), 0.003 * math.sin(0.006 * n), 0.0)) for n in range(steps)
    ]
    scenes = [check_scene(n // 8 + 1, n // 8 * 8 * PERIOD) for n in range(steps)]
    return time_calls(lambda n: chain.step(samples[n], scenes[n]), steps)


def chain_costs(steps: int = STEPS) -> tuple[CallCost, ...]:
    """Steps of the chains that a session may use, with 10 spheres and 3 traps, all in reach of each other."""
    plain = check_hand()
    low = LowPass(alpha=0.5, rate=1000.0)
    filters = replace(
        plain,
        chain=replace(
            plain.chain, motion_filter=low, force_filter=low, pose_filter=low, coupling=CouplingConfig(), damping=0.5
        ),
    )
    paper = replace(plain, chain=PAPER_CHAIN)
    iso, split = IsotropicLaw(CURVE), SplitLaw(CURVE, CURVE)
    cases: tuple[tuple[str, HandConfig, IsotropicLaw | SplitLaw], ...] = (
        ("stable, eq. 1 in all directions", plain, iso),
        ("stable, radial and axial curve", plain, split),
        ("stable, all filters and coupling", filters, iso),
        ("paper", paper, iso),
    )
    return tuple(
        CallCost(f"step: {what}", step_cost(Chain(c, local_model(c, {i: (law,) for i in c.traps})), steps))
        for what, c, law in cases
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
