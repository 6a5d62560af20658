"""What live sessions do: the drag that a hand feels, on a virtual clock, and how sessions keep time on this machine.

The drag is the same on every machine; the sessions run in real time, with the servo in its own process and no page.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.realtime import load
from benchmarks.report import Section, command
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.device import pick_device
from otwarp.haptics.core import Vec3
from otwarp.laws import TrapLaw
from otwarp.scene import Body, Medium, Scene, Settings, Sphere, Track, Trap
from otwarp.teleop import HANDS, Command, LiveFrame
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands, traps_of
from otwarp.teleop.operators.servo import LinkedClock, VirtualServo
from otwarp.teleop.session import Session, SessionOptions, live
from otwarp.teleop.session.live import LiveLoop

RADIUS, SPEED, STIFFNESS, POWER = 1.0, 5.0, 10.0, 20.0
"""Of the bead [µm], of the hand's trap [µm/s], of the trap [pN/µm] at its power [mW]."""

PLACE: Vec3 = (0.0, 0.0, 5.0)
FORCE_GAIN = 0.02
"""N/pN: far from every limit of the hand."""

RATE = 120.0
"""Ticks per second of the loop."""

SETTLED = 0.8
"""Seconds after which the hand is armed, its ramp has ended and the bead lags by γv/k."""

LEAP = 1.0
"""Seconds that no tick lasts: a trap that is put farther that seldom leaps once a tick."""

STILL, NOISY = 1.8, 19.8
"""Seconds that the hand moves, without thermal noise and with it; 20 would be a metre, the farthest that it may go."""

SLOW_TICK = 6e-3
"""Seconds that the work of a tick takes in the row of slow ticks, of 8.3 that there are."""

SESSIONS = ("teleop_small", "cell_delivery", "microfluidic_channel", "ten_thousand_cells")
RECORDED = "cell_delivery"
SECONDS = 8.0
"""Length of each session [s]."""

DEVICES = {"left": "virtual:circle,radius=0.01", "right": "virtual:circle,radius=0.01"}
"""Circles of 1 µm: the hands move all the time."""


@dataclass(frozen=True, slots=True)
class Drag:
    """Drag over γv, by the mean and by the rms of what differs from 1.

    Attributes:
        read: The simulation's force on the bead at the end of each tick: mean, rms error.
        felt: The hand's force in each servo cycle, over the force gain: mean, rms error.
    """

    read: tuple[float, float]
    felt: tuple[float, float]


def bead_in_trap(*, brownian: bool) -> Scene:
    """A bead in a trap of the right hand; the curve is continuous at its threshold."""
    law = TrapLaw(
        stiffness=STIFFNESS, threshold=0.6, inverse_square=2.0, offset=0.6 * STIFFNESS - 2.0 / 0.36, cutoff=1.2,
        power=POWER,
    )  # fmt: skip
    bead = Body(prim="/World/bead", position=PLACE, spheres=(Sphere(prim="/World/bead/sphere", radius=RADIUS),))
    trap = Trap(
        prim="/World/trap",
        position=Track.constant(PLACE),
        power=Track.constant(POWER),
        model="piecewise",
        radial=law,
        hand="right",
    )
    settings = Settings(brownian=brownian, duration=60.0)
    return Scene(root="/World", medium=Medium(), settings=settings, bodies=(bead,), traps=(trap,))


def stokes_drag(scene: Scene, speed: float = SPEED) -> float:
    """γv of the bead [pN]."""
    return 6.0 * math.pi * scene.medium.viscosity * RADIUS * speed


class Stage:
    """A loop with one virtual hand that moves a bead's trap along a line, on one clock.

    Args:
        prediction: Whether its chain predicts spheres.
        brownian: Whether thermal noise acts.
        seconds: How long the hand moves.
        work: Time of the clock that the steps of a tick take [s].
    """

    def __init__(self, *, prediction: bool, brownian: bool, seconds: float, work: float, seed: int):
        self.scene, self.clock = bead_in_trap(brownian=brownian), LinkedClock()
        # 100 µm/m by default
        line = f"virtual:line,from=0/0/0,to={0.01 * SPEED * seconds}/0/0,duration={seconds},mass=0"
        plans = [
            replace(p, config=replace(p.config, chain=replace(p.config.chain, pose_prediction=prediction)))
            for p in plan_hands(self.scene, {"right": line}, force_gain=FORCE_GAIN)
        ]
        self.servos: list[VirtualServo] = []
        self.loop = LiveLoop(
            self.scene, plans, make_servo=self._servo, clock=self.clock, rate=RATE, seed=seed, device="cpu"
        )
        if work:
            advance = self.loop._advance

            def slowly(steps: int) -> None:
                """The steps, and the time that they take."""
                advance(steps)
                self.clock.sleep_until(self.clock.now() + work)

            setattr(self.loop, "_advance", slowly)  # noqa: B010

    def _servo(self, plans: Sequence[HandPlan], local: LocalScene) -> VirtualServo:
        self.servos.append(VirtualServo(self.clock, plans, local, len(self.scene.traps)))
        return self.servos[-1]


