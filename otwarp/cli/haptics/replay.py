"""`otwarp haptics replay`: are the forces of a recording those that its chains send again?"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from otwarp.cli.options import json_option
from otwarp.cli.output import json_text
from otwarp.cli.types import FILE

if TYPE_CHECKING:
    from otwarp.perception.replay import PerceptionReplay
    from otwarp.teleop.recording.replay import HandReplay

EXIT_DIFFERS = 1


@click.command()
@click.argument("recording", type=FILE)
@json_option
def replay(recording: Path, as_json: bool) -> int:
    """Run the haptic chains of RECORDING, an .mcap file of `otwarp teleop --record`, on what they were given, and
    compare all forces bit for bit.

    Of a session with a camera its images are looked at again, too, and must give the same estimates and states.

    A session that was killed leaves the folder FILE.mcap.part; give its name as RECORDING. One that is cut short is
    compared up to the cut. Exit code 0: all that is there is equal; 1: a force differs, or there is nothing to compare;
    2: no recording.
    """
    from otwarp.teleop.recording.replay import replay_recording

    report, images = replay_recording(recording), _images(recording)
    if as_json:
        more = {} if images is None else {"images": dataclasses.asdict(images) | {"equal": images.equal}}
        click.echo(json_text(report.to_dict() | more))
    else:
        law = f", its force law {report.law}" if report.law else ""
        click.echo(f"{report.file}: {report.states} states, recorded by otwarp {report.recorded}{law}")
        if not report.complete:
            click.echo(f"cut short: {report.seconds:.1f} s of it could be read")
        for hand in report.hands:
            click.echo(_line(hand))
        if images is not None:
            click.echo(images.verdict)
        click.echo(report.verdict)
    return 0 if report.equal and (images is None or images.equal) else EXIT_DIFFERS


def _images(recording: Path) -> PerceptionReplay | None:
    """What the images of a session with a camera say again."""
    from otwarp.haptics.recording import CONFIG, McapFile, unpack_text

    with McapFile(recording) as file:
        if not any('"perception"' in unpack_text(message.data) for message in file.messages((CONFIG,))):
            return None  # nothing that looks is loaded for the forces alone
    from otwarp.perception.replay import replay_perception

    return replay_perception(recording)


def _line(hand: HandReplay) -> str:
    """What came of one hand."""
    line = f"{hand.hand:5}  {hand.cycles} cycles, {hand.compared} run again, {hand.mismatches} differ"
    if hand.missing or hand.skipped:
        line += f"; {hand.missing} are missing in {hand.gaps} gaps, {hand.skipped} could not be run again"
    return line + (f"\n       first: {hand.first}" if hand.first else "")
