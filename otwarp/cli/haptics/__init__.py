"""`otwarp haptics`: what concerns hands and their devices; one module for every command.

`check` (with its `tables`), `config`, `replay`: a command each. Open `check` first.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "check": "Find devices, and measure the servo on this machine.",
    "config": "Print the hands' configuration, to change it.",
    "replay": "Run a recording's chains again, and compare forces bit for bit.",
}
"""Commands and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS, invoke_without_command=True)
@click.pass_context
def haptics(context: click.Context) -> None:
    """Hands: their devices, their servo, their recordings."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())