def drag(
    *,
    glide: float = live.GLIDE,
    prediction: bool = True,
    brownian: bool = False,
    seconds: float = STILL,
    work: float = 0.0,
    seed: int = 0,
) -> Drag:
    """Drag that is read out and felt by a hand in even motion.

    Args:
        glide: Simulated seconds after which a moving trap is put farther; `LEAP` for once a tick.
        prediction, brownian, seconds, work, seed: As `Stage`; what counts begins at `SETTLED`.
    """
    stage = Stage(prediction=prediction, brownian=brownian, seconds=seconds, work=work, seed=seed)
    read = []
    with patch.object(live, "GLIDE", glide):
        try:
            stage.loop.start(arm=True)
            for n in range(1, math.floor((seconds - 1e-9) * RATE)):
                frame = stage.loop.tick()
                if n > SETTLED * RATE:
                    read.append(float(frame.hand_force[HANDS.index("right"), 0]))
                stage.clock.sleep_until(n / RATE)
        finally:
            stage.loop.close()
    felt = [
        -now.force[0] / FORCE_GAIN
        for now in stage.servos[0].forces[0]
        if SETTLED < now.time < seconds - 2.0 / RATE and now.state == "armed"
    ]
    return Drag(_over(read, stokes_drag(stage.scene)), _over(felt, stokes_drag(stage.scene)))


def _over(forces: Sequence[float], expected: float) -> tuple[float, float]:
    """Mean and rms error of forces over what is expected."""
    ratio = np.array(forces) / expected
    return float(ratio.mean()), float(np.sqrt(np.mean((ratio - 1.0) ** 2)))


def drag_table(data: dict[str, Any], *, still: float, noisy: float) -> Table:
    """Leaps and glides, spheres frozen and predicted, without and with noise, and ticks that take their time."""
    cases = [(g, p, b, 0.0) for b in (False, True) for g in (LEAP, live.GLIDE) for p in (False, True)]
    cases += [(live.GLIDE, p, False, SLOW_TICK) for p in (False, True)]
    rows = []
    for glide, prediction, brownian, work in cases:
        found = drag(
            glide=glide, prediction=prediction, brownian=brownian, work=work, seconds=noisy if brownian else still
        )
        name = ", ".join(
            (
                "leaps" if glide == LEAP else "glides",
                "predicted" if prediction else "frozen",
                "thermal noise" if brownian else "no noise",
                *((f"ticks of {1e3 * work:g} ms",) if work else ()),
            )
        )
        data[name] = asdict(found)
        rows.append((name, *(f"{v:.3f}" for v in (*found.read, *found.felt))))
    scene = bead_in_trap(brownian=False)
    return Table(
        title=f"Drag over γv = {stokes_drag(scene):.4f} pN: a bead of {RADIUS:g} µm at {SPEED:g} µm/s in a trap of "
        f"{STIFFNESS:g} pN/µm, virtual clock",
        head=("trap, spheres between states", "read out, mean", "rms error", "felt, mean", "rms error"),
        rows=rows,
        note=f"{RATE:g} states and 1000 servo cycles per second; the time step is otwarp's own choice. The rms errors "
        f"with noise are those of the trap's real thermal force, √(k_BT·k) = "
        f"{math.sqrt(thermal_force_squared(scene)) / stokes_drag(scene):.2f} γv.",
    )


def thermal_force_squared(scene: Scene) -> float:
    """k_BT·k [pN²]."""
    return 1.380649e-5 * scene.medium.temperature * STIFFNESS


class Gauge:
    """An sink that keeps what each frame says of pace and servo."""

    interval = 0.0

    def __init__(self) -> None:
        self.busy: list[float] = []
        self.lateness: list[float] = []

    def publish(self, frame: LiveFrame) -> None:
        """See `Sink`."""
        self.busy.append(frame.pace.busy)
        if frame.servo is not None:
            self.lateness.append(frame.servo.lateness)

    def commands(self) -> Sequence[Command]:
        """See `Sink`."""
        return ()

    def complain(self, line: str) -> None:
        """See `Sink`."""

    def close(self) -> None:
        """See `Sink`."""


