"""`otwarp ros1`: a scene, live, with the paper's ROS 1 topics."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from otwarp.cli.options import scene_argument, with_options
from otwarp.cli.options.live import ROS_OPTIONS, live_options, run_with_ros, sayer
from otwarp.cli.types import UNIT


@click.command()
@scene_argument
@click.option("--master", metavar="URI", help="ROS master; default: ROS_MASTER_URI, else http://localhost:11311.")
@with_options(*ROS_OPTIONS)
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
    how = {"say": sayer(options), "alone": not options["page"]}
    return run_with_ros(
        scene,
        options,
        lambda: Ros1Node(node_name, master),
        lambda node, roles: Ros1Sink(node, Ros1Bridge(node, config, clock=time.perf_counter), roles, **how),
    )
