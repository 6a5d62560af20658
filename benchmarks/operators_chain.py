"""What a servo period of one hand costs: in the servo's chain, in Python or with its laws compiled, and in batches.

For `benchmarks.operators`. All chains are the hands of the shipped cell delivery, three traps and ten spheres each, and
are given the same: hands that move a millimetre to and fro, and a state every eighth period.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from otwarp.bench.report import Table
from otwarp.bench.timing import Quartiles, elapsed
from otwarp.haptics.chain.chain import Chain, make_chain
from otwarp.haptics.core import DeviceInfo, DeviceSample, SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.force.compiled import CompiledLaw
from otwarp.operators.chain import ChainBatch
from otwarp.scene import Scene
from otwarp.simulation.model import Model
from otwarp.teleop import vec3
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands
from otwarp.teleop.operators.servo import compile_laws

SCENE = Path(__file__).parent.parent / "scenes" / "cell_delivery.usda"
DEVICE = DeviceInfo(name="virtual", kind="virtual", force=3.3, continuous_force=0.88)
WORLDS = {"cpu": (64, 1024), "cuda": (1024, 16_384)}
PERIOD, STATE, PERIODS = 1e-3, 8, 400
"""Servo period [s], periods between two states, and periods in a measurement."""
REACH = 5e-4
"""Amplitude of each of a hand's three sines [m]: 0.05 µm at its traps, so that they keep their spheres."""
POWER = 20.0
"""Of every trap [mW]."""


class Given:
    """What all chains are given.

    Attributes:
        local: What hands feel.
        traps, spheres: Places in the only state [µm].
    """

    def __init__(self) -> None:
        self.scene = Scene.load(SCENE)
        self.local = LocalScene.of(Model.build(self.scene, device="cpu"), range(len(self.scene.traps)))
        rng = np.random.default_rng(4)
        self.traps = np.array([trap.position.at(0.0) for trap in self.scene.traps])
        hold = np.arange(len(self.local.kinds)) % len(self.traps)
        self.spheres = self.traps[hold] + rng.normal(0.0, 0.1, (len(hold), 3))
        self._frequency, self._phase = rng.uniform(0.5, 5.0, (2, 3)), rng.uniform(0.0, 2.0 * np.pi, (2, 3))

    def hands(self, n: int) -> np.ndarray:
        """(2, 3) where both devices are in period n [m]."""
        return REACH * np.sin(2.0 * np.pi * self._frequency * PERIOD * n + self._phase)

    def samples(self, n: int) -> list[DeviceSample]:
        """What both devices say in period n."""
        return [DeviceSample(PERIOD * n, vec3(place), 1) for place in self.hands(n)]

    def frame(self, n: int) -> SceneFrame:
        """The state that is the newest in period n."""
        spheres = zip(self.spheres, self.local.bodies, strict=True)
        return SceneFrame(
            1 + n // STATE,
            PERIOD * (n - n % STATE),
            tuple(SphereFrame(vec3(place), body) for place, body in spheres),
            tuple(TrapFrame(t, vec3(place), POWER) for t, place in enumerate(self.traps)),
        )


def chains_of(given: Given, plans: tuple[HandPlan, ...], code: CompiledLaw | None) -> list[Chain]:
    """The servo's own chains, armed."""
    laws, kinds = given.local.laws, given.local.kinds
    chains = [make_chain(p.config, {t: laws[t] for t in p.config.traps}, kinds, DEVICE, code=code) for p in plans]
    for chain in chains:
        chain.arm()
    return chains


def in_servo(given: Given, plans: tuple[HandPlan, ...], code: CompiledLaw | None) -> Callable[[], object]:
    """`PERIODS` periods of the servo's own chains."""
    chains = chains_of(given, plans, code)
    frames = [given.frame(n) for n in range(PERIODS)]
    steps = [
        (chain, sample, frame)
        for n, frame in enumerate(frames)
        for chain, sample in zip(chains, given.samples(n), strict=True)
    ]
    return lambda: [chain.step(sample, frame) for chain, sample, frame in steps]


def batch_of(given: Given, plans: tuple[HandPlan, ...], worlds: int, device: wp.Device) -> ChainBatch:
    """The same chains in many worlds, armed, with the state in their arrays."""
    batch = ChainBatch(plans, given.local, worlds, device=device, infos=[DEVICE] * len(plans), traps=len(given.traps))
    batch.trap.assign(np.tile(given.traps, (worlds, 1, 1)))
    batch.sphere.assign(np.tile(given.spheres, (worlds, 1, 1)))
    batch.power.fill_(POWER)
    batch.arm()
    return batch


def in_batch(given: Given, plans: tuple[HandPlan, ...], worlds: int, device: wp.Device) -> Callable[[], object]:
    """`PERIODS` periods of as many worlds."""
    batch = batch_of(given, plans, worlds, device)
    places = [np.tile(given.hands(n), (worlds, 1, 1)) for n in range(PERIODS)]
    hands = [wp.array(place, dtype=wp.vec3d, device=device) for place in places]

    def periods() -> None:
        for n in range(PERIODS):
            if n % STATE == 0:
                batch.refresh(PERIOD * n)
            wp.copy(batch.hand, hands[n])
            batch.step()

    return periods


def costs(device: wp.Device, rounds: int) -> dict[str, dict[str, Quartiles]]:
    """Microseconds per hand and period, by mode and by who computes; of the processor on a CPU."""
    given, found = Given(), {}
    host = wp.get_device("cpu")
    for mode in ("stable", "paper"):
        plans = plan_hands(given.scene, {"left": "virtual", "right": "virtual"}, mode=mode)
        ways: dict[str, tuple[Callable[[], Callable[[], object]], wp.Device, int]] = {
            "the servo's chain, in Python": (partial(in_servo, given, plans, None), host, 1),
        }
        if mode == "stable":
            code, _ = compile_laws(given.local.laws)
            if code is not None:
                ways["the servo's chain, laws compiled"] = (partial(in_servo, given, plans, code), host, 1)
        for worlds in WORLDS["cpu" if device.is_cpu else "cuda"]:
            ways[f"batched, {worlds:,} worlds"] = (partial(in_batch, given, plans, worlds, device), device, worlds)
        found[mode] = {}
        for name, (make, where, worlds) in ways.items():
            samples = [elapsed(make(), where).on(where) / (2 * worlds * PERIODS) for _ in range(rounds)]
            found[mode][name] = Quartiles.of(samples).times(1e6)
    return found


def table(device: wp.Device, rounds: int) -> tuple[Table, dict[str, Any]]:
    """The costs for people, and for programs."""
    found = costs(device, rounds)
    names = list(dict.fromkeys(name for ways in found.values() for name in ways))
    rows = [
        (name, *(found[mode][name].text() if name in found[mode] else "" for mode in ("stable", "paper")))
        for name in names
    ]
    shown = Table(
        title="What a servo period of one hand costs",
        head=("chain", "stable [µs]", "paper [µs]"),
        rows=rows,
        note="Hands of the cell delivery, three traps and ten spheres each, every eighth period a new state; the"
        " servo's chains are those of one world, on the CPU, one after the other.",
    )
    return shown, {mode: {name: vars(cost) for name, cost in ways.items()} for mode, ways in found.items()}
