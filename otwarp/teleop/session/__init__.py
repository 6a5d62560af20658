"""`Session`: a scene, live, with hands, page and recording, put together: what `otwarp teleop` runs.

`live` is its loop, one tick after the other; open it first. `turns` says when each begins, `pace` how many steps are
due in it, and at what speed to go on; `task_text` how the scene's task stands.
"""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from otwarp.device import pick_device
from otwarp.errors import InputError
from otwarp.haptics.core.config import HapticsConfig
from otwarp.haptics.core.realtime import favour
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices import KINDS, parse_devices, probe_devices
from otwarp.haptics.devices.mouse import POINTER
from otwarp.record.summary import statistics, strict, task
from otwarp.scene import Scene
from otwarp.teleop import Record, Sink
from otwarp.teleop.budget import parse_budget, reduce_scene
from otwarp.teleop.budget.report import measure_scene
from otwarp.teleop.operators import HandPlan, LocalScene, plan_hands, slowed
from otwarp.teleop.operators.servo import ServoLike, compile_laws, servo_process
from otwarp.teleop.page import PageProcess
from otwarp.teleop.page.access import check_host
from otwarp.teleop.perception import Perception
from otwarp.teleop.recording import Recordable, RecordingWriter
from otwarp.teleop.recording.file import check_new_recording, load_writer
from otwarp.teleop.session.live import GLIDE, LiveLoop
from otwarp.teleop.session.pace import BudgetWatch

SERVO_RATE = 1000.0
"""Cycles per second of the servo [Hz]."""

