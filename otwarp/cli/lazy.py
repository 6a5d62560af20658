"""`LazyGroup`: a command with subcommands, each imported only when it is called."""

from __future__ import annotations

import importlib
import keyword
from typing import Any

import click


class LazyGroup(click.Group):
    """A group that knows its commands by name.

    Args:
        package: Where they live, dotted: each in the module of its name, under its name; `import` in `import_`.
        rows: Their one-line help, by name, in the order of the help.
        settings: Of `click.Group`.
    """

    def __init__(self, *, package: str, rows: dict[str, str], **settings: Any) -> None:
        super().__init__(**settings)
        self._package, self._rows = package, rows

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        return list(self._rows)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command, None for an unknown name."""
        if cmd_name not in self._rows:
            return None
        name = cmd_name + "_" * keyword.iskeyword(cmd_name)
        return getattr(importlib.import_module(f"{self._package}.{name}"), name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self._rows.items()))
