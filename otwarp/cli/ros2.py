"""`otwarp ros2`: a scene, live, with ROS 2 topics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import rate_option, scene_argument, with_options
from otwarp.cli.options.live import ROS_OPTIONS, live_options, run_with_ros, sayer
from otwarp.cli.types import Number


@click.command()
@scene_argument
@click.option("--domain", type=Number(0, 232, whole=True), help="DDS domain, 0 to 232; default: ROS_DOMAIN_ID, else 0.")
@click.option("--namespace", default="", help="Put before every topic.")
@rate_option("--control-rate", 0.1, 1000.0, 5.0, "Commands per second of a controller.")
@with_options(*ROS_OPTIONS)
@live_options(page=False, browser=False)
def ros2(
    scene: Path,
    domain: int | None,
    node_name: str,
    namespace: str,
    topic_rate: float,
    control_rate: float,
    scene_unit: float,
    **options: Any,
) -> int:
    """Run SCENE live with ROS 2 topics: those of the paper's release, and of its reinforcement-learning companion.

    Beside the ROS 1 names it publishes /object and /DynaOb01Collide to /DynaOb04Collide, and obeys /rl_vel,
    /resetSignal and <namespace>/smoothed_twist. Needs no ROS installation.
    """
    from otwarp.ros.ros2.bridge import Ros2Bridge, Ros2Config
    from otwarp.ros.ros2.node import Ros2Node
    from otwarp.ros.sinks import Ros2Sink

    config = Ros2Config(
        pairing=options["pairing"],
        namespace=namespace,
        communication_rate=topic_rate,
        control_rate=control_rate,
        timeout=max(0.5, 1.0 / control_rate),
        scene_unit=scene_unit,
    )
    say = sayer(options)
    return run_with_ros(
        scene,
        options,
        lambda: Ros2Node(node_name, domain),
        lambda node, roles: Ros2Sink(node, Ros2Bridge(node, config), roles, say=say),
    )
