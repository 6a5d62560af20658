"""How faithfully a chain renders a force: rendered and model force of one side while its hand sweeps through a trap.

The hand is moved on a sine along a line through a trap that holds one sphere at rest. Rendered is what the chain sends
to the device in each servo period (in paper mode what the release's node asks for: it limits nothing); the model is
eq. 1 evaluated apart from the chain. Everything runs on a virtual clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.chain.paper_mode import RELEASE_RATE
from otwarp.haptics.core import DeviceSample, SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import PAPER_CHAIN, TOUCH_CHAIN, TOUCH_SAFETY, HandConfig, PassivityConfig
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import IsotropicLaw, Law, SplitLaw
from otwarp.laws import TrapLaw

AXES = {"radial": 0, "axial": 1}
"""Which of the device's axes lies along the line; its y is the beam."""

REACH = 1.1
"""Half of the sweep, over the cutoff of the law."""

RAMP = 600
"""Servo periods before the sweep, in which the armed force comes up."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """One component of the force in every servo period of a sweep.

    Attributes:
        time: (n) [s].
        rendered: (n) sent to the device, or asked for in paper mode [N].
        model: (n) eq. 1 at the true position of the hand [N].
        at_trap: (n) eq. 1 at the trap's place as the simulation last published it [N]; `model` in stable mode, in
            which the force is computed from the hand itself.
    """

    time: np.ndarray
    rendered: np.ndarray
    model: np.ndarray
    at_trap: np.ndarray


def pull_of(curve: TrapLaw, distance: float) -> float:
    """Eq. 1 at 1 mW [pN], signed as the distance [µm], apart from the code that is measured."""
    d = abs(distance)
    f = curve.stiffness * d if d < curve.threshold else curve.inverse_square / d**2 + curve.offset
    return math.copysign(f, distance) if d < curve.cutoff else 0.0


def touch(hold: float = 0.0, *, force_gain: float = 0.05) -> HandConfig:
    """The preset of a Touch with passivity control.

    Args:
        hold: Longest hold that passivity control expects at least [s].
        force_gain: [N/pN].
    """
    chain = replace(TOUCH_CHAIN, passivity=PassivityConfig(hold=hold))
    return HandConfig(traps=(0,), force_gain=force_gain, chain=chain, safety=TOUCH_SAFETY)


def release(*, force_gain: float = 0.05, damping: float = 0.0) -> HandConfig:
    """The public release's chain.

    Args:
        force_gain: G_hand [N/pN].
        damping: Of its device node [N·s/m]: 1 as released, which is no part of the optical force.
    """
    chain = replace(PAPER_CHAIN, damping=damping)
    return HandConfig(traps=(0,), force_gain=force_gain, chain=chain, safety=TOUCH_SAFETY)


def sweep(
    config: HandConfig,
    axis: str,
    speed: float,
    *,
    radial: TrapLaw,
    axial: TrapLaw,
    power: float,
    quantum: float = 0.0,
    sweeps: float = 3.0,
) -> Sweep:
    """Move a hand through a trap and back, and keep what is rendered.

    Args:
        config: Of the hand, which moves trap 0.
        axis: `radial` or `axial`; the release knows one curve, which is that of the axis.
        speed: Largest speed of the hand [m/s].
        radial, axial: Curves per mW.
        power: Of the trap [mW].
        quantum: Resolution of the device's encoder [m], 0 for exact; the model is taken at the true position.
        sweeps: Periods of the sine.
    """
    curve, row, paper = (axial if axis == "axial" else radial), AXES[axis], config.chain.mode == "paper"
    law: Law = IsotropicLaw(curve) if paper else SplitLaw(radial, axial)
    chain = Chain(config, local_model(config, {0: (law,)}))
    chain.arm()
    reach, period = REACH * curve.cutoff / config.motion_gain, 1.0 / config.chain.rate
    scale = config.force_gain * power
    count, every = round(sweeps * 2.0 * math.pi * reach / speed / period), (1.0 / RELEASE_RATE if paper else period)
    published, scene, trap, rows = -1, _published(0, 0.0, (0.0, 0.0, 0.0), power), (0.0, 0.0, 0.0), []
    for n in range(RAMP + count):
        true = reach * math.sin(speed / reach * period * max(0, n - RAMP))
        place = [0.0, 0.0, 0.0]
        place[row] = round(true / quantum) * quantum if quantum else true
        if math.floor(n * period / every + 1e-9) > published:
            published += 1
            trap = chain.moved if paper else (0.0, 0.0, 0.0)
            scene = _published(published + 1, n * period, trap, power)
        now = chain.step(DeviceSample(n * period, (place[0], place[1], place[2])), scene)
        if n >= RAMP:
            model = -scale * pull_of(curve, config.motion_gain * true)
            gap = sum(config.axis_map[j][row] * trap[j] for j in range(3))
            force = chain.asked if paper else now.force
            rows.append((n * period, force[row], model, -scale * pull_of(curve, gap) if paper else model))
    return Sweep(*np.array(rows).T)


def _published(beat: int, time: float, trap: tuple[float, float, float], power: float) -> SceneFrame:
    """A sphere at rest at the origin, and a trap."""
    return SceneFrame(beat, time, (SphereFrame((0.0, 0.0, 0.0), 0),), (TrapFrame(0, trap, power),))


def determination(rendered: np.ndarray, model: np.ndarray) -> float:
    """R² = 1 − Σ(rendered − model)²/Σ(model − mean)²."""
    rendered, model = np.asarray(rendered, dtype=float), np.asarray(model, dtype=float)
    return 1.0 - float(np.sum((rendered - model) ** 2) / np.sum((model - model.mean()) ** 2))
