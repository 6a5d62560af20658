"""`otwarp ros1`: a scene, live, with the paper's ROS 1 topics."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from otwarp.cli.live_options import live_options, open_session, read_session, run_session, sayer
from otwarp.cli.options import scene_argument
from otwarp.cli.types import UNIT, Number


@click.command()
@scene_argument
@click.option("--master", metavar="URI", help="ROS master; default: ROS_MASTER_URI, else http://localhost:11311.")
@click.option("--node", "node_name", default="otwarp", show_default=True, help="Name of the node.")
@click.option(
    "--topic-rate",
    type=Number(1.0, 1000.0, unit="Hz"),
    default=60.0,
    show_default=True,
    help="Of the simulator's topics [Hz].",
)
@click.option("--scene-unit", type=UNIT, default=25.0, show_default=True, help="Micrometres in 1 on the topics.")
@click.option(
    "--control-gain",
    type=UNIT,
    default=0.004,
    show_default=True,
    help="G_control: scene units of trap per millimetre of a hand that comes by topic.",
)
@click.option("--namespaces", metavar="LEFT,RIGHT", help="Of the two devices; default: those of the pairing.")
@live_options(page=False, browser=False)
def ros1(
    scene: Path,
    master: str | None,
    node_name: str,
    topic_rate: float,
    scene_unit: float,
    control_gain: float,
    namespaces: str | None,
    **options: Any,
) -> int:
    """Run SCENE live with the topics of the paper's release, so that its own ROS 1 nodes work with it unchanged.

    Publishes /firstOTposition, /secondOTposition, /robot01, /robot02, /xform and /DynaOb01 to /DynaOb04; moves the
    traps by <namespace>/smoothed_twist. Needs a ROS master, no ROS installation.
    """
    from otwarp.ros.contract import ContractConfig
    from otwarp.ros.roles import Roles
    from otwarp.ros.ros1.bridge import Ros1Bridge
    from otwarp.ros.ros1.node import Ros1Node
    from otwarp.ros.sinks import Ros1Sink

    config = ContractConfig(
        pairing=options["pairing"],
        namespaces=tuple(namespaces.split(",")) if namespaces else (),
        rate=topic_rate,
        scene_unit=scene_unit,
        motion_gain=control_gain,
    )
    loaded, asked = read_session(scene, options)
    node = Ros1Node(node_name, master)
    try:
        session = open_session(loaded, asked, options)
        model = session.loop.sim.model
        roles = Roles.of(model.scene, model.held, config.pairing)
        bridge = Ros1Bridge(node, config, clock=time.perf_counter)
        session.loop.add(Ros1Sink(node, bridge, roles, say=sayer(options), alone=not options["page"]))
        return run_session(session, options)
    finally:
        node.close()
