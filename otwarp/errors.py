"""What a user meets: bad input, input that is implausible, and a run that had to stop."""

from __future__ import annotations


class InputError(ValueError):
    """A scene, argument or file that otwarp cannot accept.

    The message is one line that names the file, prim, attribute or argument, its value and the allowed range.
    The command line prints it and exits with code 2.
    """


class PlausibilityWarning(UserWarning):
    """What a scene says is allowed, yet implausible: the message names file, prim, value and what is usual.

    `warnings.simplefilter("error", otwarp.PlausibilityWarning)` makes it an error, `"ignore"` silences it.
    """


class SimulationError(RuntimeError):
    """A run that stopped because its state was no longer physical; the last good frame is kept.

    Attributes:
        world: Index of the world that failed.
        body: Prim path of the body that failed.
        step: Step at which it failed.
        time: Simulated time of that step [s].

    Args:
        reason: What was not physical, as the message begins.
    """

    def __init__(self, reason: str, *, world: int, body: str, step: int, time: float):
        super().__init__(f"{reason}: world {world}, body {body}, step {step} (t = {time:.6g} s); last good frame kept")
        self.world, self.body, self.step, self.time = world, body, step, time
