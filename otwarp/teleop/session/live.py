"""The live loop: hands and pages command traps, the simulation follows the wall's time, sinks get frames.

One tick: commands → hands → traps → as many steps as are due → readout → servo → sinks. The servo is a process of its
own and does not wait for the loop; a loop that dies or stalls is a simulation that stands still, and its watchdog acts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from otwarp import teleop as c
from otwarp.errors import InputError, SimulationError
from otwarp.haptics.core import SceneFrame
from otwarp.haptics.core.realtime import Clock, RealClock
from otwarp.record.monitor import Monitor
from otwarp.scene import Scene
from otwarp.simulation.frame import Frame, capture_frame
from otwarp.simulation.simulation import Simulation
from otwarp.teleop import LiveFrame, SessionMonitor, Sink
from otwarp.teleop.operators import HandPlan, LocalScene
from otwarp.teleop.operators.hands import Hands, TrapCommands
from otwarp.teleop.operators.servo import ServoFactory
from otwarp.teleop.perception import Perception
from otwarp.teleop.recording import Recordings, RecordingWriter
from otwarp.teleop.session.pace import Pace
from otwarp.teleop.session.task_text import task_line
from otwarp.teleop.session.turns import next_turn

RATES = (10.0, 1000.0)
"""Frames per second that the loop may aim at."""

LONGEST_TICK = 0.014
"""Seconds of work after which a tick with hands should end: they need a state every 20 ms, or their forces fall. On a
machine that is too slow simulated time slips instead."""

GLIDE = 1e-3
"""Simulated seconds after which a moving trap is put farther, to half-way through the next such part. A leap each frame
would let its spheres catch up, and lack their drag; with spheres that relax in τ it is 1 + (GLIDE/τ)²/12 of it."""

RecordingFactory = Callable[[str | None, "LiveLoop"], RecordingWriter]  # in a file, or in one named by the time


class LiveLoop:
    """A session of one world.

    Args:
        scene: What is simulated.
        plans: Hands with a device.
        sinks: Get frames and give commands.
        make_servo: Makes the servo of the hands.
        make_recording: Begins a recording; None refuses to record.
        notice: Takes one line when a hand has news: it was disarmed, its device is gone or back, the servo has ended.
        steer: Says at what speed to go on, by the time and the pace; None for the present one.
        perception: Says where the bodies are, where the scene is the twin of what a camera sees.
        clock: Of the loop; the servo's must show the same time.
        rate: Frames per second [1/s].
        speed: Simulated seconds per second.
        seed, device: As `Simulation`.

    Raises:
        InputError: An argument out of range, or a scene that cannot be simulated.

    Attributes:
        sim: The simulation; a reset makes another.
        perception: As given.
        local: What hands feel.
        hands: Hands and their servo.
        pace: Simulated time against the clock's.
        monitor: Whether the scene's task is done, and its statistics; a reset makes another.
        over: Whether the session has ended.
        failure: Why the simulation stopped, or "".
        frames, late: Frames so far, and how many of them were dropped because a tick took too long.
        wall: Time that `run` has taken so far [s].
    """

    def __init__(
        self,
        scene: Scene,
        plans: Sequence[HandPlan] = (),
        *,
        sinks: Sequence[Sink] = (),
        make_servo: ServoFactory | None = None,
        make_recording: RecordingFactory | None = None,
        notice: Callable[[str], None] | None = None,
        steer: Callable[[float, c.PaceNow], float | None] | None = None,
        perception: Perception | None = None,
        clock: Clock | None = None,
        rate: float = 120.0,
        speed: float = 1.0,
        seed: int = 0,
        device: str | None = None,
    ):
        if not RATES[0] <= rate <= RATES[1]:
            raise InputError(f"rate is {rate!r}; allowed: {RATES[0]:g} to {RATES[1]:g} frames per second")
        if plans and make_servo is None:
            raise InputError("make_servo is None; allowed with hands: what makes their servo")
        slowest = max((1.0 / plan.config.safety.decay_after for plan in plans), default=0.0)
        if rate <= slowest:
            raise InputError(
                f"rate is {rate!r}; allowed with hands: above {slowest:g} frames per second, or forces fall between"
            )
        self.plans = tuple(plans)
        self._make_sim = lambda: Simulation(scene, seed=seed, device=device, readout=True)
        self._clock, self._rate, self._speed = clock or RealClock(), rate, speed
        self._sinks: list[Sink] = []
        self._due: list[float] = []
        self._make_recording, self._notice, self._steer = make_recording, notice or (lambda _: None), steer
        self.perception = perception
        for sink in sinks:
            self.add(sink)
        self.sim = self._make_sim()
        moved = [trap for plan in plans for trap in plan.config.traps]
        self.local = LocalScene.of(self.sim.model, moved)
        self.hands = Hands(plans, make_servo(plans, self.local) if make_servo and plans else None)
        self._traps = TrapCommands(scene, moved)
        self._safety, self.monitor = self._monitors()
        now, longest = self._clock.now(), LONGEST_TICK if self.plans else np.inf
        self.pace = Pace(self.sim.time_step, rate=rate, speed=speed, now=now, longest_tick=longest)
        self._recordings = Recordings()
        self._arm_soon = self._closed = False
        self.over, self.failure = False, ""
        self._beat = self.frames = self.late = 0
        self.wall = 0.0

    @property
    def clock(self) -> Clock:
        """The clock by which the loop runs."""
        return self._clock

    @property
    def recording(self) -> Path | None:
        """File that is being written."""
        return self._recordings.file

    def add(self, sink: Sink) -> None:
        """One more that gets frames and gives commands; closed with the session."""
        self._sinks.append(sink)
        self._due.append(-np.inf)

    def start(self, *, arm: bool = False) -> None:
        """Compile, open the devices, take the first step, publish the first state.

        Args:
            arm: Whether to arm the hands as soon as they have hold of their traps.

        Raises:
            InputError: A device is not there.
        """
        self._traps.write(self.sim)
        self.sim.step(1)
        self._capture()  # compiles what reads out, before anything waits for it
        if self.perception is not None:
            self.perception.start()
        self.hands.start()
        self.pace.restart(self._clock.now())
        self._arm_soon = arm
        self.hands.publish(self._next_state(self._capture()))

    def run(
        self, duration: float | None = None, *, arm: bool = False, started: Callable[[], None] | None = None
    ) -> None:
        """Start, tick until a command stops it or for `duration` seconds of the clock, and close.

        Args:
            duration: [s]; None until a command stops it.
            arm: As `start`.
            started: Called once it has started.

        Raises:
            InputError: As `start`.
            SimulationError: The simulation stopped, and nobody is there to reset it.
        """
        try:
            self.start(arm=arm)
            if started is not None:
                started()
            begun = beat = self._clock.now()
            end = np.inf if duration is None else begun + duration
            news = None if self.perception is None else self.perception.await_news
            while not self.over and self._clock.now() < end:
                self.tick()
                beat, missed = next_turn(self._clock, beat, self._rate, news, LONGEST_TICK if self.plans else np.inf)
                self.late += missed
                self.wall = self._clock.now() - begun
        finally:
            self.close()

    def tick(self) -> LiveFrame:
        """One turn of the loop; returns what was published."""
        begun = self._clock.now()
        self._obey()
        for error in self._recordings.finished():
            self._complain(str(error))
        self._traps.hold(self.hands.listen().items())
        for line in self.hands.news():
            self._notice(line)
        steps = self._step(begun)
        self._perceive(begun)
        frame = self._capture()
        self._traps.note(frame.trap_position[0])
        # a simulation that waits for its next step, as in slow motion, lives; one that is paused or failed says nothing
        state = None if self.failure or self.pace.paused else self._next_state(frame)
        self.hands.publish(state)
        if self.perception is not None:
            self.perception.published()
        if steps:
            self.monitor.update(frame)
        self._arm_when_held()
        live = self._live(frame)
        if self._recordings.current is not None:
            self._recordings.current.frame(live, state)
            if self.perception is not None:
                self._recordings.current.perceived(self.perception.turn(state and state.beat), live.wall)
        for n, sink in enumerate(self._sinks):
            if begun >= self._due[n]:
                self._due[n] = begun + sink.interval
                sink.publish(live)
        if self._steer is not None and (speed := self._steer(begun, live.pace)) is not None:
            self.do(c.SetSpeed(speed))
        self.pace.worked(self._clock.now() - begun)
        return live

    def close(self) -> None:
        """Zero forces, finish the recording, close the sinks; may be called more than once.

        Raises:
            OSError: A recording could not be finished.
        """
        if self._closed:
            return
        self._closed = self.over = True
        try:
            self.hands.stop()
        finally:
            try:
                self._recordings.close()
            finally:
                for part in (*self._sinks, *([self.perception] if self.perception is not None else [])):
                    part.close()

    def _step(self, now: float) -> int:
        """Take the steps that are due while the traps glide to where they are commanded; how many."""
        steps = 0 if self.failure else self.pace.due(now)
        try:
            self._advance(steps)
        except SimulationError as error:
            if not self._sinks:
                raise
            self.failure = str(error)
            self._let_go()
            self._complain(f"{error}; reset to go on")
            return 0
        return steps

    def _advance(self, steps: int) -> None:
        """The steps stand for the time since the last tick, in which the hands went from there to here."""
        self._traps.advance(steps * self.sim.time_step)
        part = max(1, round(GLIDE / self.sim.time_step)) if self._traps.changed else steps
        done = 0
        while done < steps:
            part = min(part, steps - done)
            # half-way through each part, so that spheres lag by the drag on average; a single leap goes all the way
            self._traps.write(self.sim, (done + 0.5 * part) / steps if part < steps else 1.0)
            self.sim.step(part)
            done += part
        if steps:
            self._traps.write(self.sim)

    def _perceive(self, now: float) -> None:
        """Bodies go where a camera has them; hands feel nothing of those that should be seen and are not."""
        if self.perception is not None:
            self.perception.update(self.sim, now, *self._traps.at(self.sim.time))
            self.hands.withhold(self.perception.blind)

    def _capture(self) -> Frame:
        """The present state, in arrays of its own: sinks may keep them."""
        return capture_frame(self.sim).copy()

    def _monitors(self) -> tuple[SessionMonitor, Monitor]:
        model = self.sim.model
        return SessionMonitor(model.scene, model.held_range[0]), Monitor(model.scene, model.held, 1)

    def _next_state(self, frame: Frame) -> SceneFrame:
        self._beat += 1
        return self.local.now(self._beat, frame)

    def _live(self, frame: Frame) -> LiveFrame:
        self.frames += 1
        hands, pace = self.hands.frames, self.pace.report()
        unseen = () if self.perception is None else self.perception.warnings
        warnings = (*unseen, *self._safety.warnings(frame, hands, pace))
        if self._recordings.complaint:
            warnings = (*warnings, self._recordings.complaint)
        forces = self.sim.readout.hand_force.numpy()
        return LiveFrame(
            beat=self.frames,
            wall=self._clock.now(),
            frame=frame,
            trap_goals=self._traps.goals,
            hand_force=np.array(forces[0], dtype=float) if forces.size else np.zeros((2, 3)),
            hands=hands,
            servo=self.hands.status,
            pace=pace,
            warnings=(self.failure, *warnings) if self.failure else warnings,
            task=task_line(self.monitor, frame),
            recording=str(self.recording) if self.recording else None,
            engine=self.hands.engine,
            perceived=None if self.perception is None else self.perception.now(),
        )

    def _arm_when_held(self) -> None:
        """Arm once every hand has hold of its traps: before, the servo would refuse."""
        if self._arm_soon and all(hand.now is not None and hand.now.traps for hand in self.hands.frames):
            self._arm_soon = False
            self.hands.arm()

    def _obey(self) -> None:
        """Carry out what was asked; a refusal is reported to all sinks, and the session goes on."""
        for sink in self._sinks:
            for command in sink.commands():
                try:
                    self.do(command)
                except (InputError, OSError) as error:
                    self._complain(str(error))

    def do(self, command: c.Command) -> None:
        """Carry out a command now.

        Raises:
            InputError: It cannot be; nothing changed.
        """
        match command:
            case c.MoveTraps(positions, gently):
                self._traps.move(positions, gently=gently)
            case c.ShiftTraps(traps, by):
                self._traps.shift(traps, by)
            case c.SetPower(power, traps):
                self._traps.set_power(self.sim, power, traps)
            case c.SetGains(hand, motion_gain, force_gain):
                self.hands.set_gains(hand, motion_gain, force_gain)
            case c.SetSpeed(speed):
                self.pace.set_speed(speed)
            case c.Pause(on):
                self._pause(on)
            case c.Reset():
                self._reset()
            case c.Record(on, file):
                self._record(on, file)
            case c.Arm(hand):
                self._arm(hand)
            case c.Disarm(hand):
                self._let_go(hand)
            case c.Stop():
                self.over = True
        if self._recordings.current is not None:
            self._recordings.current.command(command, self._clock.now())

    def _arm(self, hand: str | None) -> None:
        if self.pace.paused or self.failure:
            raise InputError("arm: the simulation stands still; allowed: while it runs")
        self.hands.arm(hand)

    def _let_go(self, hand: str | None = None) -> None:
        """Disarm, also those that were to be armed once they hold their traps."""
        self._arm_soon = False
        self.hands.arm(hand, on=False)

    def _pause(self, on: bool) -> None:
        if on:
            self._let_go()
        elif self.pace.paused and not self.failure:  # whoever arms next does it with a fresh state
            self.hands.publish(self._next_state(self._capture()))
        self.pace.pause(on, self._clock.now())

    def _reset(self) -> None:
        """Begin anew; the hands are disarmed, and take hold of their traps where the scene has them."""
        self._let_go()
        self.sim = self._make_sim()
        self.failure = ""
        self._traps.restart()
        self.pace.restart(self._clock.now())
        self._safety, self.monitor = self._monitors()
        self._traps.write(self.sim)
        if self.perception is not None:
            self.perception.restart()
        self.hands.publish(self._next_state(self._capture()))

    def _record(self, on: bool, file: str | None) -> None:
        self._recordings.end()
        if on:
            if self._make_recording is None:
                raise InputError("record: this session cannot; allowed: with the rosbags package")
            self._recordings.current = self._make_recording(file, self)

    def _complain(self, line: str) -> None:
        for sink in self._sinks:
            sink.complain(line)
