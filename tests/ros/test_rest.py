"""What the release's force node makes of a robot that nothing pulls: no force, but for the noise of its motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.haptics.chain.paper_mode import PaperForce
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.ros.contract import ROBOT_TOPICS, TRAP_TOPICS, ContractConfig
from otwarp.ros.sinks import Ros1Sink
from otwarp.scene import Scene
from otwarp.teleop.session.live import LiveLoop
from tests.ros.ros1.setups import LocalNode
from tests.ros.setups import RATE, roles_of, run

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SECONDS, BLOCK = 20.0, 60
"""Length of the run, and samples of a block: 1 s, many times what robot (5 ms) and filter (0.2 s) remember."""
SIGMAS = 5.0
PULLED = 0.2855
"""Mean height of the three spheres above the foci of their traps [µm]: 0.30 N of nothing, were it published."""


@pytest.mark.thorough
def test_the_mean_force_on_a_robot_at_rest_is_zero():
    """20 s of both robots: mean force 0 N, with a standard error of some 3e-4 N from 20 blocks of 1 s."""
    pytest.importorskip("rosbags")
    from otwarp.ros.ros1.bridge import Ros1Bridge

    scene = Scene.load(SCENES / "teleop_small.usda")
    clock, node = VirtualClock(), LocalNode()
    loop = LiveLoop(scene, clock=clock, rate=RATE, device="cpu", seed=7)
    roles, config = roles_of(loop), ContractConfig()
    bridge = Ros1Bridge(node, config, clock=clock.now, stamp=clock.now)
    loop.add(Ros1Sink(node, bridge, roles, clock=clock.now))
    loop.start()
    live = run(loop, clock, SECONDS)
    foci = live.frame.trap_position[0].reshape(2, 3, 3).mean(axis=1)
    for group, topics in enumerate(zip(TRAP_TOPICS, ROBOT_TOPICS, strict=True)):
        chain = PaperForce()
        said = [[m.transforms[0].transform.translation for m in node.sent[topic]] for topic in topics]
        felt = []
        for trap, robot in zip(*said, strict=True):
            chain.trap_message((trap.x, trap.y, trap.z), 0.0)
            felt.append(chain.robot_message((robot.x, robot.y, robot.z), 0.0))
        blocks = np.array(felt)[: len(felt) // BLOCK * BLOCK].reshape(-1, BLOCK, 3).mean(axis=1)
        mean, error = blocks.mean(axis=0), blocks.std(axis=0, ddof=1) / np.sqrt(len(blocks))
        assert np.all(error < 2e-3)
        assert np.all(np.abs(mean) < SIGMAS * error)
        # the trap is said to be where it holds its spheres, above its focus
        last = np.array([said[0][-1].x, said[0][-1].y, said[0][-1].z]) * config.scene_unit
        x, y, z = foci[roles.holds[group][0] // 3]
        assert last == pytest.approx((x, z + PULLED, -y), abs=1e-3)
    loop.close()
