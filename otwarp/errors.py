"""What a user meets: bad input, input that is implausible, and a run that had to stop."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager


class InputError(ValueError):
    """A scene, argument or file that otwarp cannot accept.

    The message is one line that names the file, prim, attribute or argument, its value and the allowed range.
    The command line prints it and exits with code 2.
    """


@contextmanager
def in_one_line(program: str) -> Iterator[None]:
    """In a script: bad input is one line on standard error, which begins with the program's name, and exit code 2.

    Raises:
        SystemExit: Instead of an `InputError`.
    """
    try:
        yield
    except InputError as error:
        print(f"{program}: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def is_full_memory(error: BaseException) -> bool:
    """Whether an error of torch or Warp, which are not imported here, says that the memory of a device is full."""
    return isinstance(error, RuntimeError) and (
        type(error).__name__ == "OutOfMemoryError" or str(error).startswith("Failed to allocate")
    )


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


def nearest(name: str, known: Sequence[str], *, shown: int = 12) -> str:
    """What ends the message about an unknown name: `; did you mean …?` of a known one like it, else what is allowed.

    Args:
        name: The unknown one.
        known: Those that there are.
        shown: How many of them are listed at most.
    """
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if not near:  # `index` for `refractive_index`
        near = [one for one in known if len(name) > 2 and name.lower() in one.lower()]
    if near:
        return f"; did you mean {near[0]}?"
    rest = f", … ({len(known)} of them)" if len(known) > shown else ""
    return f"; allowed: {', '.join(known[:shown])}{rest}" if known else ""
