"""What names, environment variables and policies of ROS 2 mean to Cyclone DDS.

How nodes find each other: `CYCLONEDDS_URI` is the user's own configuration; where it is set nothing here is used. Else
`ROS_LOCALHOST_ONLY` (deprecated since Iron, still first), `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_STATIC_PEERS` mean
what they mean to `rcl` and `rmw_cyclonedds_cpp`, with one difference: LOCALHOST without static peers keeps to the
loopback interface, as `ROS_LOCALHOST_ONLY` once did. Bound to another interface Cyclone did not find a Fast DDS peer
that announces itself on 127.0.0.1; on the loopback it finds that one and Cyclone peers of either kind.

Quality of service, requested against offered: a best-effort reader takes from any writer, a reliable reader only from a
reliable one; a volatile reader takes from any, a transient-local one only from a transient-local writer. So the bridge
writes reliably and reads best-effort, which matches every node that keeps to ROS 2's default or sensor profile.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal
from xml.sax.saxutils import quoteattr

from otwarp.errors import InputError
from otwarp.haptics.core.fields import check_fields, number

if TYPE_CHECKING:
    from cyclonedds.qos import Qos

TOPIC_PREFIX = "rt"
"""What every rmw implementation over DDS puts before the name of a topic (services have `rq` and `rr`)."""

NODE_NAME_LENGTH = 255
"""Most characters of a node's name (`RMW_NODE_NAME_MAX_NAME_LENGTH`)."""

TOPIC_NAME_LENGTH = 247
"""Most characters of a topic's name (`RMW_TOPIC_MAX_NAME_LENGTH`): 255 less what the prefixes may take."""

DOMAINS = 233
"""Domains 0 to 232 have ports below 65536: 7400 + 250·domain + 10 + … (OMG DDSI-RTPS 2.5, §9.6.2)."""

_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
"""Values of `ROS_AUTOMATIC_DISCOVERY_RANGE`; the first is the default."""

MOST_PARTICIPANTS = 32
"""Participants of one host that unicast discovery looks for; the number `rmw_cyclonedds_cpp` uses."""

_PEER = re.compile(r"[A-Za-z0-9_.:%\-\[\]]+")


def check_node_name(name: str) -> str:
    """The name of a node, if it may be one.

    Raises:
        InputError: Anything but letters, digits and `_`, a digit first, or too long.
    """
    if not isinstance(name, str) or not _TOKEN.fullmatch(name) or len(name) > NODE_NAME_LENGTH:
        raise InputError(
            f"ROS 2 node name is {name!r}; allowed: letters, digits and _, no digit first, "
            f"1 to {NODE_NAME_LENGTH} characters"
        )
    return name


def resolve_topic(topic: str) -> str:
    """The full name of a topic, from `/`; a relative one belongs to the root.

    Raises:
        InputError: A name that `rmw_validate_full_topic_name` refuses, or a private one (`~`).
    """
    full = topic if isinstance(topic, str) and topic.startswith("/") else f"/{topic}"
    good = isinstance(topic, str) and all(_TOKEN.fullmatch(token) for token in full[1:].split("/"))
    if not good or len(full) > TOPIC_NAME_LENGTH:
        raise InputError(
            f"ROS 2 topic name is {topic!r}; allowed: words of letters, digits and _, no digit first, with single / "
            f"between them, up to {TOPIC_NAME_LENGTH} characters"
        )
    return full


def dds_topic(topic: str) -> str:
    """The name of a topic on the wire: `/rl_vel` is `rt/rl_vel`."""
    return TOPIC_PREFIX + resolve_topic(topic)


def domain_id(domain: int | None, environment: Mapping[str, str]) -> int:
    """The domain to join: what is asked for, else `ROS_DOMAIN_ID`, else 0.

    Raises:
        InputError: Not a whole number from 0 to 232.
    """
    if domain is not None:
        where, value = "domain", domain
    else:
        where, value = "ROS_DOMAIN_ID", environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    number = int(value) if isinstance(value, str) and value.isascii() and value.isdecimal() else value
    if type(number) is not int or not 0 <= number < DOMAINS:
        raise InputError(f"{where} is {value!r}; allowed: whole numbers from 0 to {DOMAINS - 1}")
    return number


def discovery_range(environment: Mapping[str, str]) -> tuple[str, tuple[str, ...]]:
    """Range and static peers that the environment asks for.

    Returns:
        One of `RANGES`, and the peers; none where the range leaves no use for them.

    Raises:
        InputError: A variable with a value that it does not have. `rcl` warns and goes on with LOCALHOST; a node that
            finds nobody is harder to explain than a line that says why.
    """
    local = environment.get("ROS_LOCALHOST_ONLY", "").strip()
    if local not in ("", "0", "1"):
        raise InputError(f"ROS_LOCALHOST_ONLY is {local!r}; allowed: 0 or 1")
    asked = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip() or RANGES[0]
    if asked not in RANGES:
        raise InputError(f"ROS_AUTOMATIC_DISCOVERY_RANGE is {asked!r}; allowed: {', '.join(RANGES)}")
    peers = tuple(peer.strip() for peer in environment.get("ROS_STATIC_PEERS", "").split(";") if peer.strip())
    for peer in peers:
        if not _PEER.fullmatch(peer):
            raise InputError(f"ROS_STATIC_PEERS has {peer!r}; allowed: host names or addresses with ; between them")
    if local == "1":
        return "LOCALHOST", ()
    return asked, peers if asked in ("SUBNET", "LOCALHOST") else ()


