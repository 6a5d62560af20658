"""`LazyGroup`: a command with subcommands, each imported only when it is called."""

from __future__ import annotations

import importlib
import keyword
from typing import Any

import click

from otwarp.errors import nearest


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

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; of an unknown one the nearest is named.

        Raises:
            click.UsageError: There is none of that name.
        """
        if args and not args[0].startswith("-") and args[0] not in self._rows:
            ctx.fail(f"No such command {args[0]!r}{nearest(args[0], list(self._rows), shown=len(self._rows))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self._rows.items()))
