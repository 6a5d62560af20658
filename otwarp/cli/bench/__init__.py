"""`otwarp bench`: what accuracy, speed and stability cost on this machine; one module for every benchmark."""

from __future__ import annotations

import importlib
import importlib.util

import click

COMMANDS = {
    "forces": "Error against run time of every force model.",
    "integrators": "Error against run time of integrators, force models and precisions.",
    "speed": "Steps per second of typical scenes, beside other programs.",
    "terms": "What every term of the step costs, on and off.",
    "stability": "What happens to scenes that are hard to step.",
}
"""Benchmarks and their one-line help; each lives in the module of its name and is imported when called."""


class LazyBenchmarks(click.Group):
    """A group that knows its commands by name and imports one only when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the benchmarks that this installation has."""
        return [name for name in COMMANDS if importlib.util.find_spec(f"{__name__}.{name}") is not None]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one benchmark."""
        if cmd_name not in self.list_commands(ctx):
            return None
        return getattr(importlib.import_module(f"{__name__}.{cmd_name}"), cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of benchmarks without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name]) for name in self.list_commands(ctx)])


@click.group(cls=LazyBenchmarks)
def bench() -> None:
    """Measure what accuracy costs on this machine."""