def run_session(name: str, device: str, *, seconds: float, record: Path | None = None) -> dict[str, Any]:
    """A session of a shipped scene with every hand that it has, timed."""
    scene, gauge = load(name), Gauge()
    devices = {hand: spec for hand, spec in DEVICES.items() if traps_of(scene, hand)}
    how = SessionOptions(
        devices=devices, arm=True, duration=seconds, device=device, record=str(record) if record else None
    )
    session = Session(scene, how, sinks=(gauge,), say=lambda line: None)
    ticks = _timed(session.loop)
    report = session.run()
    p50, p99, worst = (float(v) for v in np.percentile(ticks, (50, 99, 100)))
    return {
        "scene": name,
        "recorded": record is not None,
        "hands": len(devices),
        "bodies": len(scene.bodies),
        "time_step": session.loop.sim.time_step,
        # the first second fills the windows
        "busy": float(np.median(gauge.busy[len(gauge.busy) // 8 :])),
        "tick": {"p50": p50, "p99": p99, "max": worst},
        "lateness": max(gauge.lateness, default=None),
        **{key: report[key] for key in ("wall", "real_time_factor", "slipped", "frames", "late_frames", "servo")},
    }


def _timed(loop: LiveLoop) -> list[float]:
    """Wall time of each tick from now on [s]."""
    ticks: list[float] = []
    tick: Callable[[], LiveFrame] = loop.tick

    def timed() -> LiveFrame:
        """A tick, and how long it took."""
        begun = time.perf_counter()
        frame = tick()
        ticks.append(time.perf_counter() - begun)
        return frame

    setattr(loop, "tick", timed)  # noqa: B010
    return ticks


def _row(found: dict[str, Any]) -> tuple[str, ...]:
    servo, tick = found["servo"], found["tick"]
    return (
        f"`{found['scene']}`" + (", recorded" if found["recorded"] else ""),
        str(found["hands"]),
        f"{1e6 * found['time_step']:.4g}",
        f"{found['real_time_factor']:.3f}",
        f"{found['slipped']:.2f}",
        f"{100.0 * found['busy']:.0f} %",
        *(f"{1e3 * tick[k]:.2f}" for k in ("p50", "p99", "max")),
        f"{found['late_frames']} of {found['frames'] + found['late_frames']}",
        f"{1e3 * found['lateness']:.2f}" if servo else "–",
        f"{servo['dropped']} of {servo['cycles']}" if servo else "–",
    )


def session_table(data: dict[str, Any], device: str, *, scenes: Sequence[str], recorded: str, seconds: float) -> Table:
    """Sessions of the shipped scenes, and one that is recorded."""
    found = [run_session(name, device, seconds=seconds) for name in scenes]
    with tempfile.TemporaryDirectory() as folder:
        found.append(run_session(recorded, device, seconds=seconds, record=Path(folder) / "take.mcap"))
    data |= {one["scene"] + (" recorded" if one["recorded"] else ""): one for one in found}
    head = (
        *("scene", "hands", "time step [µs]", "real time", "given up [s]", "busy"),
        *("tick p50 [ms]", "p99", "max", "frames late", "servo late, at most [ms]", "cycles dropped"),
    )
    return Table(
        title=f"Sessions of {seconds:g} s, {RATE:g} frames per second, no page, no budget",
        head=head,
        rows=[_row(one) for one in found],
        note="*real time* is simulated over wall time, *busy* the loop's share of its core. Whatever else runs on the "
        "machine is in the percentiles, in late frames and in the servo's lateness: see the load above.",
    )


def measure(
    device: str = "cpu",
    *,
    rounds: int = 1,
    scenes: Sequence[str] = SESSIONS,
    recorded: str = RECORDED,
    seconds: float = SECONDS,
    still: float = STILL,
    noisy: float = NOISY,
) -> Section:
    """Both tables; `rounds` makes sessions that much longer. The drag is always simulated on the CPU."""
    place = pick_device(device)
    machine = Machine.look(place)
    data: dict[str, Any] = {"drag": {}, "sessions": {}}
    # the sessions first: the load that is stated is theirs
    sessions = session_table(
        data["sessions"], device, scenes=scenes, recorded=recorded, seconds=rounds * seconds
    )  # fmt: skip
    tables = [drag_table(data["drag"], still=still, noisy=noisy), sessions]
    return Section(name="teleop", kind="cpu" if place.is_cpu else "cuda", machine=machine, tables=tables, data=data)


if __name__ == "__main__":
    command(measure, "What live sessions do.", rounds=1)