SESSION = 600.0
"""Seconds that a session without an end is taken to last, for what comes into the traps' reach meanwhile."""


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Where the page is served.

    Attributes:
        host: Interface; loopback unless another is asked for.
        port: That one or an error; 0 for any, None for 8080 or the next that is free.
        token: What a browser must know, None to make one where it is needed.
        browser: Whether to open a browser here.
    """

    host: str = "127.0.0.1"
    port: int | None = None
    token: str | None = None
    browser: bool = False


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """What a session is, besides its scene.

    Attributes:
        devices: Hand → device.
        config: Of the hands; None for the presets; a mapping, as a JSON file has it, for what differs from them.
        mode: `stable` or `paper`; of the presets.
        pairing: `release` or `older`; of the presets.
        motion_gain, force_gain: Replace those of both hands [µm/m, N/pN].
        record: File that is recorded from the start.
        arm: Whether hands are armed as soon as they hold their traps.
        page: The page, None for none.
        budget: `auto`, `off`, or the share of a core that the simulation may take, as text; see `teleop.budget`.
        rate: Frames per second of the loop.
        servo_rate: Cycles per second of the servo [Hz].
        speed: Simulated seconds per second.
        duration: Seconds of the clock after which it ends, None for when a command stops it.
        seed, device: As `Simulation`.
    """

    devices: Mapping[str, str] = field(default_factory=dict)
    config: HapticsConfig | Mapping[str, Any] | None = None
    mode: str = "stable"
    pairing: str = "release"
    motion_gain: float | None = None
    force_gain: float | None = None
    record: str | None = None
    arm: bool = False
    page: PageOptions | None = None
    budget: str = "off"
    rate: float = 120.0
    servo_rate: float = SERVO_RATE
    speed: float = 1.0
    duration: float | None = None
    seed: int = 0
    device: str | None = None

    def plan(self, scene: Scene) -> tuple[HandPlan, ...]:
        """What each hand does in a scene; refuses all that can be refused before anything is made or measured.

        Raises:
            InputError: A device, a hand, a number or a name of a recording that cannot be.
        """
        if self.record is not None:
            check_new_recording(self.record)
        parse_budget(self.budget)
        pick_device(self.device)
        if self.page is not None:
            check_host(self.page.host)
        plans = plan_hands(
            scene,
            self.devices,
            config=self.config,
            mode=self.mode,
            pairing=self.pairing,
            motion_gain=self.motion_gain,
            force_gain=self.force_gain,
            rate=self.servo_rate,
        )
        if plans:
            parse_devices([plan.device for plan in plans], ["" for _ in plans])
        return plans


class Session:
    """A live loop with its servo, page and recording, put together; a context manager.

    Args:
        scene: What is simulated.
        options: How.
        sinks: More that get frames and give commands, beside the page.
        perception: Says where the bodies are, where the scene is the twin of what a camera sees.
        say: Takes lines for the user.

    Raises:
        InputError: A device, a hand, a number or a name of a recording that cannot be; nothing was started.

    Attributes:
        loop: The live loop.
        budget: What was left out of the scene, None if nothing was asked to be.
        law: What computes the force on hands, or "" without hands.
    """

    def __init__(
        self,
        scene: Scene,
        options: SessionOptions,
        *,
        sinks: Sequence[Sink] = (),
        perception: Perception | None = None,
        say: Callable[[str], None] = print,
    ):
        o = self._options = options
        plans = o.plan(scene)
        self._boxes = {plan.name: Mailbox.create(POINTER) for plan in plans if plan.device.strip() == "mouse"}
        self._say, self._traps = say, len(scene.traps)
        self._recorded: str | None = None
        self.budget: dict[str, Any] | None = None
        self._watch: BudgetWatch | None = None
        self.engine = ""
        try:
            if plans:
                specs = parse_devices([plan.device for plan in plans], [self._pointer(plan) for plan in plans])
                if self._boxes and o.page is None:
                    hand = next(iter(self._boxes))
                    raise InputError(f"--{hand} is 'mouse'; allowed with the page, which has the mouse")
                for spec, plan in zip(specs, plans, strict=True):
                    if caution := KINDS[spec.kind].caution:
                        say(f"{plan.name:<9} {spec.text}: {caution}")
                probe_devices(specs)
            scene, speed = self._reduced(scene, hands=bool(plans))
            plans = slowed(plans, speed)
            self._page = self._open_page(scene, plans)
            sinks = (*sinks, self._page) if self._page else tuple(sinks)
            self.loop = LiveLoop(
                scene,
                plans,
                sinks=sinks,
                make_servo=self._make_servo,
                make_recording=self._make_recording,
                notice=say,
                steer=self._watch,
                perception=perception,
                rate=o.rate,
                speed=speed,
                seed=o.seed,
                device=o.device,
            )
            self.loop.hands.engine = self.engine
        except BaseException:
            self._close_boxes()
            raise

    def run(self) -> dict[str, Any]:
        """Until a command stops the session; returns its `summarize`, with `budget` and `recording`.

        Raises:
            InputError: A device is not there, or the page's port is taken; nothing is armed.
            SimulationError: The simulation stopped, and nobody is there to reset it.
        """
        o, loop = self._options, self.loop
        back_to_normal = favour()
        try:
            load_writer()  # somebody may press Record while hands are armed
            if self._page is not None:
                self._page.start()
            if o.record is not None:
                loop.do(Record(True, o.record))
            loop.run(o.duration, arm=o.arm, started=self._announce)
        except KeyboardInterrupt:
            self._say("")  # after the ^C of the terminal
        finally:
            loop.close()
            self._close_boxes()
            back_to_normal()
        if self._recorded and not Path(self._recorded).exists():
            self._recorded = None  # ended before the first frame
        report = summarize(loop) | {"budget": self.budget, "recording": self._recorded, "law": self.engine or None}
        if self.engine:
            report["text"] += f"\nforce law {self.engine}"
        if self._recorded:
            report["text"] += f"\nrecorded  {self._recorded}"
        return report

    def _announce(self) -> None:
        """Say where the page is; once the devices are open, lest a browser shows a session that never began."""
        if self._page is None:
            return
        self._say(f"page      {self._page.url}  (Ctrl-C ends)")
        if self._options.page is not None and self._options.page.browser:
            # it may wait for the browser, and the hands' forces would fall meanwhile
            threading.Thread(target=webbrowser.open, args=(self._page.url,), daemon=True).start()

    def _pointer(self, plan: HandPlan) -> str | None:
        box = self._boxes.get(plan.name)
        return box.name if box else None

    def _reduced(self, scene: Scene, *, hands: bool) -> tuple[Scene, float]:
        """What this machine runs in real time, and the speed at which it does; with hands that move their traps."""
        o = self._options
        wanted = parse_budget(o.budget)
        if wanted == "off":
            return scene, o.speed
        # how long an operator will stay is not known
        horizon = o.duration or max(SESSION, scene.settings.duration)
        how: dict[str, Any] = {"speed": o.speed, "rate": o.rate, "horizon": horizon}
        how["measure"] = partial(measure_scene, glide=GLIDE if hands else None)
        reduced = reduce_scene(scene, device=o.device, budget=wanted, progress=self._say, **how)
        for line in reduced.report.lines():
            self._say(line)
        self.budget = reduced.report.to_json()
        self._watch = BudgetWatch(reduced.report, self._say)
        return reduced.scene, reduced.report.speed

    def _open_page(self, scene: Scene, plans: Sequence[HandPlan]) -> PageProcess | None:
        """The page, not started; None without one."""
        page = self._options.page
        if page is None:
            return None
        return PageProcess(
            scene,
            host=page.host,
            port=page.port,
            token=page.token,
            pointers={name: box.name for name, box in self._boxes.items()},
            axis_maps={plan.name: plan.config.axis_map for plan in plans},
            ended=self._say,
        )

    def _make_servo(self, plans: Sequence[HandPlan], local: LocalScene) -> ServoLike:
        pointers = {name: box.name for name, box in self._boxes.items()}
        code, self.engine = compile_laws(local.laws)
        if code is None:
            self._say(f"force law {self.engine}")
        rate = self._options.servo_rate
        return servo_process(plans, local, traps=self._traps, pointers=pointers, rate=rate, code=code)

    def _make_recording(self, file: str | None, loop: LiveLoop) -> RecordingWriter:
        recording = open_recording(file, loop, law=self.engine)
        self._recorded = str(recording.file)
        return recording

    def _close_boxes(self) -> None:
        for box in self._boxes.values():
            box.close()


def open_recording(file: str | None, loop: LiveLoop, law: str = "") -> RecordingWriter:
    """Begin the recording of a session, now; it is replayed from this moment on.

    Args:
        file: `.mcap`, or None for one named by the time, in this folder.
        loop: The session.
        law: What computes the forces, for its settings.

    Raises:
        InputError: As `RecordingWriter`.
    """
    servo = loop.hands.servo
    return RecordingWriter(
        file or f"recording-{datetime.now():%Y%m%d-%H%M%S}.mcap",
        config=HapticsConfig(hands=tuple(plan.config for plan in loop.plans)),
        devices={plan.name: plan.device for plan in loop.plans},
        laws=loop.local.laws,
        kinds=loop.local.kinds,
        scene=loop.sim.scene,
        settings={
            "seed": loop.sim.model.seed,
            "time_step": loop.sim.time_step,
            "device": loop.sim.model.device.alias,
            "law": law,
            **({} if loop.perception is None else {"perception": loop.perception.described()}),
        },
        clock=loop.clock.now,
        servo=servo if isinstance(servo, Recordable) else None,
    )


def summarize(loop: LiveLoop) -> dict[str, Any]:
    """Figures of a session that has run; `text` says them to a reader.

    Keys: `wall` and `simulated` [s], `slipped` [s], `real_time_factor` over the whole session, `paused` [s], `frames`,
    `late_frames`, `servo` (cycles, dropped, worst lateness of its last second [s]), `hands`, `failure`, `text`; of the
    time since the last reset, as `otwarp run` has them, `task` and `statistics`.
    """
    pace, status = loop.pace, loop.hands.status
    running = loop.wall - pace.stood
    report: dict[str, Any] = {
        "wall": loop.wall,
        "simulated": pace.simulated,
        "slipped": pace.slipped,
        "paused": pace.stood,
        "real_time_factor": pace.simulated / running if running > 0.0 else 0.0,
        "frames": loop.frames,
        "late_frames": loop.late,
        "servo": None,
        "hands": [],
        "failure": loop.failure or None,
        "perception": None if loop.perception is None else loop.perception.summary(),
        "task": strict(task(loop.monitor, 1)),
        "statistics": strict(statistics(loop.monitor)),
    }
    lines = [
        f"session   {loop.wall:.1f} s, {pace.simulated:.2f} s simulated "
        f"({report['real_time_factor']:.2f} of real time{_slip(pace.slipped)}), "
        f"{loop.frames} frames, {loop.late} of them late"
    ]
    if status is not None:
        report["servo"] = {"cycles": status.tick, "dropped": status.late, "lateness": status.lateness}
        lines.append(
            f"servo     {status.tick} cycles, {status.late} dropped, in its last second at most "
            f"{1e3 * status.lateness:.2f} ms late"
        )
    for n, hand in enumerate(loop.hands.frames):
        losses = status.hands[n].losses if status else 0
        report["hands"].append({"name": hand.name, "device": hand.device, "losses": losses, "message": hand.message})
        lines.append(f"{hand.name:<9} {hand.device}: lost {losses} times{'; ' + hand.message if hand.message else ''}")
    lines += _task_lines(loop)
    if report["perception"] is not None:
        lines.append(report["perception"].pop("text"))
    if loop.failure:
        lines.append(f"stopped   {loop.failure}")
    report["text"] = "\n".join(lines)
    return report


def _task_lines(loop: LiveLoop) -> list[str]:
    """How the task ended, and the figures that the paper gives of a trial."""
    monitor = loop.monitor
    ended, numbers = monitor.outcome(0), statistics(monitor)
    lines = [] if monitor.goal is None else [f"task      {ended.outcome}: {ended.reason}"]
    for name, key in (("distance", "trap_distance"), ("contact", "contact_force")):
        part = numbers.get(key)
        if part and part.get("mean") is not None:
            lines.append(f"{name:<9} {part['mean']:.3g} ± {part['std']:.2g} {part['unit']}")
    return lines


def _slip(seconds: float) -> str:
    return f", {seconds:.2f} s given up" if seconds > 0.0 else ""
