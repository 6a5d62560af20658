"""`otwarp bench`: what accuracy, speed and stability cost on this machine; one module for every benchmark.

`me`, `forces`, `integrators`, `speed`, `stability`, `terms`: a command each, which asks the room of its name in
`otwarp.bench` (open `speed` first). `options`: what they ask alike, and how they print.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "me": "What scenes of yours cost on this machine.",
    "forces": "Error against run time of every force model.",
    "integrators": "Error against run time of integrators, force models and precisions.",
    "speed": "Steps per second of typical scenes, beside other programs.",
    "terms": "What every term of the step costs, on and off.",
    "stability": "What happens to scenes that are hard to step.",
}
"""Benchmarks and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS)
def bench() -> None:
    """Measure what accuracy costs on this machine."""
