"""A hand, a trap and a sphere for the tests of the chain, on a virtual clock."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace

from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.core import DeviceInfo, DeviceSample, SceneFrame, ServoFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.core.config import ChainConfig, HandConfig, PassivityConfig, SafetyConfig
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import IsotropicLaw, SplitLaw
from otwarp.laws import TrapLaw

RADIAL = TrapLaw(stiffness=0.6, threshold=0.6, inverse_square=0.17, offset=-0.1122, cutoff=1.2, power=1.0)
AXIAL = TrapLaw(stiffness=0.2, threshold=0.9, inverse_square=0.20, offset=-0.0669, cutoff=1.6, power=1.0)
"""Per mW; continuous at the threshold. At 20 mW, 100 µm/m and 0.05 N/pN: 60 and 20 N/m, peaks of 0.36 and 0.18 N."""

POWER = 20.0

PERIOD = 1e-3


def hand_config(**changes) -> HandConfig:
    """A hand with trap 0; keyword arguments for the chain and for safety go to them by name."""
    chain = {k: changes.pop(k) for k in list(changes) if k in ChainConfig.__dataclass_fields__}
    safety = {k: changes.pop(k) for k in list(changes) if k in SafetyConfig.__dataclass_fields__}
    return replace(HandConfig(traps=(0,), chain=ChainConfig(**chain), safety=SafetyConfig(**safety)), **changes)


def make_chain(config: HandConfig, *, split: bool = False) -> Chain:
    """A chain that is not armed yet."""
    law = SplitLaw(RADIAL, AXIAL) if split else IsotropicLaw(RADIAL)
    return Chain(config, local_model(config, {0: (law,)}))


def chain_for(config: HandConfig, info: DeviceInfo) -> Chain:
    """As a servo makes it, in another process."""
    return make_chain(config)


def scene_at(beat: int, time: float, sphere: Vec3 | None = (0.0, 0.0, 0.0), trap: Vec3 = (0.0, 0.0, 0.0)) -> SceneFrame:
    spheres = () if sphere is None else (SphereFrame(sphere, 0),)
    return SceneFrame(beat, time, spheres, (TrapFrame(0, trap, POWER),))


def drive(
    chain: Chain,
    hand: Callable[[float], Vec3],
    steps: int,
    *,
    start: int = 0,
    scene: Callable[[int, float], SceneFrame] = scene_at,
    buttons: Callable[[int], int] = lambda n: 0,
) -> list[ServoFrame]:
    """Steps `start` to `start` + `steps` of the clock; `scene` is asked every period."""
    out = []
    for n in range(start, start + steps):
        t = n * PERIOD
        out.append(chain.step(DeviceSample(t, hand(t), buttons(n)), scene(n, t)))
    return out


def size(force: Vec3) -> float:
    return math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)


def largest_step(run: list[ServoFrame], before: Vec3 = (0.0, 0.0, 0.0)) -> float:
    """Largest change of the force from one period to the next [N]."""
    worst = 0.0
    for now in run:
        worst = max(worst, math.dist(now.force, before))
        before = now.force
    return worst


def random_motion(rng: random.Random, speed: float) -> Callable[[float], Vec3]:
    """Five sines per axis from 0.2 to 6 Hz, of about this root mean square speed per axis [m/s]."""
    waves = [(rng.uniform(0.2, 6.0), rng.uniform(0.0, 2.0 * math.pi)) for _ in range(15)]

    def hand(t: float) -> Vec3:
        x, y, z = (
            sum(speed / (2.0 * math.pi * f) * math.sin(2.0 * math.pi * f * t + p) for f, p in waves[5 * a : 5 * a + 5])
            for a in range(3)
        )
        return x / 1.6, y / 1.6, z / 1.6

    return hand


def energy_of(
    *, seed: int, delay: float, drop: float, speed: float, gain: float, quantum: float, passivity: bool = True
) -> tuple[float, float, float]:
    """(least, most, observed less counted) energy taken from a hand in 5 s of random motion [J].

    The scene: a sphere that relaxes in 0.1 s to the trap commanded `delay` ago, kicked now and then, sometimes gone,
    published every 16 ms, `delay` late, each state lost with probability `drop`. The energy is counted here from the
    positions and forces alone.
    """
    rng = random.Random(seed)
    config = hand_config(
        force_gain=gain, quantum=quantum, ramp_time=0.1, passivity=PassivityConfig() if passivity else None
    )
    chain, hand = make_chain(config), random_motion(rng, speed)
    chain.arm()
    late = round(delay / PERIOD)
    sphere, trap, place = [0.0, 0.0, 0.0], (0.0, 0.0, 0.0), hand(0.0)
    commands, flying, shown = [], [], scene_at(-1, 0.0)
    force, energy, least, most, observed = (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0
    for n in range(5000):
        t = n * PERIOD
        before, place = place, hand(t)
        energy -= sum(f * (a - b) for f, a, b in zip(force, place, before, strict=True))
        least, most = min(least, energy), max(most, energy)
        commands.append(trap)
        there = commands[max(0, n - late)]
        sphere = [s + 0.01 * (u - s) for s, u in zip(sphere, there, strict=True)]
        if rng.random() < 0.002:
            sphere = [s + rng.gauss(0.0, 0.4) for s in sphere]
        if n % 16 == 0 and rng.random() >= drop:
            seen = None if rng.random() < 0.1 else (sphere[0], sphere[1], sphere[2])
            flying.append((n + late, scene_at(n, t, seen)))
        while flying and flying[0][0] <= n:
            shown = flying.pop(0)[1]
        now = chain.step(DeviceSample(t, place), shown)
        force, observed = now.force, now.energy
        trap = now.traps[0][1] if now.traps else trap
        if now.state == "disarmed":
            chain.arm()
    return least, most, observed - energy
