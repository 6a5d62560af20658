"""`otwarp scenes`: what comes with otwarp; one module for every command.

`list`: names and what they show. `copy`: one of them, to change it.
"""

from __future__ import annotations

import click

from otwarp.cli.lazy import LazyGroup

COMMANDS = {
    "list": "Name the shipped scenes, studies and data sets.",
    "copy": "Copy one of them, to change it.",
}
"""Commands and their one-line help; each lives in the module of its name and is imported when called."""


@click.group(cls=LazyGroup, package=__name__, rows=COMMANDS)
def scenes() -> None:
    """Shipped scenes, studies and data sets. Commands take a shipped scene by its name: `otwarp run cell_delivery`."""
