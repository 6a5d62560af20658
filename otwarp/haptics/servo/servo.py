"""What the servo does in each cycle: device → chain → device → mailbox, for each side, and what it does when they fail.

A function of a clock, devices, chains and mailboxes only, so that tests run it on a virtual clock in their own process;
`process` runs it at 1 kHz in a process of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from otwarp.errors import InputError
from otwarp.haptics.core import ENDING, SILENT, ZERO
from otwarp.haptics.core.realtime import Clock, next_deadline
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.servo.guard import SILENCE as GUARD_SILENCE
from otwarp.haptics.servo.guard import GuardReport
from otwarp.haptics.servo.hand import Hand
from otwarp.haptics.servo.link import Orders, SceneReader, ServoStatus

PARENT_SILENCE = 1.0
"""Seconds without orders after which all sides disarm; longer than a scene takes to pause."""
DISARM_AFTER = 0.1
"""Seconds between two cycles from which on all sides disarm, unless said otherwise."""
LAST_CYCLES = 0.2
"""Seconds that the chains have to bring their forces to zero before they are cut; their watchdogs need 0.1 s."""
STATUS_EVERY = 10
"""Cycles between two reports to the parent."""
WINDOW = 1.0
"""Seconds over which the worst lateness is kept."""


class Servo:
    """The loop of all sides.

    Args:
        clock: Of all times.
        hands: Left and right, or one; opened by `open`.
        scenes: What the simulation says.
        orders: What the parent says.
        status: Takes a `ServoStatus` every `STATUS_EVERY` cycles.
        rate: Cycles per second [Hz].
        orphaned: Whether the parent has died; asked in every report.
        grants: What the operating system gave, for the status.
        disarm_after: Seconds between two cycles from which on all sides disarm: the least of their configurations.
        guard: What the guardian says; None for sides that need none.
    """

    def __init__(
        self,
        clock: Clock,
        hands: Sequence[Hand],
        scenes: SceneReader,
        orders: Mailbox[Orders],
        status: Mailbox[ServoStatus],
        *,
        rate: float = 1000.0,
        orphaned: Callable[[], bool] = lambda: False,
        grants: str = "",
        disarm_after: float = DISARM_AFTER,
        guard: Mailbox[GuardReport] | None = None,
    ):
        self._clock, self._hands, self._scenes, self._orders, self._status = clock, hands, scenes, orders, status
        self._period, self._orphaned, self._grants = 1.0 / rate, orphaned, grants
        self._obeyed = Orders(0, (0,) * len(hands), (0,) * len(hands))
        self._disarm_after, self._guard = disarm_after, guard
        self._watched: GuardReport | None = None
        self._heard = self._cycled = self._guarded = clock.now()
        self._slept = clock.suspended()
        self._silent = False
        self._end_at = math.inf
        self._state = "starting"
        self._worst, self._worst_until = 0.0, 0.0
        self.tick, self.late = 0, 0

    def run(self) -> None:
        """Open the devices, run until ordered to stop or orphaned, and leave every device at zero force.

        Raises:
            InputError: A device is not there; those opened before are released.
        """
        clock = self._clock
        self._heard = clock.now()
        try:
            for hand in self._hands:
                hand.open()
            self._state = "running"
            deadline = self._cycled = self._guarded = clock.now()
            while not self._over(clock.now()):
                self.cycle()
                deadline, missed = next_deadline(deadline, self._period, clock.now())
                self.late += missed
                clock.sleep_until(deadline)
                self._note(clock.now(), deadline)
        except Exception as error:
            self._state, self._grants = "failed", str(error) if isinstance(error, InputError) else repr(error)
            raise
        finally:
            now = clock.now()
            for hand in self._hands:
                hand.release(now)
            self._state = "stopped" if self._state != "failed" else "failed"
            self._report(now)

    def cycle(self) -> None:
        """One cycle: orders, scene, hands, report."""
        now = self._clock.now()
        self.tick += 1
        gap = self._note_gap(now)
        self._listen(now, may_arm=not gap)
        self._heed_guardian(now)
        scene = self._scenes.latest()
        for hand in self._hands:
            hand.cycle(now, scene, self.tick)
        if self.tick % STATUS_EVERY == 1:
            if self._orphaned():
                self.end(now)
            self._report(now)

    def end(self, now: float | None = None) -> None:
        """Disarm all sides and stop once their forces are zero, or after `LAST_CYCLES`."""
        if self._end_at == math.inf:
            self._end_at = (self._clock.now() if now is None else now) + LAST_CYCLES
            self._state = "ending"
            for hand in self._hands:
                hand.disarm(action=ENDING)

    def _note_gap(self, now: float) -> bool:
        """Disarm at once if too much time has passed since the last cycle: stopped, swapped out, or a machine asleep.

        The hand was somewhere else meanwhile, and so was the scene: a force that goes on from there would be a blow.
        """
        slept = self._clock.suspended()
        away = now - self._cycled + slept - self._slept
        asleep, self._cycled, self._slept = slept - self._slept > 0.5 * away, now, slept
        if away < self._disarm_after:
            return False
        who = "the machine was suspended" if asleep else "the servo stood still"
        self._guarded = now  # the guardian may have stood still as well
        for hand in self._hands:
            hand.stand(now, f"disarmed: {who} for {away:.2g} s; arm it again")
        return True

    def _heed_guardian(self, now: float) -> None:
        """Disarm the sides that need a guardian when the one that watched them is silent, replaced, or not ready."""
        if self._guard is None:
            return
        was, report = self._watched, self._guard.read()
        if report is not None:
            self._watched, self._guarded = report, now
        elif was is not None and now - self._guarded > GUARD_SILENCE:
            self._watched = None
        if was is None or was is self._watched:
            return
        for i, hand in enumerate(self._hands):
            if hand.guarded and was.hands[i].ready == hand.opened and (why := self._unwatched(i, was.number)):
                hand.disarm(f"disarmed: {why}; arm it again", SILENT)

    def _unwatched(self, i: int, number: int) -> str:
        """Why the guardian of this number does not watch a side any more, or "".

        Another that speaks in its place was started after it had died, and may not be ready: a hand is never handed on.
        """
        if self._watched is None:
            return f"no word of its guardian for {GUARD_SILENCE:g} s"
        if self._watched.number != number:
            return "its guardian ended, and another takes its place"
        return "" if self._is_watched(i) else "its guardian is not ready any more"

    def _is_watched(self, i: int) -> bool:
        """Whether the guardian is ready for the device of a side as it was last opened."""
        return self._watched is not None and self._watched.hands[i].ready == self._hands[i].opened

    def _listen(self, now: float, may_arm: bool) -> None:
        """Obey the parent; disarm when it has been silent for too long. What was armed in a gap stays disarmed."""
        orders = self._orders.read()
        if orders is None:
            if now - self._heard > PARENT_SILENCE and not self._silent:
                self._silent = True
                for hand in self._hands:
                    hand.disarm(f"disarmed: no orders for {PARENT_SILENCE:g} s", SILENT)
            return
        self._heard, self._silent = now, False
        was, self._obeyed = self._obeyed, orders
        for i, hand in enumerate(self._hands):
            if orders.recording != was.recording:
                hand.record(orders.recording, self.tick, self._scenes.scene)
            hand.set_gains(*(orders.gains[i] if orders.gains else (None, None)))
            if orders.disarm[i] != was.disarm[i]:  # wins over arming
                hand.disarm()
            elif orders.arm[i] != was.arm[i] and self._end_at == math.inf and may_arm:
                hand.arm(self._is_watched(i))
        if orders.stop:
            self.end(now)

    def _over(self, now: float) -> bool:
        if self._end_at == math.inf:
            return False
        return now >= self._end_at or all(hand.force == ZERO for hand in self._hands)

    def _note(self, now: float, deadline: float) -> None:
        """Keep the worst lateness of the last second."""
        lateness = now - deadline
        if lateness > self._worst or now > self._worst_until:
            self._worst, self._worst_until = lateness, now + WINDOW

    def _report(self, now: float) -> None:
        hands = tuple(hand.status for hand in self._hands)
        scenes, state = self._scenes, self._state
        self._status.write(
            ServoStatus(self.tick, now, state, self.late, self._worst, scenes.refused, scenes.torn, hands, self._grants)
        )
