"""The option that commands on environments share."""

from __future__ import annotations

import click

task_options = click.option(
    "--option", multiple=True, metavar="NAME=VALUE", help="An option of the task, as strategy=B; may be given again."
)
"""Options of the task, as texts."""
