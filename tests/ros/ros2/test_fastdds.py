"""Against eProsima Fast DDS, the middleware under ROS 2's default rmw: a peer compiled here, messages both ways."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
from pathlib import Path

import pytest

from otwarp.ros.ros2 import RELIABLE, SENSOR_DATA, Ros2Node, load_messages
from tests.ros.ros2.setups import expect_soon, loopback

pytest.importorskip("cyclonedds")
m = load_messages()

SOURCE = Path(__file__).parent / "fastdds" / "echo_peer.cpp"
REQUIRED = os.environ.get("OTWARP_REQUIRE_FASTDDS") == "1"
FUZZED = 200
"""Malformed payloads from the peer."""


@pytest.fixture(scope="module")
def peer_program(tmp_path_factory) -> Path:
    """The peer, compiled; its absence is a skip, or a failure where Fast DDS must be there."""
    missing = []
    if shutil.which("g++") is None:
        missing.append("g++")
    if not Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp").exists():
        missing.append("libfastrtps-dev")
    if missing:
        reason = f"Fast DDS peer: {' and '.join(missing)} not installed"
        pytest.fail(reason) if REQUIRED else pytest.skip(reason)
    program = tmp_path_factory.mktemp("fastdds") / "echo_peer"
    libraries = ["-lfastrtps", "-lfastcdr", "-pthread"]
    built = subprocess.run(
        ["g++", "-O0", "-std=c++17", "-o", program, SOURCE, *libraries], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    return program


class Peer:
    """The running peer, and our node's four ends that face it."""

    def __init__(self, program: Path, domain: int, node: Ros2Node):
        self.process = subprocess.Popen(
            [program, str(domain)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.twist_out = node.publisher("/twist_to_peer", m.Twist, RELIABLE)
        self.twist_in = node.subscribe("/twist_from_peer", m.Twist, SENSOR_DATA)
        self.tf_out = node.publisher("/tf_to_peer", m.TFMessage, RELIABLE)
        self.tf_in = node.subscribe("/tf_from_peer", m.TFMessage, RELIABLE)
        ends = (self.twist_out, self.twist_in, self.tf_out, self.tf_in)
        expect_soon(lambda: all(end.matched == 1 for end in ends), "Fast DDS to be matched by Cyclone")
        # the peer says when it runs and when it has matched all four of its ends, in either order
        awaited = {"ready\n", "match 4\n"}
        while awaited:
            awaited.discard(self.line())

    def line(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, "the peer ended"
        return line

    def send_raw(self, payload: bytes) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(payload.hex() + "\n")
        self.process.stdin.flush()


@pytest.fixture
def peer(peer_program, monkeypatch):
    domain = loopback(monkeypatch)
    with Ros2Node("twin", domain) as node:
        peer = Peer(peer_program, domain, node)
        with peer.process:
            yield peer
            peer.process.communicate()


def arrive(subscription, count: int) -> list:
    messages: list = []
    expect_soon(
        lambda: messages.extend(subscription.take()) or len(messages) >= count, f"{count} on {subscription.topic}"
    )
    return messages


def test_a_twist_there_and_back(peer):
    sent = m.Twist(m.Vector3(1.5, -2.0, 1e300), m.Vector3(0.1, 5e-324, -500.0))
    peer.twist_out.publish(sent)
    # what Fast CDR decoded, printed with all digits
    assert [float(x) for x in peer.line().split()[1:]] == [1.5, -2.0, 1e300, 0.1, 5e-324, -500.0]
    assert arrive(peer.twist_in, 1) == [sent]


def test_transforms_there_and_back(peer):
    transform = m.Transform(m.Vector3(1.0, 2.0, 3.0), m.Quaternion(0.5, -0.5, 0.5, -0.5))
    # texts of several lengths shift what follows them
    names = ["a", "robot01", "DynaOb01", "xform"]
    sent = m.TFMessage(
        [
            m.TransformStamped(m.Header(m.Time(n - 2, 999_999_999), "world"), name, transform)
            for n, name in enumerate(names)
        ]
    )
    peer.tf_out.publish(sent)
    decoded = peer.line().split()
    assert decoded[0] == "tf" and decoded[4::11] == names and decoded[3::11] == ["world"] * 4
    assert decoded[1::11] == ["-2", "-1", "0", "1"] and decoded[5::11] == ["1"] * 4
    assert arrive(peer.tf_in, 1) == [sent]


def test_a_burst_loses_nothing_where_both_are_reliable(peer):
    for n in range(10):
        peer.twist_out.publish(m.Twist(m.Vector3(float(n), 0.0, 0.0)))
    assert [float(peer.line().split()[1]) for _ in range(10)] == list(range(10))


def test_malformed_payloads_from_the_network_harm_nothing(peer):
    good = m.TFMessage([m.TransformStamped(m.Header(m.Time(1, 2), "world"), "robot01")])
    payload = good.serialize(use_version_2=False)[4:]
    chance = random.Random(7)
    taken: list = []
    for n in range(FUZZED):
        kind, broken = n % 4, bytearray(payload)
        if kind == 0:
            broken = broken[: chance.randrange(1, len(payload))]
        elif kind == 1:
            broken[0:4] = b"\xff\xff\xff\x7f"
        elif kind == 2:
            broken = bytearray(chance.randrange(256) for _ in range(chance.randrange(1, 200)))
        else:
            broken = broken.replace(b"robot01", b"rob\xff\xfe01")
        peer.send_raw(bytes(broken))
        taken += peer.tf_in.take()
    peer.send_raw(payload)
    expect_soon(lambda: taken.extend(peer.tf_in.take()) or good in taken, "the good message after the bad ones")
    # what Cyclone's own check lets through and is no text, is counted by the subscription
    assert peer.tf_in.malformed > 0
    # a cut of nothing but the count of none may read as an empty message, all else is gone
    assert len(taken) < FUZZED // 4
