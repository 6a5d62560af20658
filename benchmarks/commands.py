"""How long each command of `otwarp` takes to start: processor time to its help, on docs/benchmarks/startup.md."""

from __future__ import annotations

import os
import subprocess
import sys

import click

from benchmarks.report import PAGES, Section, check_places, options, put_on_page, run, save_json, save_page
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.cli.main import cli
from otwarp.device import pick_device

PAGE = PAGES / "startup.md"

SLOWEST = 6
"""Commands that are listed, of all that there are."""


def names(command: click.Command = cli, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every command, those of groups as well."""
    if not isinstance(command, click.Group):
        return [path]
    context = click.Context(command)
    found = [(name, command.get_command(context, name)) for name in command.list_commands(context)]
    return [below for name, one in found if one is not None for below in names(one, (*path, name))]


def start(command: tuple[str, ...]) -> float:
    """Processor seconds of a fresh process that prints a command's help; a busy machine does not blur them."""
    before = os.times()
    subprocess.run([sys.executable, "-m", "otwarp.cli.main", *command, "--help"], capture_output=True, check=True)
    after = os.times()
    return (after.children_user - before.children_user) + (after.children_system - before.children_system)


def measure(rounds: int) -> Section:
    """The least of `rounds` starts of each command."""
    machine = Machine.look(pick_device("cpu"))
    found = {" ".join(("otwarp", *command)): min(start(command) for _ in range(rounds)) for command in names()}
    slowest = sorted(found.items(), key=lambda row: -row[1])[:SLOWEST]
    table = Table(
        title=f"From the start of each of {len(found)} commands to its help, processor time [s]",
        head=("command", "CPU"),
        rows=[(f"`{name}`", f"{seconds:.2f}") for name, seconds in slowest],
        note=f"The {SLOWEST} slowest; all others take less.",
    )
    return Section(name="commands", kind="cpu", machine=machine, tables=[table], data={"seconds": found})


def main() -> None:
    """Command line."""
    parser = options("How long each command takes to start.", rounds=3)
    parser.add_argument("--write", action="store_true", help="put the table on docs/benchmarks/startup.md")
    asked = parser.parse_args()
    check_places(asked.out, (PAGE,) if asked.write else ())
    section = measure(asked.rounds)
    print(section.markdown())
    if asked.out:
        save_json(asked.out, [section])
    if asked.write:
        save_page(PAGE, put_on_page(PAGE.read_text(encoding="utf-8"), section))


if __name__ == "__main__":
    run(main)
