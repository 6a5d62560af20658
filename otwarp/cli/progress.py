"""A bar with the time left, for work that is done in parts and goes on where it was stopped."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

from otwarp.cli import stop


@contextmanager
def parts(one: str, several: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, if that is a terminal, else a line for each; at every part, end on SIGTERM.

    Args:
        one, several: What a part is called.

    Yields:
        What is to be called with parts done and parts in all.
    """
    if not sys.stderr.isatty():

        def say(done: int, count: int) -> None:
            stop.check()
            click.echo(f"otwarp: {one} {done} of {count}", err=True)

        yield say
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
