"""Names, domains, discovery and QoS: what ROS 2 allows is taken, what it refuses is refused in one line."""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

from otwarp.errors import InputError
from otwarp.ros.ros2 import RELIABLE, SENSOR_DATA, QoS, Ros2Node, load_messages
from otwarp.ros.ros2.dds import check_node_name, cyclone_config, dds_topic, discovery_range, domain_id


def refusal(call, *arguments) -> str:
    with pytest.raises(InputError) as caught:
        call(*arguments)
    message = str(caught.value)
    assert "\n" not in message and "allowed" in message
    return message


def test_topics_carry_the_prefix_of_ros2():
    assert dds_topic("/rl_vel") == "rt/rl_vel"
    assert dds_topic("rl_vel") == "rt/rl_vel"
    assert dds_topic("/GeomagicLeft/smoothed_twist") == "rt/GeomagicLeft/smoothed_twist"


@pytest.mark.parametrize(
    "topic", ["", "/", "//a", "/a/", "/a//b", "/1a", "a b", "~/a", "/ä", "/a-b", "a" * 247, None, 3]
)
def test_bad_topics_are_refused(topic):
    assert repr(topic) in refusal(dds_topic, topic)


def test_the_longest_topic_is_taken():
    assert len(dds_topic("/" + "a" * 246)) == 249


@pytest.mark.parametrize("name", ["", "1a", "a/b", "a b", "a" * 256, None, "ü"])
def test_bad_node_names_are_refused(name):
    assert repr(name) in refusal(check_node_name, name)


@pytest.mark.parametrize(
    ("domain", "environment", "expected"),
    [
        (None, {}, 0),
        (None, {"ROS_DOMAIN_ID": "42"}, 42),
        (None, {"ROS_DOMAIN_ID": ""}, 0),
        (7, {"ROS_DOMAIN_ID": "42"}, 7),
        (232, {}, 232),
    ],
)
def test_the_domain_is_the_one_asked_for(domain, environment, expected):
    assert domain_id(domain, environment) == expected


@pytest.mark.parametrize("domain", [-1, 233, 1.5, True, "7x"])
def test_domains_out_of_range_are_refused(domain):
    assert refusal(domain_id, domain, {}).startswith(f"domain is {domain!r}")


@pytest.mark.parametrize("text", ["-1", "233", "x", "1.5", "²"])
def test_a_bad_variable_is_named(text):
    assert refusal(domain_id, None, {"ROS_DOMAIN_ID": text}).startswith(f"ROS_DOMAIN_ID is {text!r}")


def test_discovery_variables_mean_what_they_mean_to_ros2():
    assert discovery_range({}) == ("SUBNET", ())
    assert discovery_range({"ROS_LOCALHOST_ONLY": "0"}) == ("SUBNET", ())
    # the deprecated variable comes first and leaves no use for peers
    both = {"ROS_LOCALHOST_ONLY": "1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "a;b"}
    assert discovery_range(both) == ("LOCALHOST", ())
    peers = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "host-1; 10.0.0.2;"}
    assert discovery_range(peers) == ("LOCALHOST", ("host-1", "10.0.0.2"))
    for reach in ("OFF", "SYSTEM_DEFAULT"):
        assert discovery_range({"ROS_AUTOMATIC_DISCOVERY_RANGE": reach, "ROS_STATIC_PEERS": "a"}) == (reach, ())


@pytest.mark.parametrize(
    ("name", "value"),
    [("ROS_LOCALHOST_ONLY", "yes"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "local"), ("ROS_STATIC_PEERS", 'a;"/><x')],
)
def test_bad_discovery_variables_are_refused(name, value):
    assert refusal(cyclone_config, {name: value}).startswith(name)


def elements(environment: dict[str, str]) -> dict[str, list[ET.Element]]:
    config = cyclone_config(environment)
    assert config is not None
    found: dict[str, list[ET.Element]] = {}
    for element in ET.fromstring(config).iter():
        found.setdefault(element.tag, []).append(element)
    return found


def test_the_configuration_of_cyclone():
    assert cyclone_config({}) is None
    assert cyclone_config({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}) is None
    local = elements({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert local["AllowMulticast"][0].text == "false"
    assert local["NetworkInterface"][0].get("address") == "127.0.0.1"
    assert [peer.get("address") for peer in local["Peer"]] == ["localhost"]
    near = elements({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "10.0.0.2"})
    assert [peer.get("address") for peer in near["Peer"]] == ["localhost", "10.0.0.2"]
    assert "NetworkInterface" not in near and near["AllowMulticast"][0].text == "false"
    far = elements({"ROS_STATIC_PEERS": "10.0.0.2"})
    assert "AllowMulticast" not in far and [peer.get("address") for peer in far["Peer"]] == ["10.0.0.2"]
    off = elements({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"})
    assert off["Tag"][0].text and "Peer" not in off


def test_the_users_own_configuration_is_left_alone():
    assert cyclone_config({"CYCLONEDDS_URI": "file://x.xml", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}) is None


def test_profiles_match_as_ros2_says():
    latched = QoS(reliability="reliable", durability="transient_local")
    assert SENSOR_DATA.accepts(RELIABLE) and SENSOR_DATA.accepts(SENSOR_DATA) and RELIABLE.accepts(RELIABLE)
    assert not RELIABLE.accepts(SENSOR_DATA)
    assert RELIABLE.accepts(latched) and not latched.accepts(RELIABLE)
    assert (SENSOR_DATA.depth, RELIABLE.depth) == (10, 10)


@pytest.mark.parametrize("values", [{"depth": 0}, {"depth": 1.5}, {"reliability": "maybe"}, {"durability": "long"}])
def test_bad_policies_are_refused(values):
    assert "qos." in refusal(lambda: QoS(**values))


def test_importing_needs_nothing():
    code = (
        "import sys, otwarp.ros.ros2; "
        "bad = {'cyclonedds', 'numpy', 'warp', 'pxr', 'rosbags'} & set(sys.modules); assert not bad, bad"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_without_cyclonedds_the_extra_is_named(monkeypatch):
    monkeypatch.delitem(sys.modules, "otwarp.ros.ros2.messages", raising=False)
    monkeypatch.setitem(sys.modules, "cyclonedds.idl", None)
    for call in (load_messages, lambda: Ros2Node("twin", 1)):
        with pytest.raises(InputError, match=r"otwarp\[ros2\]"):
            call()
