"""How nodes find each other: what ROS 2's environment variables mean for Cyclone DDS.

`CYCLONEDDS_URI` is the user's own configuration; where it is set nothing here is used. Else `ROS_LOCALHOST_ONLY`
(deprecated since Iron, still first), `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_STATIC_PEERS` mean what they mean to
`rcl` and `rmw_cyclonedds_cpp`, with one difference: LOCALHOST without static peers keeps to the loopback interface, as
`ROS_LOCALHOST_ONLY` once did. Bound to another interface Cyclone did not find a Fast DDS peer that announces itself on
127.0.0.1; on the loopback it finds that one and Cyclone peers of either kind.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

from otwarp.errors import InputError

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
"""Values of `ROS_AUTOMATIC_DISCOVERY_RANGE`; the first is the default."""

MOST_PARTICIPANTS = 32
"""Participants of one host that unicast discovery looks for; the number `rmw_cyclonedds_cpp` uses."""

_PEER = re.compile(r"[A-Za-z0-9_.:%\-\[\]]+")


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
