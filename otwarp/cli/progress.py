"""A bar with the time left, for work that is done in parts and goes on where it was stopped."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

from otwarp.cli import stop

SELDOM = 30.0
"""Time [s] between two lines of a log, at least; they become as seldom as a hundredth of what is left."""


LONG = 2.0
"""Time [s] after which a command that is mostly quick says what it is doing."""


@contextmanager
def parts(one: str, several: str, *, after: float = 0.0) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, if that is a terminal, else a line now and then; at every part, end on SIGTERM.

    Args:
        one, several: What a part is called.
        after: Time [s] before which a log gets no line, and none at all if everything is done by then.

    Yields:
        What is to be called with parts done and parts in all.
    """
    if not sys.stderr.isatty():
        yield _Lines(one, after)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(several), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True, highlight=False), transient=True) as bar:
        task = bar.add_task(several, total=None)

        def update(done: int, count: int) -> None:
            """Move the bar."""
            stop.check()
            bar.update(task, completed=done, total=count)

        yield update


@contextmanager
def said_if_long(line: str, after: float = LONG) -> Iterator[None]:
    """Say a line on standard error if the block takes longer than that [s]."""
    timer = threading.Timer(after, lambda: click.echo(f"otwarp: {line}", err=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Lines:
    """Lines of a log: the first part, the last one, and some between them, with the time that is left."""

    def __init__(self, one: str, after: float):
        self.one = one
        self.first: tuple[float, int] | None = None
        self.due = self.begins = time.monotonic() + after

    def __call__(self, done: int, count: int) -> None:
        stop.check()
        now = time.monotonic()
        self.first = self.first or (now, done)
        begun, before = self.first
        if now < self.begins or (now < self.due and done < count):
            return
        left = (now - begun) * (count - done) / (done - before) if done > before else None
        said = "" if not left else f", {spelled(left)} left" + f" (about {time.strftime('%H:%M', _after(left))})"
        click.echo(f"otwarp: {self.one} {done} of {count}{said}", err=True)
        # after the first lines that know something, seldom
        self.due = now + (0.0 if left is None else max(SELDOM, 0.01 * left))


def _after(seconds: float) -> time.struct_time:
    """Local time after so many seconds."""
    return time.localtime(time.time() + seconds)


def spelled(seconds: float) -> str:
    """A time as people say it: `3.2 h`, `40 min`, `12 s`."""
    for size, name in ((86_400.0, "d"), (3_600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.1f} {name}"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.2g} s"
