"""What operators command, and what they see of the state of their devices.

`Hands` sends the servo scenes and takes in commanded traps and forces; `TrapCommands` is what hands, gizmos and
programs together command of the traps, written in one go.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, SceneFrame, ServoFrame, Vec3
from otwarp.haptics.servo.link import ServoStatus
from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation
from otwarp.teleop import HandFrame, vec3
from otwarp.teleop.operators import HandPlan
from otwarp.teleop.operators.servo import ServoLike

FARTHEST = 1e6
"""Micrometres from the origin beyond which no trap is put: a metre."""
GENTLE = 30.0
"""Fastest that a gentle move goes, in µm per simulated second.

In water (0.89 mPa·s) the drag 6πηav on a sphere of radius 1 µm is 0.5 pN at this speed, and on the five spheres of a
robot less than five times that, shared by the traps that hold it. Traps of 10 pN/µm let go at a few pN."""


def cause_of(message: str) -> str:
    """A message without its numbers, their signs and exponents, which may change many times a second."""
    return re.sub(r"[-+]?\b(\d[\d.]*(e[-+]?\d+)?|nan|inf)\b", "", message)


class Hands:
    """The hands of a session.

    Args:
        plans: As asked for.
        servo: Runs their chains, in their order; None without hands.

    Attributes:
        frames: Each hand as last heard of.
        status: The servo's last report.
        law: What computes the forces, for the user; "" for unknown.
    """

    def __init__(self, plans: Sequence[HandPlan], servo: ServoLike | None):
        self._servo = servo
        self._names = [plan.name for plan in plans]
        self._dead = False
        self._armed = [False] * len(self._names)
        self._notes = [""] * len(self._names)
        self._reported = [""] * len(self._names)
        self._blind = [False] * len(self._names)
        self._resume = [False] * len(self._names)
        self._ordered = [False] * len(self._names)
        self._causes: list[set[str]] = [set() for _ in self._names]
        self.status: ServoStatus | None = None
        self.engine = ""
        self.frames: tuple[HandFrame, ...] = tuple(
            HandFrame(
                name=plan.name,
                device=plan.device,
                traps=plan.config.traps,
                motion_gain=plan.config.motion_gain,
                force_gain=plan.config.force_gain,
                clamp=plan.config.safety.clamp,
            )
            for plan in plans
        )

    @property
    def servo(self) -> ServoLike | None:
        """What runs the chains."""
        return self._servo

    def start(self) -> None:
        """Open the devices and run the servo.

        Raises:
            InputError: A device is not there.
        """
        if self._servo is not None:
            self.status = self._servo.start()

    def listen(self) -> dict[int, Vec3]:
        """Take in what the servo says; returns the traps that hands command now [µm]."""
        servo = self._servo
        if servo is None:
            return {}
        self.status = status = servo.status()
        # the session goes on without hands when their servo has ended
        self._dead = self._dead or not servo.alive
        frames = []
        for n, frame in enumerate(self.frames):
            reported = status.hands[n] if status else None
            now, residue = servo.hand(n), servo.residue(n)
            self._notice(n, now)
            message = reported.message if reported and reported.message else self._notes[n]
            if residue is not None:
                message = residue.message
                if now is not None and residue.zero:  # what the servo sent last is not there any more
                    now = replace(now, force=ZERO, state="disarmed")
            present = reported is not None and reported.present and residue is None
            # a device that went away while its body was not seen comes back as after any loss: disarmed
            gone = reported is not None and not present
            self._resume[n], self._ordered[n] = self._resume[n] and not gone, self._ordered[n] and not gone
            frames.append(replace(frame, now=now, present=present, message=message))
        self.frames = tuple(frames)
        if self._dead:
            return {}
        return {trap: place for frame in frames if frame.now for trap, place in frame.now.traps}

    def _notice(self, n: int, now: ServoFrame | None) -> None:
        """Keep in mind that a hand was disarmed without an order: by its watchdog, unless the servo says why."""
        if now is None:
            return
        armed = now.state in ("ramping", "armed", "decaying")
        if self._blind[n]:
            self._armed[n] = armed  # it was let go, and its note says of what
            return
        if self._resume[n] and now.state in ("decaying", "disarmed") and not self._dead:
            # not before it is seen to let go: of both orders in one cycle of the servo, that to let go wins
            self._order_arm(n)
        elif self._armed[n] and now.state == "disarmed":
            nobody = self.frames[n].device == "mouse" and not now.buttons
            why = "no window of the page holds it" if nobody else "no fresh state of simulation or device for 0.1 s"
            self._notes[n] = f"disarmed, for {why}; arm it again"
        elif now.state in ("ramping", "armed"):
            self._notes[n], self._ordered[n] = "", False
        self._armed[n] = armed

    def _order_arm(self, n: int) -> None:
        assert self._servo is not None
        self._servo.arm(n)
        self._resume[n], self._ordered[n] = False, True

    def news(self) -> list[str]:
        """What each hand has to say that it did not say before, one line each.

        What it holds may come and go several times a second, for one cause or for several by turns: each is said once.
        """
        lines = []
        for n, hand in enumerate(self.frames):
            if hand.message != self._reported[n]:
                self._reported[n] = hand.message
                cause = cause_of(hand.message) if self._blind[n] else ""
                if hand.message and cause not in self._causes[n]:
                    lines.append(f"{hand.name} hand: {hand.message}")
                if cause:
                    self._causes[n].add(cause)
        return lines

    def publish(self, scene: SceneFrame | None) -> None:
        """A new state of the simulation, or word that the session lives."""
        if self._servo is None or self._dead:
            return
        if scene is None:
            self._servo.heartbeat()
        else:
            self._servo.publish(scene)

    def arm(self, hand: str | None = None, on: bool = True) -> None:
        """Let hands push, or no more; None for all.

        Raises:
            InputError: No such hand.
        """
        indices = [self._index(hand)] if hand is not None else range(len(self._names))
        if self._servo is None or self._dead:
            return
        for n in indices:
            if self._blind[n]:
                self._resume[n] = on  # it is armed once what it holds is seen
                continue
            if on:
                self._order_arm(n)
            else:
                self._servo.disarm(n)
                self._resume[n] = self._ordered[n] = False
            self._armed[n], self._notes[n] = False, ""

    def withhold(self, traps: Mapping[int, str]) -> None:
        """Let the forces of hands fall that move one of these traps; the others' come back by the ramp.

        Args:
            traps: Whose bodies a camera should see and does not, and why, one line each.
        """
        if self._servo is None or self._dead:
            return
        for n, frame in enumerate(self.frames):
            why = next((line for trap, line in traps.items() if trap in frame.traps), "")
            if why and not self._blind[n]:
                # one that was ordered to be armed, and is not yet, is to come back as well
                self._resume[n] = self._armed[n] or self._resume[n] or self._ordered[n]
                self._armed[n] = self._ordered[n] = False
                self._servo.disarm(n)
            note = f"feels nothing until it is seen again: {why}" if why else ""
            if cause_of(note) != cause_of(self._notes[n]) and (why or self._blind[n]):
                self._notes[n] = note
            self._blind[n] = bool(why)

    def set_gains(self, hand: str, motion_gain: float | None, force_gain: float | None) -> None:
        """Change gains in mid-run [µm/m, N/pN].

        Raises:
            InputError: No such hand, or a gain out of range.
        """
        n = self._index(hand)
        if self._servo is None or self._dead:
            return
        self._servo.set_gains(n, motion_gain, force_gain)
        given = {"motion_gain": motion_gain, "force_gain": force_gain}
        changed = replace(self.frames[n], **{k: v for k, v in given.items() if v is not None})
        self.frames = (*self.frames[:n], changed, *self.frames[n + 1 :])

    @property
    def died(self) -> bool:
        """Whether the servo ended by itself."""
        return self._dead

    def stop(self) -> None:
        """Let the forces fall, end the servo; may be called more than once."""
        if self._servo is not None:
            self._servo.stop()
            self.status = self._servo.status()

    def _index(self, hand: str) -> int:
        if hand not in self._names:
            allowed = ", ".join(self._names) or "none, for this session has no hand with a device"
            raise InputError(f"hand is {hand!r}; allowed: {allowed}")
        return self._names.index(hand)


class TrapCommands:
    """Positions [µm] and powers [mW] of all traps.

    A trap that no hand has stays with its time samples, if it has any, until it is moved for the first time; a hand's
    trap stands where it was authored at the start.

    A gentle move gives traps a goal. `advance` takes them there; traps of one such move stay in step, so that what they
    hold together is not torn. The last word counts: another move or a shift drops the goal (a shift starts where the
    trap is by then), and so does a hand that takes the trap.

    Args:
        scene: Of the session.
        hands: Traps that hands with a device move.
    """

    def __init__(self, scene: Scene, hands: Iterable[int]):
        self._scene = scene
        self._hands = frozenset(hands)
        self._held: frozenset[int] = frozenset()
        self._start()

    def _start(self) -> None:
        traps = self._scene.traps
        self.position = np.array([t.position.at(0.0) for t in traps], dtype=float).reshape(-1, 3)
        self.power = np.array([t.power.at(0.0)[0] for t in traps], dtype=float)
        self._follows = np.array(
            [
                (t.position.animated and t.hand == "none" and n not in self._hands) + 2 * t.power.animated
                for n, t in enumerate(traps)
            ],
            dtype=int,
        )
        self._ways: list[dict[int, np.ndarray]] = []  # trap → goal; one for each gentle move
        self._written, self._written_follows = self.position.copy(), np.full(len(traps), -1)
        self._changed = True

    def restart(self) -> None:
        """Command what the scene says, once more."""
        self._held = frozenset()
        self._start()

    def hold(self, traps: Iterable[tuple[int, Vec3]]) -> None:
        """What hands command now; no other may move these traps."""
        held = dict(traps)
        self._held = frozenset(held)
        self.move(held, by_hand=True)

    def move(self, positions: Mapping[int, Vec3], *, by_hand: bool = False, gently: bool = False) -> None:
        """Put traps somewhere, or gently let them go there; those that a hand holds stay with it.

        Raises:
            InputError: A trap that is not there, or a place that is not finite; nothing is moved.
        """
        self._check(positions)
        for place in positions.values():
            if not all(math.isfinite(x) and abs(x) <= FARTHEST for x in place):
                raise InputError(f"trap position is {tuple(place)!r}; allowed: finite, within ±{FARTHEST:g} µm")
        free = {trap: place for trap, place in positions.items() if by_hand or trap not in self._held}
        self._drop_goals(free)
        if gently and free:
            self._ways.append({trap: np.array(place, dtype=float) for trap, place in free.items()})
        for trap, place in free.items():
            self._changed |= bool(self._follows[trap] & 1)
            self._follows[trap] &= 2
            if not gently and tuple(self.position[trap]) != tuple(place):
                self.position[trap] = place
                self._changed = True

    @property
    def goals(self) -> dict[int, Vec3]:
        """Where gently moved traps that have not arrived are going: index → focus [µm]."""
        return {trap: vec3(goal) for way in self._ways for trap, goal in way.items()}

    def advance(self, seconds: float) -> None:
        """Take gently moved traps towards their goals: as far as so much simulated time [s] allows, and no farther."""
        if seconds <= 0.0:
            return
        for way in self._ways:
            left = {trap: goal - self.position[trap] for trap, goal in way.items()}
            # the one that takes longest decides for all, so that they keep in step
            longest = max((float(np.linalg.norm(d)) / self._fastest(trap) for trap, d in left.items()), default=0.0)
            there = longest <= seconds
            for trap, goal in way.items():
                self.position[trap] = goal if there else self.position[trap] + seconds / longest * left[trap]
            self._changed |= longest > 0.0
            if there:
                way.clear()
        self._ways = [way for way in self._ways if way]

    def shift(self, traps: Sequence[int], by: Vec3) -> None:
        """Move traps at once by the same displacement [µm] from where they are; none of them goes on to a goal.

        Raises:
            InputError: As `move`.
        """
        self._check(traps)
        self.move({trap: vec3(self.position[trap] + np.asarray(by, dtype=float)) for trap in traps})

    def set_power(self, sim: Simulation, power: float, traps: Sequence[int] = ()) -> None:
        """Power of traps [mW], of all if none is named; written at once, for the simulation may refuse it.

        Raises:
            InputError: A trap that is not there, or a power that the time step cannot carry.
        """
        self._check(traps)
        chosen = list(traps) or list(range(len(self.power)))
        wanted, follows = self.power.copy(), self._follows.copy()
        wanted[chosen] = power
        follows[chosen] &= 1
        sim.control.set(trap_power=wanted, follow=follows)
        self.power, self._follows = wanted, follows

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """(T, 3) positions [µm] and (T) powers [mW] that are commanded at a simulated time [s]."""
        position, power = self.position.copy(), self.power.copy()
        for n, trap in enumerate(self._scene.traps):
            if self._follows[n] & 1:
                position[n] = trap.position.at(time)
            if self._follows[n] & 2:
                power[n] = trap.power.at(time)[0]
        return position, power

    @property
    def changed(self) -> bool:
        """Whether the simulation does not know yet what is commanded."""
        return self._changed

    def write(self, sim: Simulation, share: float = 1.0) -> None:
        """Write into the simulation, if anything changed: a share of the way from what was written before."""
        if not self._changed or not len(self.position):
            return
        place = self._written + share * (self.position - self._written) if share < 1.0 else self.position.copy()
        if np.any(self._follows) or not np.array_equal(self._follows, self._written_follows):
            sim.control.set(trap_position=place, follow=self._follows)
            self._written_follows = self._follows.copy()
        else:
            # checked by `move`, and following nothing already: some ten times in each turn of the loop
            sim.control.write({"trap_position": place[None]}, np.zeros(0, dtype=np.int32))
        if share >= 1.0:
            self._written, self._changed = place, False

    def note(self, position: np.ndarray) -> None:
        """Where the traps that follow their time samples are, so that moving them begins there; (T, 3) [µm]."""
        following = (self._follows & 1).astype(bool)
        self.position[following] = self._written[following] = position[following]

    def _fastest(self, trap: int) -> float:
        return min(GENTLE, self._scene.traps[trap].speed_limit)

    def _drop_goals(self, traps: Iterable[int]) -> None:
        if self._ways:
            gone = frozenset(traps)
            ways = ({trap: goal for trap, goal in way.items() if trap not in gone} for way in self._ways)
            self._ways = [way for way in ways if way]

    def _check(self, traps: Iterable[int]) -> None:
        for trap in traps:
            if not 0 <= trap < len(self.power):
                raise InputError(f"trap is {trap!r}; allowed: 0 to {len(self.power) - 1}")
