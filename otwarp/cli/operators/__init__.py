"""`otwarp operators`: simulated operators at a scene's task; one module for every command.

`run` computes a study, `sweep` one over delays and errors of perception, `show` says what either has found: a command
each, which asks `otwarp.operators` (open `run` first); `show_sweep` prints a sweep.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "run": "Let simulated operators do a scene's task, with and without haptics.",
    "sweep": "The same over delays and errors of perception: what they do to force and delivery.",
    "show": "Print or draw what simulated operators have done.",
}
"""Commands and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS)
def operators() -> None:
    """Simulated operators: models of people at haptic devices, thousands at once; nobody was measured."""
