"""`otwarp ros2`: a scene, live, with ROS 2 topics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.live_options import live_options, open_session, read_session, run_session, sayer
from otwarp.cli.options import scene_argument
from otwarp.cli.types import UNIT, Number


@click.command()
@scene_argument
@click.option("--domain", type=Number(0, 232, whole=True), help="DDS domain, 0 to 232; default: ROS_DOMAIN_ID, else 0.")
@click.option("--node", "node_name", default="otwarp", show_default=True, help="Name of the node.")
@click.option("--namespace", default="", help="Put before every topic.")
@click.option(
    "--topic-rate",
    type=Number(1.0, 1000.0, unit="Hz"),
    default=60.0,
    show_default=True,
    help="Most publications a second.",
)
@click.option(
    "--control-rate",
    type=Number(0.1, 1000.0, unit="Hz"),
    default=5.0,
    show_default=True,
    help="Commands a second of a controller.",
)
@click.option("--scene-unit", type=UNIT, default=25.0, show_default=True, help="Micrometres in 1 on the topics.")
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
    from otwarp.ros.roles import Roles
    from otwarp.ros.ros2.bridge import Ros2Bridge, Ros2Config
    from otwarp.ros.ros2.node import Ros2Node
    from otwarp.ros.sinks import Ros2Sink

    config = Ros2Config(
        pairing=options["pairing"],
        namespace=namespace,
        communication_rate=topic_rate,
        control_rate=control_rate,
        timeout=max(0.5, 1.0 / control_rate) if control_rate > 0.0 else 0.5,
        scene_unit=scene_unit,
    )
    loaded, asked = read_session(scene, options)
    node = Ros2Node(node_name, domain)
    try:
        session = open_session(loaded, asked, options)
        model = session.loop.sim.model
        roles = Roles.of(model.scene, model.held, config.pairing)
        session.loop.add(Ros2Sink(node, Ros2Bridge(node, config), roles, say=sayer(options)))
        return run_session(session, options)
    finally:
        node.close()
