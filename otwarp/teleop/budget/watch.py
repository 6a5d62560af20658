"""What the machine carries while a session runs: its load changes, and what was measured before is not kept for ever.

A speed can change at once. Bodies that froze or left, and an accuracy that was lowered, come back with a new session
alone; where they would fit, that is said.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from otwarp.teleop.budget import round_down
from otwarp.teleop.budget.report import BudgetReport

if TYPE_CHECKING:
    from otwarp.teleop.core import PaceNow

HOLD = 5.0
"""Seconds for which the machine must carry another speed before that one is taken."""
BEHIND = 0.95
"""Part of its speed below which a session slips."""
WORTH = 1.1
"""Speed over the present one from which on it is worth a change."""
SLOWEST = 0.01
"""Simulated seconds per second below which no session goes."""


class BudgetWatch:
    """Says at what speed a session is to go on, by what its loop takes.

    A simulated second costs busy/factor seconds of a core, so the budget carries share·factor/busy. More is taken up to
    the speed that was wanted; less, when the session slips, so that simulated time does not. A speed that somebody sets
    in the session is wanted from then on.

    Args:
        report: Of the search before the session.
        say: Takes lines for the user.
    """

    def __init__(self, report: BudgetReport, say: Callable[[str], None]):
        self._report, self._say = report, say
        self._wanted, self._set = report.speed_asked, report.speed
        self._since: float | None = None
        self._direction = 0
        self._told = False

    def __call__(self, now: float, pace: PaceNow) -> float | None:
        """The speed to go on at, None for the present one.

        Args:
            now: On the loop's clock [s].
            pace: Of the last second.
        """
        if pace.speed != self._set:
            self._wanted = self._set = pace.speed
            self._direction = 0
        if pace.paused or pace.factor <= 0.0 or pace.busy <= 0.0:
            self._direction = 0
            return None
        carried = round_down(self._report.share * pace.factor / pace.busy)
        slips = pace.factor < BEHIND * pace.speed
        target = max(min(carried, self._wanted), SLOWEST)
        rises = pace.speed < self._wanted and target >= min(WORTH * pace.speed, self._wanted)
        direction = -1 if slips and target < pace.speed else int(rises and not slips)
        if direction != self._direction or self._since is None:
            self._direction, self._since = direction, now
        if now - self._since < HOLD:
            return None
        self._since = now
        self._tell_of_the_whole(pace)
        if direction == 0:
            return None
        why = "carries more" if direction > 0 else "carries less than before the session"
        self._say(f"budget: this machine {why}: {target:g} simulated seconds per second from now on")
        self._set = target
        return target

    def _tell_of_the_whole(self, pace: PaceNow) -> None:
        """Once, when what was left out would fit: in proportion to what the reduced scene takes now."""
        report = self._report
        if self._told or not report.reduced or report.before is None or report.after is None:
            return
        expected = report.after.load(1.0, report.rate)
        ratio = pace.busy / pace.factor / expected if expected > 0.0 else math.inf
        if ratio * report.before.load(report.speed_asked, report.rate) <= report.share:
            self._told = True
            self._say("budget: this machine carries the whole scene by now; start the session anew to have it")
