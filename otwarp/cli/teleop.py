"""`otwarp teleop`: a scene, live."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, json_option, scene_argument, seed_option
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.teleop.session import Session

DEVICES = (
    "mouse, spacemouse, dualsense, haply, openhaptics:NAME, forcedimension, ros1:/NAMESPACE, virtual:…, replay:FILE"
)


@click.command()
@scene_argument
@click.option("--left", metavar="DEVICE", help=f"Device of the left hand: {DEVICES}.")
@click.option("--right", metavar="DEVICE", help="Device of the right hand.")
@click.option("--arm", is_flag=True, help="Arm the hands as soon as they hold their traps; else by the page.")
@click.option("--record", type=click.Path(), metavar="FILE.mcap", help="Record the session from its start.")
@click.option(
    "--budget",
    default="auto",
    show_default=True,
    metavar="auto|off|SHARE",
    help="Reduce the scene to what this machine runs in real time, with that share of a core.",
)
@click.option("--speed", type=float, default=1.0, show_default=True, help="Simulated seconds per second.")
@click.option(
    "--mode", type=click.Choice(["stable", "paper"]), default="stable", show_default=True, help="Haptic chain."
)
@click.option(
    "--pairing",
    type=click.Choice(["release", "older"]),
    default="release",
    show_default=True,
    help="Which hand moves which group of traps; the older release has them the other way round.",
)
@click.option("--motion-gain", type=float, metavar="UM/M", help="Micrometres of trap per metre of hand.")
@click.option("--force-gain", type=float, metavar="N/PN", help="Newtons on the hand per piconewton in the scene.")
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="Haptics configuration, JSON.")
@click.option("--rate", type=float, default=120.0, show_default=True, help="Frames per second of the live loop.")
@click.option("--servo-rate", type=float, default=1000.0, show_default=True, help="Cycles per second of the servo.")
@click.option("--page/--no-page", default=True, help="Serve the browser page.")
@click.option("--open/--no-open", "browser", default=True, help="Open a browser here.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Interface of the page; others need a token.")
@click.option("--port", type=int, help="Port of the page; default: 8080 or the next that is free.")
@click.option("--token", help="What a browser must know; made by itself where it is needed.")
@click.option(
    "--duration", type=float, metavar="SECONDS", help="End after so many seconds; default: Ctrl-C or the page."
)
@seed_option
@device_option
@json_option
def teleop(scene: Path, as_json: bool, **options: Any) -> None:
    """Run SCENE live: move traps with the page's gizmos or with devices, feel and see what happens.

    Without --left and --right every trap has a gizmo on the page, and nothing is felt. Hands move the traps whose
    ot:trap:hand names them.
    """
    session = _session(scene, options, lambda line: click.echo(line, err=as_json))
    report = session.run()
    if as_json:
        click.echo(json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False))
    else:
        click.echo(report["text"])
    stop.check()  # Ctrl-C is how a session ends; SIGTERM has its exit code


def _session(scene: Path, options: dict[str, Any], say: Callable[[str], None]) -> Session:
    """A session that has not begun."""
    from otwarp.scene.description import Scene
    from otwarp.teleop.hand_plan import load_config
    from otwarp.teleop.session import PageOptions, Session, SessionOptions

    if options["duration"] is not None and not options["duration"] > 0.0:
        raise InputError(f"--duration is {options['duration']:g}; allowed: above 0 s")
    page = None
    if options["page"]:
        page = PageOptions(**{name: options[name] for name in ("host", "port", "token", "browser")})
    same = ("mode", "pairing", "motion_gain", "force_gain", "record", "arm", "budget", "rate", "servo_rate", "speed")
    asked = SessionOptions(
        devices={hand: options[hand] for hand in ("left", "right") if options[hand] is not None},
        config=load_config(options["config"]) if options["config"] else None,
        page=page,
        **{name: options[name] for name in (*same, "duration", "seed", "device")},
    )
    return Session(Scene.load(scene), asked, say=say)
