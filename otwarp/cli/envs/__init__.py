"""`otwarp envs`: environments of Gymnasium; one module for every command.

`list` names them, `describe` says what their numbers mean, `play` shows one: a command each, which asks
`otwarp.envs`; `options` is what they share. Open `describe` first.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "list": "Name the shipped environments.",
    "describe": "Say what an environment observes, does, earns, and how it ends.",
    "play": "Take an environment into your own hands, or watch a policy.",
}
"""Commands and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS)
def envs() -> None:
    """Environments of Gymnasium: tasks in scenes, thousands at once."""
