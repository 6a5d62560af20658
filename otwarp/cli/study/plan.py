"""`otwarp study plan`: points, trials, groups, steps, memory and time; some trials are timed, nothing is stored."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli.options import device_option, json_option
from otwarp.cli.output import json_text
from otwarp.cli.progress import spelled
from otwarp.cli.types import STUDY

if TYPE_CHECKING:
    from otwarp.studies.plan import Plan
    from otwarp.studies.rare.study import EscapePlan, EscapeStudy
    from otwarp.studies.study import Study


@click.command()
@click.argument("file", type=STUDY)
@device_option
@json_option
def plan(file: Path, device: str | None, as_json: bool) -> None:
    """Say what the study in STUDY will compute, and how long that takes on this machine.

    Some of its trials are timed; none is kept.
    """
    from otwarp.device import pick_device
    from otwarp.studies.engines.local import batch_of
    from otwarp.studies.engines.memory import room_of
    from otwarp.studies.file import load_study
    from otwarp.studies.plan import estimate
    from otwarp.studies.rare.study import EscapeStudy

    pick_device(device)  # refused before anything slow
    study = load_study(file)
    if isinstance(study, EscapeStudy):
        _escapes(study, device, as_json)
        return
    found = study.plan()
    seconds, where = estimate(study, device)
    room = room_of(study, device)
    at_once = min(room.worlds, found.trials[1], batch_of(study, gpu=where.startswith("cuda")))
    if as_json:
        memory = {"bytes": room.each * at_once, "free": room.free, "trials_at_once": at_once}
        said = dataclasses.asdict(found) | {"seconds": {"least": seconds[0], "most": seconds[1]}, "device": where}
        said |= {"memory": memory}
        click.echo(json_text(said))
        return
    click.echo(_points(study, found))
    least, most = found.trials
    shared = "" if found.budget is None else f", of a budget of {found.budget:,} for all points"
    click.echo(f"trials    {least:,}" + ("" if least == most else f" to {most:,}") + shared)
    if found.half_width is not None:
        hard = " or ".join(f"{p:g}" for p in study.stop.hardest)
        click.echo(f"          with at most {study.stop.at_most:,} a point intervals at P = {hard} come to "
                   f"± {found.half_width:.2g}, not to ± {study.stop.half_width:g}")  # fmt: skip
    own = f" to {found.longest_step:.3g} s" if found.longest_step > found.time_step else ""
    click.echo(f"steps     of {found.time_step:.3g} s{own}, up to {found.horizon / found.time_step:,.0f} a trial")
    click.echo(f"blocks    {found.blocks:,}, kept one by one")
    click.echo(f"results   {_memory(found.bytes)} before compression")
    click.echo(f"memory    {_memory(room.each * at_once)} for {at_once:,} trials at once, {_memory(room.free)} free")
    click.echo(
        f"time      {spelled(seconds[0])}" + ("" if least == most else f" to {spelled(seconds[1])}") + f" on {where}"
    )


def _escapes(study: EscapeStudy, device: str | None, as_json: bool) -> None:
    """The same of a study of escapes."""
    from otwarp.studies.engines.memory import room_of, rough_worlds
    from otwarp.studies.rare.estimate import estimate

    found, (seconds, where) = study.plan(), estimate(study, device)
    room = room_of(study, device)
    at_once = study.at_once(rough_worlds(study.design.scene, study.options.precision, where))
    if as_json:
        memory = {"bytes": room.each * at_once, "free": room.free, "paths_at_once": at_once}
        said = dataclasses.asdict(found) | {"seconds": seconds, "device": where, "memory": memory}
        click.echo(json_text(said))
        return
    click.echo(_points(study, found))
    twice = ", each again with half the step" if study.halved else ""
    click.echo(f"runs      {found.runs} a point with {found.branches:,} branches, {study.method}{twice}")
    steps = f"{found.time_step:.3g}" + (f" to {found.longest_step:.3g}" if found.longest_step > found.time_step else "")
    click.echo(f"steps     of {steps} s; how many follows from how rare escapes are")
    click.echo(f"blocks    {found.blocks:,}, kept one by one")
    click.echo(f"results   {_memory(found.bytes)} before compression")
    click.echo(f"memory    {_memory(room.each * at_once)} for {at_once:,} paths at once, {_memory(room.free)} free")
    click.echo(f"time      {spelled(seconds)} on {where}, from runs of {min(3, found.points)} points")


def _points(study: Study, found: Plan | EscapePlan) -> str:
    """How many points, of what, and why they need how many models."""
    shape = " × ".join(f"{len(d)} {d.name}" for d in study.design.dimensions) or "one"
    why = f": one for each value of {' and '.join(found.grouped_by)}" if found.groups > 1 else ""
    return f"points    {found.points:,} ({shape}), in {found.groups} model{'s' if found.groups > 1 else ''}{why}"


def _memory(size: int) -> str:
    """Bytes as people say them."""
    for scale, unit in ((2**30, "GiB"), (2**20, "MiB")):
        if size >= scale:
            return f"{size / scale:,.1f} {unit}"
    return f"{size / 2**10:,.0f} KiB"
