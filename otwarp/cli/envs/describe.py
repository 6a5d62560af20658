"""`otwarp envs describe`: say what an environment observes, does, earns, and how it ends."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.envs.options import task_options
from otwarp.cli.options import json_option, out_option
from otwarp.cli.output import json_text, tables_console
from otwarp.errors import InputError
from otwarp.files import written


@click.command()
@click.argument("name", required=False)
@task_options
@out_option("FILE.md", "Write the tables as Markdown instead.")
@json_option
def describe(name: str | None, option: tuple[str, ...], out: Path | None, as_json: bool) -> None:
    """Say what the environment NAME observes, does, earns, and how its episodes end, with units and scales.

    NAME may be a scene with a goal, too. Without it: all that are shipped.
    """
    from otwarp.envs.describe import described, page
    from otwarp.envs.registration import TASKS, task_named
    from otwarp.envs.written_options import options_of

    if option and name is None:
        raise InputError("--option without NAME; allowed: both")
    tasks = [task_named(name, **options_of(name, option))] if name else [task_named(one) for one in TASKS]
    if out is not None:
        with written(out) as part:
            part.write_text(page(tasks), encoding="utf-8")
        click.echo(f"wrote {out}", err=as_json)
    shown = [described(task) for task in tasks]
    if as_json:
        click.echo(json_text(shown[0] if name else shown))
    elif out is None:
        for one in shown:
            _print(one)


def _print(shown: dict[str, Any]) -> None:
    """Tables for people."""
    from rich.markup import escape
    from rich.table import Table

    from otwarp.envs.describe import facts, heads, table

    console = tables_console(120)
    console.print(f"{shown['name']}: {shown['description']}\n{facts(shown)}", highlight=False, soft_wrap=True)
    for which, (first, middle, last) in heads(shown).items():
        rows = Table(box=None, pad_edge=False, header_style="bold")
        rows.add_column(first, no_wrap=True)
        rows.add_column(middle, justify="right", no_wrap=True)
        rows.add_column(last)
        for row in table(shown, which):
            rows.add_row(*map(escape, row))  # units in brackets are no styles
        console.print()
        console.print(rows)
    console.print()
