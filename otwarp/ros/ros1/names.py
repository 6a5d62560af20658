"""Names of nodes and topics, the master's address, and the address on which this node can be reached."""

from __future__ import annotations

import ipaddress
import os
import re
import socket
from urllib.parse import urlsplit

from otwarp.errors import InputError

MASTER, NAMESPACE = "ROS_MASTER_URI", "ROS_NAMESPACE"
DEFAULT_MASTER = "http://localhost:11311/"
NAME = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
LONGEST_NAME = 256


def global_name(what: str, name: str) -> str:
    """A graph name with its leading slash; a relative one is taken to be in the namespace `/`.

    Args:
        what: `node` or `topic`, for the message.
        name: As typed.

    Raises:
        InputError: It is no graph name.
    """
    if len(name) > LONGEST_NAME or not NAME.fullmatch(name):
        raise InputError(f"{what} is {name[:80]!r}; allowed: words of letters, digits and _ with / between them")
    return name if name.startswith("/") else f"/{name}"


def node_name(name: str) -> str:
    """The graph name of a node; a relative one is in `ROS_NAMESPACE`, as in every client of ROS 1.

    Raises:
        InputError: It is no graph name, or the variable has none.
    """
    full = global_name("node", name)
    space = os.environ.get(NAMESPACE, "").strip("/")
    return full if name.startswith("/") or not space else global_name(NAMESPACE, space) + full


def address(uri: str) -> tuple[str, int] | None:
    """Host and port of `http://host:port/`, or None if it is nothing of that kind."""
    try:
        parts = urlsplit(uri)
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    plain = parts.scheme == "http" and not parts.username and parts.path in ("", "/") and not parts.query
    return (host, port) if plain and host and port and host.isascii() and len(uri) <= LONGEST_NAME else None


def master_uri(given: str | None) -> str:
    """The master's URI: as given, else `ROS_MASTER_URI`, else that of this machine.

    Raises:
        InputError: It is no `http://host:port`.
    """
    uri = given if given is not None else os.environ.get(MASTER) or DEFAULT_MASTER
    if address(uri) is None:
        raise InputError(f"{MASTER} is {uri[:120]!r}; allowed: http://host:port")
    return uri


def own_host(given: str | None, master: str) -> tuple[str, str]:
    """(name under which others reach this node, address that it listens on: this one only).

    In this order: `given`, `ROS_HOSTNAME`, `ROS_IP`; else loopback if the master is on loopback; else the address of
    the interface that leads to the master. IPv4 only.

    Raises:
        InputError: The name has no address, or there is no way to the master.
    """
    for source, host in (
        ("host", given),
        ("ROS_HOSTNAME", os.environ.get("ROS_HOSTNAME")),
        ("ROS_IP", os.environ.get("ROS_IP")),
    ):
        if host:
            return host, _resolve(source, host)
    where = address(master)
    assert where is not None, "checked by master_uri"
    found = _resolve(MASTER, where[0], shown=master)
    if ipaddress.ip_address(found).is_loopback:
        return "127.0.0.1", "127.0.0.1"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((found, where[1]))  # a datagram socket: nothing is sent
        except OSError as error:
            raise InputError(f"{MASTER} is {master!r}: no way to it ({error.strerror}); set ROS_IP") from None
        mine = probe.getsockname()[0]
    return mine, mine


def _resolve(source: str, host: str, shown: str | None = None) -> str:
    try:
        found = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise InputError(f"{source} is {(shown or host)[:120]!r}; allowed: a host with an IPv4 address") from None
    return str(found[0][4][0])
