"""Names as ROS 2 has them and as DDS has them: nodes, topics, and the number of the domain."""

from __future__ import annotations

import re
from collections.abc import Mapping

from otwarp.errors import InputError

TOPIC_PREFIX = "rt"
"""What every rmw implementation over DDS puts before the name of a topic (services have `rq` and `rr`)."""

NODE_NAME_LENGTH = 255
"""Most characters of a node's name (`RMW_NODE_NAME_MAX_NAME_LENGTH`)."""

TOPIC_NAME_LENGTH = 247
"""Most characters of a topic's name (`RMW_TOPIC_MAX_NAME_LENGTH`): 255 less what the prefixes may take."""

DOMAINS = 233
"""Domains 0 to 232 have ports below 65536: 7400 + 250·domain + 10 + … (OMG DDSI-RTPS 2.5, §9.6.2)."""

_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


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
