"""Options of a session whose scene is the twin of what a camera sees, and what is made of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options import rate_option, with_options
from otwarp.cli.types import FILE, POSITIVE, SEED, Number
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.perception.closed_loop import ClosedLoop
    from otwarp.perception.lab import LabOrder
    from otwarp.scene import Scene
    from otwarp.teleop.session import SessionOptions

CAMERAS = "files:PATH, v4l2:DEVICE, genicam:SERIAL,cti=FILE, ros1:TOPIC, ros2:TOPIC"

_CAMERA = (
    click.option(
        "--camera", metavar="NAME",
        help=f"Feed the scene by images: its own camera's, of a simulated laboratory, or {CAMERAS}.",
    ),
    click.option(
        "--perception", "networks", multiple=True, metavar="NETWORK",
        help="What looks at them: a trained network, for one body as BODY=NETWORK, or templates (default).",
    ),
    click.option("--any-robot", is_flag=True, help="Go on with a network of another robot."),
    click.option(
        "--follow", multiple=True, metavar="BODY", help="A body to look for; default: robots, and the task's cell."
    ),
    click.option(
        "--calibration", metavar="FILE", help="Of a real camera, or `scene`, which takes the scene's as it is."
    ),
    click.option(
        "--lost-after", type=Number(0.01, 60.0, unit="s"), metavar="SECONDS",
        help="Time without a measurement after which nothing is felt of a body; default: 0.3, or as long "
        "as a simulated laboratory takes for some images.",
    ),
    click.option(
        "--camera-device", metavar="NAME",
        help="Where networks look and a simulated laboratory's images are computed, cpu or cuda:0; default: --device.",
    ),
    rate_option("--camera-rate", 0.1, 10_000.0, 100.0, "Exposures per second of a simulated laboratory."),
    click.option(
        "--rings", type=Number(1, 8, whole=True), default=1, show_default=True,
        help="Rings of source points in the laboratory's images, and in templates.",
    ),
    click.option("--plant", type=FILE, metavar="SCENE", help="The simulated laboratory; default: SCENE itself."),
    click.option("--plant-seed", type=SEED, default=1, show_default=True, help="Key of its random numbers."),
    click.option(
        "--plant-viscosity", type=POSITIVE, default=1.0, show_default=True, metavar="FACTOR",
        help="Of its medium, over the scene's.",
    ),
    click.option(
        "--plant-spread", type=Number(0.0, 0.3), default=0.0, show_default=True,
        help="Relative standard deviation of its bodies' sizes.",
    ),
)  # fmt: skip
"""The camera, what looks at its images, and the laboratory that may stand for it."""

NAMES = ("camera", "networks", "any_robot", "follow", "calibration", "lost_after", "camera_device", "camera_rate",
         "rings", "plant", "plant_seed", "plant_viscosity", "plant_spread")  # fmt: skip


def camera_options() -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options of the camera, of what looks, and of the laboratory."""
    return with_options(*_CAMERA)


def split_options(options: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Those of `camera_options`, and the others.

    Raises:
        InputError: One of them without a camera, or a session that cannot be closed by images.
    """
    asked, rest = {name: options[name] for name in NAMES}, {k: v for k, v in options.items() if k not in NAMES}
    if asked["camera"] is None:
        given = {"--perception": asked["networks"], "--any-robot": asked["any_robot"], "--follow": asked["follow"],
                 "--calibration": asked["calibration"], "--lost-after": asked["lost_after"],
                 "--camera-device": asked["camera_device"], "--plant": asked["plant"]}  # fmt: skip
        for option, value in given.items():
            if value:
                raise InputError(f"{option} is given without a camera; allowed with --camera")
        return asked, rest
    if rest["speed"] != 1.0:
        raise InputError(f"--speed is {rest['speed']:g}; allowed with --camera: 1, the laboratory's")
    if rest["budget"] not in ("auto", "off"):
        raise InputError(
            f"--budget is {rest['budget']}; allowed with --camera: off, bodies that are seen must be there"
        )
    rest["budget"] = "off"
    return asked, rest


def open_perception(
    scene: Scene, session: SessionOptions, asked: dict[str, Any], say: Callable[[str], None]
) -> tuple[Scene, ClosedLoop | None]:
    """The scene with its camera as calibrated, and its perception, running; None without a camera.

    Raises:
        InputError: A camera, network, calibration or laboratory that cannot be; nothing runs then.
    """
    if asked["camera"] is None:
        return scene, None
    from otwarp.device import pick_device
    from otwarp.perception.assemble import SeeingOptions, check_camera, closed_loop, followed_bodies
    from otwarp.perception.calibrated import calibrated
    from otwarp.perception.followed import PATIENCE, LostRule
    from otwarp.perception.kinds import is_simulated, make_camera
    from otwarp.perception.photographer import LIVE
    from otwarp.perception.process import ProcessLooker

    name = asked["camera"]
    simulated = is_simulated(name)
    check_camera(scene, name if simulated else None)
    caution = ""
    if not simulated:
        caution = make_camera(name).info.caution  # refuses what cannot be
        if asked["plant"] is not None:
            raise InputError(f"--plant is {asked['plant']}; allowed with the scene's own camera, --camera is {name}")
    device = asked["camera_device"] or session.device
    try:
        pick_device(device)
    except InputError as error:  # that of --device was looked at before
        raise InputError(f"--camera-{error}") from None
    if asked["lost_after"] is None:
        rule = LostRule(patience=PATIENCE if simulated else 0.0)
    else:
        rule = LostRule(after=asked["lost_after"])
    rendering = dataclasses.replace(LIVE, rings=asked["rings"])
    seeing = SeeingOptions(
        networks=asked["networks"] or ("templates",), follow=asked["follow"], rule=rule, rendering=rendering,
        device=device, any_robot=asked["any_robot"],
    )  # fmt: skip
    twin = calibrated(scene, asked["calibration"], simulated=simulated, camera=name)
    lab = _laboratory(scene, asked, device) if simulated else None
    if caution:
        say(caution)
    looker = ProcessLooker(
        twin, seeing, bodies=len(followed_bodies(twin, asked["follow"])), camera=name, lab=lab, say=say
    )
    try:
        looker.open()
        return twin, closed_loop(twin, looker.pieces, looker, seeing=seeing)
    except BaseException:
        looker.close()
        raise


def _laboratory(scene: Scene, asked: dict[str, Any], device: str | None) -> Callable[[str], LabOrder]:
    """Makes the order of the laboratory from the name of its commands."""
    from otwarp.perception.lab import LabOrder
    from otwarp.perception.photographer import LIVE
    from otwarp.perception.plant import PlantOptions, plant_of, plant_scene

    options = PlantOptions(seed=asked["plant_seed"], viscosity=asked["plant_viscosity"], spread=asked["plant_spread"])
    there = plant_scene(plant_of(scene, asked["plant"]), options)
    rendering = dataclasses.replace(LIVE, rings=asked["rings"])

    def order(commands: str) -> LabOrder:
        """The laboratory that hears these commands."""
        return LabOrder(
            scene=there, commands=commands, seed=options.seed, device=device, rate=asked["camera_rate"],
            rendering=rendering, name=asked["camera"],
        )  # fmt: skip

    return order
