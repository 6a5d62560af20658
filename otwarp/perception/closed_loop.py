"""`ClosedLoop`: a twin that is where the camera has its bodies. What a live loop asks of perception, put together."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from otwarp.haptics.core.realtime import Clock, RealClock
from otwarp.perception.camera import CameraLost
from otwarp.perception.estimator import Look
from otwarp.perception.followed import FollowedBody
from otwarp.perception.latency import Latency, table
from otwarp.perception.looker import Looker
from otwarp.perception.overlaps import MOST_LEFT, Overlaps
from otwarp.perception.recorded import body_to_dict, look_to_dict
from otwarp.simulation.simulation import Simulation
from otwarp.teleop.perception import BodyNow, PerceptionNow, PerceptionTurn
from otwarp.vision.tracking.commands import Commands

STRAIGHT = 2e-3
"""How far commands may be off the straight lines that trackers have of them [µm], a tenth of thermal motion."""

SHOWN_EVERY = 0.2
"""Seconds between two images that are kept for the page."""

AGES = 5
"""Frames of late whose pace says when a body that is not seen is lost; of simulated laboratories."""

RATE_OVER = 2.0
"""Seconds over which the rate of frames is counted."""


class ClosedLoop:
    """Follows bodies through a camera, and puts a simulation's bodies where they are now.

    Args:
        looker: Who looks.
        bodies: Those that are followed; all with `commands`.
        commands: Of the traps.
        clock: Of the session.
        about: What looks at what, for a recording; JSON.

    Attributes:
        latency: From light to state, stage by stage; not of light that came before the first turn and waited for the
            session to begin.
        frames, skipped, disordered: Frames that were looked at, exposures that nobody read, frames that came after a
            later one.
        parted, clashes: Turns in which bodies had to be pushed out of each other, and in which that was not enough.
    """

    def __init__(
        self,
        looker: Looker,
        bodies: Sequence[FollowedBody],
        commands: Commands,
        *,
        clock: Clock | None = None,
        about: Mapping[str, Any] | None = None,
    ):
        self._looker, self.bodies, self._commands = looker, tuple(bodies), commands
        self._clock, self._about = clock or RealClock(), dict(about or {})
        self._began, self._restarts = commands.times[0], 0
        self._told: tuple[float, np.ndarray, np.ndarray] = 0.0, np.zeros((0, 3)), np.zeros(0)
        self._turns, self._since = 0, np.inf
        self._holds = np.zeros(0, dtype=int)
        self._first = commands.values[0][: 3 * commands.traps].reshape(-1, 3).copy()
        self._started = False
        self.latency = Latency()
        self._ended = ""
        self._times: list[float] = []
        self._number, self._newest = 0, -np.inf
        self._ages: deque[float] = deque(maxlen=AGES)
        self.frames = self.skipped = self.disordered = self.parted = self.clashes = 0
        self._aligned = False
        self._overlaps: Overlaps | None = None
        self._looks: tuple[Look, ...] = ()
        self._entered = self._updated = 0.0
        self._open: list[dict[str, float]] = []
        self._shown: dict[int, dict[str, np.ndarray | None]] = {}
        self._shown_at = -np.inf

    def start(self) -> None:
        """Open the camera.

        Raises:
            InputError: It is not there.
        """
        now = self._clock.now()
        self._looker.want([body.wanted() for body in self.bodies])
        self._looker.start(now)
        self._started = True

    def update(self, sim: Simulation, now: float, position: np.ndarray, power: np.ndarray) -> None:
        """Take in what the camera saw, and put the bodies that are seen where they are now.

        Args:
            sim: The twin, at `now`.
            now: Time of the session's clock [s].
            position: (T, 3) where its traps are [µm].
            power: (T) [mW].
        """
        entered = self._clock.now()
        self._holds = np.array([body for body, _ in sim.model.held], dtype=int)
        self._commands.reach(now, position=position, power=power, tolerance=STRAIGHT)
        self._told, self._turns, self._since = (now, position, power), self._turns + 1, min(self._since, now)
        self._looker.command(now, position, power)
        self._looks = tuple(self._new_looks(now))
        oldest = max(self._ages, default=0.0)
        for body in self.bodies:
            if self._ended:
                body.move(now, ended=self._ended)
                continue
            for look in self._looks:
                for one in look.bodies:
                    if one.body == body.index:
                        body.take(one, now, oldest=oldest)
            body.move(now, oldest=oldest)
            own = position[self._holds == body.index]
            if len(own):
                body.carried = own.mean(axis=0) - self._first[self._holds == body.index].mean(axis=0)
        self._align(sim)
        self._looker.want([body.wanted() for body in self.bodies])
        self._forget(now)
        self._note(now, entered)
        self._show(now)

    def published(self) -> None:
        """The state that came of the last `update` is with the servo."""
        now = self._clock.now()
        for stages in self._open:
            self.latency.add(stages | {"publish": now - self._updated})
        self._open.clear()

    def await_news(self, until: float) -> bool:
        """See `otwarp.teleop.perception.Perception`; looks are due at the pace of late, give or take as long."""
        now = self._clock.now()
        due = len(self._times) > 1 and abs(self._times[-1] + 1.0 / self._rate() - now) <= until - now
        return self._looker.await_look(until if due else now)

    @property
    def blind(self) -> dict[int, str]:
        """Traps that hold a body which should be seen and is not, and why."""
        lost = {body.index: f"{body.name} is lost: {body.why}" for body in self.bodies if not body.seen}
        return {trap: lost[int(body)] for trap, body in enumerate(self._holds) if int(body) in lost}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the operator must know, one line each."""
        if self._ended:
            return (f"{self._ended}; nothing is felt of what it saw",)
        return tuple(f"{body.name} is lost: {body.why}; nothing is felt of it" for body in self.bodies if body.why)

    def now(self) -> PerceptionNow:
        """What is seen, for a live frame."""
        return PerceptionNow(
            camera=self._looker.info.name,
            ended=self._ended,
            rate=self._rate(),
            bodies=tuple(self._body_now(body) for body in self.bodies),
        )

    def turn(self, beat: int | None) -> PerceptionTurn:
        """The last `update`, for a recording; `beat` of the state that was published after it."""
        now, position, power = self._told
        told = {
            "turn": self._turns, "now": now, "beat": beat, "restarts": self._restarts, "ended": self._ended,
            "aligned": self._aligned,
            "trap_position": position.tolist(), "trap_power": power.tolist(),
            "looks": [look_to_dict(look) for look in self._looks], "bodies": [body_to_dict(b) for b in self.bodies],
        }  # fmt: skip
        names = {body.index: body.name for body in self.bodies}
        pictures = tuple(
            (names[one.body], one.piece.levels, look.time) for look in self._looks for one in look.bodies
        )  # fmt: skip
        return PerceptionTurn(told, pictures)

    def described(self) -> dict[str, Any]:
        """What looks at what, since when, and how many turns there were before."""
        return {**self._about, "began": self._began, "turns": self._turns}

    def restart(self) -> None:
        """The session begins anew: nothing is known but the scene's start, at which a simulated laboratory is too."""
        self._looker.restart()
        self._restarts += 1
        for body in self.bodies:
            body.restart()

    def summary(self) -> dict[str, Any]:
        """Figures of the session; `text` says them to a reader."""
        stages = self.latency.percentiles()
        bodies = [{"name": b.name, "accepted": b.accepted, "refused": b.refused, "why": b.why,
                   "lost": b.lost / max(b.turns, 1)} for b in self.bodies]  # fmt: skip
        counts = {name: getattr(self, name) for name in ("frames", "skipped", "disordered", "parted", "clashes")}
        text = [f"camera    {self._looker.info.name}: {self.frames} frames looked at, {self.skipped} skipped"]
        text += [
            f"          {b.name}: {b.accepted} measurements taken, {b.refused} refused, lost "
            f"{100.0 * b.lost / max(b.turns, 1):.0f} % of the time{f'; {b.why}' if b.why else ''}"
            for b in self.bodies
        ]
        if stages:
            text += ["latency   from light to state             p50         p99", *table(stages)]
        return {
            "camera": self._looker.info.name,
            **counts,
            "bodies": bodies,
            "latency": stages,
            "text": "\n".join(text),
        }

    def close(self) -> None:
        """Let go of the camera; may be called more than once."""
        self._looker.close()

    def _new_looks(self, now: float) -> list[Look]:
        if self._ended:
            return []
        try:
            looks = self._looker.looks(now)
        except CameraLost as error:
            self._ended = str(error)
            return []
        for look in looks:
            self.frames += 1
            self.skipped += max(0, look.number - self._number - 1) if self._number else 0
            self.disordered += look.time < self._newest
            # of the first, as if one had come before it at the same pace
            before = self._newest if self._ages else 2.0 * look.time - now
            self._ages.append(now - before)
            self._number, self._newest = look.number, max(self._newest, look.time)
            self._times.append(now)
        return looks

    def _align(self, sim: Simulation) -> None:
        """Bodies that are seen go where they are; the others stay as they were simulated, unless those are there."""
        self._aligned = False
        seen = [body for body in self.bodies if body.seen and body.pose is not None]
        if not seen:
            return
        model = sim.model
        position = sim.state.position.numpy().astype(float)
        orientation = sim.state.orientation.numpy().astype(float) if model.features.rigid else None
        for body in seen:
            assert body.pose is not None
            position[:, body.index] = body.pose.belief.position
            if orientation is not None and body.rigid:
                orientation[:, body.index] = body.pose.belief.orientation
        if self._overlaps is None:
            order = sorted((b.index for b in self.bodies), key=lambda n: model.scene.bodies[n].kind == "cell")
            self._overlaps = Overlaps(model.scene, np.asarray(model.reference, dtype=float), order)
        if model.features.contacts:
            turns = None if orientation is None else orientation[0]
            moved, left = self._overlaps.part(position[0], turns, {body.index for body in seen})
            self.parted += moved > 0
            if left > MOST_LEFT:
                # estimates that leave no room for what is between: the simulation knows better, for this turn
                self.clashes += 1
                return
        sim.set_state(position=position, orientation=orientation)
        self._aligned = True

    def _forget(self, now: float) -> None:
        """Commands that no tracker will ask for any more."""
        oldest = [body.tracker.oldest for body in self.bodies]
        known = [time for time in oldest if time is not None]
        self._commands.forget(min(known) if len(known) == len(oldest) and known else now - 60.0)
        while self._times and self._times[0] < now - RATE_OVER:
            self._times.pop(0)

    def _note(self, now: float, entered: float) -> None:
        """What the stages of the new frames took; `publish` is still open. On a virtual clock nothing takes time."""
        self._updated = self._clock.now()
        if not isinstance(self._clock, RealClock):
            return
        source = "rendering" if self._looker.info.simulated else "readout"
        for look in self._looks:
            # a stamp that no body believes says nothing about how long its light took
            if look.time < self._since or not any(body.dated(look.time, now) for body in self.bodies):
                continue
            half = 0.5 * look.exposure
            self._open.append({
                "exposure": half, source: max(look.sent - look.time - half, 0.0),
                "transport": max(look.read - look.sent, 0.0), "crop": look.crop, "estimate": look.estimate,
                "wait": max(now - look.done, 0.0), "twin": max(entered - max(now, look.done), 0.0),
                "filter": self._updated - entered,
            })  # fmt: skip

    def _rate(self) -> float:
        span = max((self._times[-1] - self._times[0]) if len(self._times) > 1 else 0.0, 1e-9)
        return (len(self._times) - 1) / span if len(self._times) > 1 else 0.0

    def _body_now(self, body: FollowedBody) -> BodyNow:
        deviation = None
        if body.pose is not None:
            x, y, z = np.sqrt(np.maximum(np.diag(body.pose.covariance)[:3], 0.0))
            deviation = (float(x), float(y), float(z))
        return BodyNow(
            body=body.index, name=body.name, why=body.why, deviation=deviation, **self._shown.get(body.index, {})
        )  # fmt: skip

    def _show(self, now: float) -> None:
        """Keep the newest pieces for whoever draws them, a few times a second, with what was made of them."""
        if not self._looks or now < self._shown_at + SHOWN_EVERY:
            return
        self._shown_at = now
        look = self._looks[-1]
        for body in self.bodies:
            for one in look.bodies:
                if one.body == body.index and one.piece.levels.size:
                    drawn = body.drawn(one.piece, look.time)
                    self._shown[body.index] = {"levels": one.piece.levels, "outline": drawn[0], "spread": drawn[1]}