def cyclone_config(environment: Mapping[str, str]) -> str | None:
    """Configuration of a domain for Cyclone DDS.

    Args:
        environment: Such as `os.environ`.

    Returns:
        XML; None where Cyclone's own defaults or the user's `CYCLONEDDS_URI` are to be used.

    Raises:
        InputError: See `discovery_range`.
    """
    if environment.get("CYCLONEDDS_URI", "").strip():
        return None
    reach, peers = discovery_range(environment)
    if reach == "SYSTEM_DEFAULT" or (reach == "SUBNET" and not peers):
        return None
    general = "" if reach == "SUBNET" else "<AllowMulticast>false</AllowMulticast>"
    if reach == "OFF":
        # the tag makes this process a domain of its own, however somebody may address it
        found = f"<ParticipantIndex>none</ParticipantIndex><Tag>ros_discovery_off_{os.getpid()}</Tag>"
    else:
        addresses = ("localhost", *peers) if reach == "LOCALHOST" else peers
        listed = "".join(f"<Peer address={quoteattr(peer)}/>" for peer in addresses)
        found = (
            f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{MOST_PARTICIPANTS}"
            f"</MaxAutoParticipantIndex><Peers>{listed}</Peers>"
        )
        if not peers:
            general += '<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
    return f"<CycloneDDS><Domain><General>{general}</General><Discovery>{found}</Discovery></Domain></CycloneDDS>"


@dataclass(frozen=True, slots=True, kw_only=True)
class QoS:
    """Policies of one publisher or subscription; deadlines, lifespans and leases are ROS 2's defaults: none.

    Attributes:
        reliability: `reliable` sends again what was lost.
        durability: `transient_local` keeps the last messages for who comes later.
        depth: Messages kept; more than these push out the oldest.
    """

    reliability: Literal["best_effort", "reliable"] = "best_effort"
    durability: Literal["volatile", "transient_local"] = "volatile"
    depth: int = number(10, 1, 10_000, "messages")

    def __post_init__(self) -> None:
        check_fields(self, "qos")

    def accepts(self, offered: QoS) -> bool:
        """Whether a reader with these policies matches a writer with those."""
        reliable = self.reliability == "best_effort" or offered.reliability == "reliable"
        durable = self.durability == "volatile" or offered.durability == "transient_local"
        return reliable and durable


SENSOR_DATA = QoS()
"""Best effort, keep last 10, volatile: what the RL companion subscribes with. (`rmw_qos_profile_sensor_data` keeps 5;
the depth is no matter of matching.)"""

RELIABLE = QoS(reliability="reliable")
"""ROS 2's default: reliable, keep last 10, volatile."""


def cyclone_qos(qos: QoS, *, user_data: bytes, reader: bool) -> Qos:
    """The policies as Cyclone DDS has them.

    A write never waits: the longest that a reliable writer may block is 0 s, and what is kept is bounded, so that a
    reader that falls behind loses the oldest messages instead of holding up the writer. A reader ignores the names of
    members, since ROS 2's own IDL template calls `data` `data_` and not every peer does.

    Args:
        qos: Policies.
        user_data: Of the endpoint; ROS 2 looks there for the hash of the type.
        reader: Whether it is for a subscription.
    """
    from cyclonedds.qos import Policy, Qos

    reliable = qos.reliability == "reliable"
    reliability = Policy.Reliability.Reliable(max_blocking_time=0) if reliable else Policy.Reliability.BestEffort
    durability = Policy.Durability.TransientLocal if qos.durability == "transient_local" else Policy.Durability.Volatile
    policies = [
        reliability,
        durability,
        Policy.History.KeepLast(qos.depth),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        Policy.Userdata(user_data),
    ]
    if reader:
        policies.append(
            Policy.TypeConsistency.AllowTypeCoercion(
                ignore_sequence_bounds=True,
                ignore_string_bounds=True,
                ignore_member_names=True,
                prevent_type_widening=False,
                force_type_validation=False,
            )
        )
    elif qos.durability == "transient_local":
        policies.append(
            Policy.DurabilityService(
                cleanup_delay=0,
                history=Policy.History.KeepLast(qos.depth),
                max_samples=-1,
                max_instances=-1,
                max_samples_per_instance=-1,
            )
        )
    return Qos(*policies)
