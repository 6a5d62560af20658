"""The release's force node between our simulator's bridge and a device, as a node of its own over the wire.

The release's `force_pub.py` needs rospy; here `PaperForce`, which does what it does, sits behind the same topics.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from otwarp.haptics.chain.motion import VectorFilter
from otwarp.haptics.chain.paper_mode import PaperForce
from otwarp.haptics.core.config import IDENTITY, RELEASE_ALPHA
from otwarp.ros.contract import HAND_TYPES, ROBOT_TOPICS, TRANSFORM, TRAP_TOPICS, ContractConfig, HandTopics
from otwarp.ros.ros1.bridge import Ros1Bridge
from otwarp.ros.ros1.messages import types
from otwarp.ros.ros1.node import Ros1Node

from .setups import expect_soon

PRINTED = 5e-4
"""Half of the last digit of 1.312 N."""
UNIT = 25.0
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@contextmanager
def nodes(uri: str) -> Iterator[tuple[Ros1Node, Ros1Node, Ros1Node]]:
    """The simulator's, the force node's and the device's."""
    with Ros1Node("sim", uri) as sim, Ros1Node("force_pub", uri) as paper, Ros1Node("device", uri) as touch:
        yield sim, paper, touch


class ForceNode:
    """Behaves like the release's node of one hand: a force with each trap and robot message once both were heard of."""

    def __init__(self, node: Ros1Node, hand: HandTopics) -> None:
        self.chain, self.twists = PaperForce(), VectorFilter(RELEASE_ALPHA)
        self.force = node.publisher(hand.topic("force_feedback"), HAND_TYPES["force_feedback"], queue=1000)
        self.smoothed = node.publisher(hand.smoothed_twist, HAND_TYPES["smoothed_twist"], queue=1000)
        self.inputs = [
            node.subscribe(TRAP_TOPICS[hand.group], TRANSFORM, self._trap),
            node.subscribe(ROBOT_TOPICS[hand.group], TRANSFORM, self._robot),
            node.subscribe(hand.topic("twist"), HAND_TYPES["twist"], self._twist),
        ]

    def _trap(self, message) -> None:
        force = self.chain.trap_message(self._place(message), 0.0)
        if self.inputs[1].received:
            self._send(force)

    def _robot(self, message) -> None:
        force = self.chain.robot_message(self._place(message), 0.0)
        if self.inputs[0].received:
            self._send(force)

    def _place(self, message):
        (transform,) = message.transforms
        t = transform.transform.translation
        return (t.x, t.y, t.z)

    def _send(self, force) -> None:
        t = types()
        self.force.publish(t.DeviceFeedback(t.Vector3(*force), t.Vector3(0.0, 0.0, 0.0), np.zeros(0, bool)))

    def _twist(self, message) -> None:
        t, v = types(), message.linear
        self.smoothed.publish(t.Twist(t.Vector3(*self.twists.step(v.x, v.y, v.z)), t.Vector3(0.0, 0.0, 0.0)))


@pytest.mark.parametrize("hand", [0, 1])
def test_ninety_nine_messages_at_a_twentieth(master, hand):
    """12000·0.05·(1 − 0.95^99)·0.0022 = 1.312 N: one trap message, then 99 of the robot a twentieth above it."""
    config = ContractConfig(scene_unit=UNIT)
    topics = config.hands()[hand]
    with nodes(master.uri) as (sim, paper, touch):
        bridge = Ros1Bridge(sim, config)
        node = ForceNode(paper, topics)
        felt = []
        touch.subscribe(topics.topic("force_feedback"), HAND_TYPES["force_feedback"], felt.append)
        expect_soon(lambda: all(one.connections for one in node.inputs[:2]) and node.force.connections == 1)

        def one(trap, robot, now: float) -> None:
            places = [None, None]
            traps, robots = list(places), list(places)
            if trap is not None:
                traps[topics.group] = trap
            if robot is not None:
                robots[topics.group] = (robot, UPRIGHT)
            assert bridge.publish(now, traps, robots)

        one((0.0, 0.0, 5.0), None, 0.0)
        expect_soon(lambda: node.inputs[0].received == 1)
        for n in range(1, 100):
            one(None, (0.0, 0.0, 5.0 + 0.05 * UNIT), n / 60.0 + 1e-6)
            expect_soon(lambda n=n: len(felt) == n)
        force = felt[-1].force
        assert (force.x, force.y, force.z) == pytest.approx((0.0, 1.312, 0.0), abs=PRINTED)
        assert not any(one.log.counts for one in (sim, paper, touch))


def test_the_hand_moves_the_trap_through_the_node(master):
    """twist → smoothed_twist → displacement: after n messages of speed v the smoothed one is v·(1 − 0.95^n)."""
    config = ContractConfig(axis_map=IDENTITY, scene_unit=UNIT, motion_gain=0.02)
    topics = config.hands()[0]
    now = [0.0]
    with nodes(master.uri) as (sim, paper, touch):
        bridge = Ros1Bridge(sim, config, clock=lambda: now[0])
        node = ForceNode(paper, topics)
        out = touch.publisher(topics.topic("twist"), HAND_TYPES["twist"], queue=100)
        expect_soon(lambda: out.connections == 1 and node.smoothed.connections == 1)
        bridge.commands(0.0)
        t = types()
        for _ in range(20):
            out.publish(t.Twist(t.Vector3(100.0, 0.0, 0.0), t.Vector3(0.0, 0.0, 0.0)))
        heard = bridge._in[0]
        expect_soon(lambda: heard.received == 20)
        now[0] = 0.05
        first, second = bridge.commands(0.05)
        assert first[0] == pytest.approx(100.0 * (1.0 - 0.95**20) * 0.05 * 0.02 * UNIT, rel=1e-9)
        assert second == (0.0, 0.0, 0.0)
