"""`otwarp haptics`: what concerns hands and their devices; one module for every command."""

from __future__ import annotations

import importlib

import click

COMMANDS = {
    "check": "Find devices, and measure the servo on this machine.",
    "config": "Print the hands' configuration, to change it.",
    "replay": "Feel a take again, and compare the forces bit for bit.",
}
"""Commands and their one-line help; each lives in `haptics_NAME` and is imported when called."""


class LazyHaptics(click.Group):
    """A group that knows its commands by name and imports one only when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command."""
        if cmd_name not in COMMANDS:
            return None
        return getattr(importlib.import_module(f"{__name__}_{cmd_name}"), cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyHaptics, invoke_without_command=True)
@click.pass_context
def haptics(context: click.Context) -> None:
    """Hands: their devices, their servo, their takes."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())
