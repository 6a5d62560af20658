"""Options and assembly of a live session, which `teleop`, `ros1` and `ros2` share; what the latter two have besides."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option, json_option, mode_option, rate_option, seed_option, with_options
from otwarp.cli.output import json_text
from otwarp.cli.types import FILE, POSITIVE, SECONDS, UNIT, Number
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.ros.roles import Roles
    from otwarp.scene import Scene
    from otwarp.teleop import Sink
    from otwarp.teleop.perception import Perception
    from otwarp.teleop.session import Session, SessionOptions

Node = TypeVar("Node")

DEVICES = (
    "mouse, spacemouse, dualsense, haply, openhaptics:NAME, forcedimension, ros1:/NAME, virtual:SCRIPT, replay:FILE"
)

_SESSION = (
    click.option("--left", metavar="DEVICE", help=f"Device of the left hand: {DEVICES}."),
    click.option("--right", metavar="DEVICE", help="Device of the right hand."),
    click.option("--arm", is_flag=True, help="Arm the hands as soon as they hold their traps; else on the page."),
    click.option("--record", metavar="FILE.mcap", help="Record the session from its start."),
    click.option(
        "--budget",
        default="auto",
        show_default=True,
        metavar="auto|off|SHARE",
        help="Reduce the scene to what this machine runs in real time, in that share of a core.",
    ),
    click.option(
        "--speed", type=Number(0.01, 10.0), default=1.0, show_default=True, help="Simulated seconds per second."
    ),
    mode_option,
    click.option(
        "--pairing",
        type=click.Choice(["release", "older"]),
        default="release",
        show_default=True,
        help="Which hand has which group of traps; the older release has them the other way round.",
    ),
    click.option("--motion-gain", type=POSITIVE, metavar="UM/M", help="Micrometres of trap per metre of hand."),
    click.option(
        "--force-gain", type=Number(0.0), metavar="N/PN", help="Newtons on the hand per piconewton in the scene."
    ),
    click.option(
        "--config",
        type=FILE,
        metavar="FILE",
        help="What differs from the presets, JSON; `otwarp haptics config` prints them.",
    ),
    rate_option("--rate", 10.0, 1000.0, 120.0, "Frames per second of the live loop."),
    rate_option("--servo-rate", 1.0, 20_000.0, 1000.0, "Servo cycles per second."),
)
"""Hands, pace and scene."""

_REST = (
    click.option("--host", default="127.0.0.1", show_default=True, help="Interface of the page; others need a token."),
    click.option(
        "--port", type=Number(0, 65_535, whole=True), help="Port of the page; default: 8080, or the next that is free."
    ),
    click.option("--token", help="What a browser must know; made by itself where it is needed."),
    click.option("--duration", type=SECONDS, metavar="SECONDS", help="End by then; default: by Ctrl-C."),
    seed_option,
    device_option,
    json_option,
)
"""Where the page is served, and how the session ends and is reported."""


ROS_OPTIONS = (
    click.option("--node", "node_name", default="otwarp", show_default=True, help="Name of the node."),
    rate_option("--topic-rate", 1.0, 1000.0, 60.0, "Most publications per second of each of the simulator's topics."),
    click.option("--scene-unit", type=UNIT, default=25.0, show_default=True, help="Micrometres in 1 on the topics."),
)
"""The node, and the units of its topics."""


def live_options(page: bool, browser: bool) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options of a live session.

    Args:
        page: Whether the page is served by default.
        browser: Whether a browser is opened by default.
    """
    page_option = click.option("--page/--no-page", default=page, show_default=True, help="Serve the browser page.")
    open_option = click.option(
        "--open/--no-open", "browser", default=browser, show_default=True, help="Open a browser."
    )
    return with_options(*_SESSION, page_option, open_option, *_REST)


def read_session(scene: Path, options: dict[str, Any]) -> tuple[Scene, SessionOptions]:
    """A scene and how it is run, from the values of `live_options`; refuses what can be refused without starting."""
    from otwarp.scene import Scene
    from otwarp.teleop.operators import load_config
    from otwarp.teleop.session import PageOptions, SessionOptions

    if options["left"] is None and options["right"] is None:
        asked = {"--arm": options["arm"] or None, "--config": options["config"]}
        asked |= {"--motion-gain": options["motion_gain"], "--force-gain": options["force_gain"]}
        for option, value in asked.items():
            if value is not None:
                raise InputError(f"{option} is given without a hand; allowed with --left or --right")
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
    loaded = Scene.load(scene)
    stop.check()
    asked.plan(loaded)
    return loaded, asked


def open_session(
    scene: Scene, asked: SessionOptions, options: dict[str, Any], perception: Perception | None = None
) -> Session:
    """A session that has not begun."""
    from otwarp.teleop.session import Session

    stop.begin()
    return Session(scene, asked, say=sayer(options), perception=perception)


def sayer(options: dict[str, Any]) -> Callable[[str], None]:
    """Lines for the user: on standard error where standard output is for a program."""
    return lambda line: click.echo(line, err=options["as_json"])


def run_session(session: Session, options: dict[str, Any]) -> int:
    """Until it ends, then say what it was like; the exit code, 1 if the servo died."""
    stop.check()
    report = session.run()
    click.echo(json_text(report) if options["as_json"] else report["text"])
    stop.check_terminated()  # Ctrl-C is how a session ends; SIGTERM has an exit code of its own
    return int(session.loop.hands.died)


def run_with_ros(
    scene: Path,
    options: dict[str, Any],
    join: Callable[[], AbstractContextManager[Node]],
    sink_of: Callable[[Node, Roles], Sink],
) -> int:
    """Run a scene with a node of ROS, which is closed with it; the exit code.

    Args:
        scene, options: As `read_session`.
        join: Opens the node.
        sink_of: Between the node and the session, by what the topics mean in the scene.
    """
    from otwarp.ros.roles import Roles

    loaded, asked = read_session(scene, options)
    with join() as node:
        session = open_session(loaded, asked, options)
        model = session.loop.sim.model
        session.loop.add(sink_of(node, Roles.of(model.scene, model.held, options["pairing"])))
        return run_session(session, options)
