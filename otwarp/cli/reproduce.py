"""`otwarp reproduce`: every table and figure of the paper, ours beside theirs, as one report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, json_option, seed_option
from otwarp.cli.types import FILE, OutputPath
from otwarp.errors import InputError
from otwarp.files import check_place

if TYPE_CHECKING:
    from otwarp.reproduce.runner import Report


@click.command()
@click.option("-o", "--out", type=OutputPath(folder=True, check=False), metavar="DIR",
              help="Folder of the report, new or one to go on with: report.html, figures, numbers.")  # fmt: skip
@click.option("--quick", is_flag=True, help="Minutes on two cores: fewer trials, a reduced network table.")
@click.option("--only", multiple=True, metavar="NAME",
              help="This item of --list, by name or as fig6, table2: the report's own numbers, which are not the "
                   "paper's; several times for several.")  # fmt: skip
@click.option("--list", "as_list", is_flag=True, help="Print the items and what each shows, and do nothing.")
@click.option("--scenes", type=FILE, default="scenes", show_default=True, help="Folder of the shipped scenes.")
@click.option("--docs", type=OutputPath(), metavar="FILE",
              help="Write the report that is in DIR as a page of Markdown, and compute nothing.")  # fmt: skip
@seed_option
@device_option
@json_option
def reproduce(
    out: Path | None,
    quick: bool,
    only: tuple[str, ...],
    as_list: bool,
    scenes: Path,
    docs: Path | None,
    seed: int,
    device: str | None,
    as_json: bool,
) -> None:
    """Regenerate every table and figure of the paper, ours beside theirs.

    Items that are done are kept: the same line goes on after whatever ended it. The full report belongs on a GPU, for
    the networks and the simulated operators.
    """
    if as_list:
        _list(as_json)
        return
    if out is None:
        raise InputError("--out is missing; allowed: a folder for the report, or --list")
    if docs is not None:
        _write_docs(out, docs)
        return
    check_place(out, "--out", folder=True)  # not for --docs, which reads it
    from otwarp.reproduce.numbering import chosen, told
    from otwarp.reproduce.runner import reproduce as reproduced

    asked = {item.name for item in chosen(only)}
    for line in told(only):
        click.echo(f"otwarp: {line}", err=True)
    stop.begin()

    def say(line: str) -> None:
        stop.check()
        click.echo(f"otwarp: {line}", err=True)

    found = reproduced(out, names=only, quick=quick, device=device, scenes=scenes, seed=seed, say=say)
    if only and found.missing:
        raise InputError("; ".join(f"--only is {name}, which {why}" for name, why in found.missing.items()))
    _print(found, asked, as_json)


def _list(as_json: bool) -> None:
    from otwarp.reproduce.numbering import FIGURES, TABLES, numbers_said
    from otwarp.reproduce.registry import ITEMS

    if as_json:
        said = {name: {"title": i.title, "about": i.about, "figures": [*FIGURES[name]], "tables": [*TABLES[name]]}
                for name, i in ITEMS.items()}  # fmt: skip
        click.echo(json.dumps(said, indent=2, ensure_ascii=False))
        return
    width, numbers = max(map(len, ITEMS)), {name: numbers_said(name) for name in ITEMS}
    wide = max(map(len, numbers.values()))
    for name, item in ITEMS.items():
        click.echo(f"{name:<{width}}  {numbers[name]:<{wide}}  {item.about}")


def _write_docs(out: Path, docs: Path) -> None:
    from otwarp.reproduce.document import write_page
    from otwarp.reproduce.runner import done_in

    store, done = done_in(out)
    click.echo(f"wrote {write_page(docs, store, done)}")


def _print(found: Report, asked: set[str], as_json: bool) -> None:
    if as_json:
        seconds = {one.name: round(one.seconds, 1) for one in found.done}
        click.echo(json.dumps({"report": str(found.page), "seconds": seconds, "missing": found.missing}, indent=2,
                              ensure_ascii=False))  # fmt: skip
        return
    from otwarp.reproduce.numbering import numbers_said
    from otwarp.reproduce.parts import how_long
    from otwarp.reproduce.report import took

    for one in found.done:
        if one.name not in asked:
            continue
        click.echo(f"{one.title}: {numbers_said(one.name)} ({how_long(one.parts)})")
        for row in one.result.comparisons:
            unit = f" [{row.unit}]" if row.unit else ""  # behind a value it would also be behind words
            click.echo(f"    {row.what}{unit}: paper {row.paper.said()}, ours {row.ours.said()}")
    for name, why in found.missing.items():
        click.echo(f"{name} was left out: {why}")
    click.echo(took(found.done))
    click.echo(f"wrote {found.page}")
