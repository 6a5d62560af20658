"""Who may see and use the page: it moves light that moves things, so strangers may not.

viser checks nobody. Every request, websocket handshakes included, is judged here before viser sees it:

- On loopback the `Host` must be a loopback name: a web page whose name was made to point to this machine (DNS
  rebinding) still names itself.
- A request with an `Origin` must come from this very page: other pages in the same browser may open websockets to
  anywhere, but cannot lie about where they come from.
- Its query may hold nothing but what is known to be harmless. viser's browser side lets a link choose another server
  (`?websocket=`) or a recording (`?playbackPath=`), and does what that says, scripts included, in this page's name.
- With a token, the request must carry it: once in the address, afterwards in a cookie.
"""

from __future__ import annotations

import errno
import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs, quote

from otwarp.errors import InputError

SHORTEST_TOKEN = 16
_TOKEN = re.compile(r"[A-Za-z0-9._~-]+")
HEADERS = (
    ("Content-Security-Policy", "frame-ancestors 'none'; connect-src 'self' data: blob:"),
    ("X-Frame-Options", "DENY"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-store"),
)
"""Of every answer: not inside another page, which could make users click what they do not see; not connected with
others, should a link have got past the rules; and the token stays."""
QUERY = re.compile(r"token|fixedDpr|showStats|logCamera|darkMode|initialCamera\w*")
"""Names that a query may hold."""

USUAL_PORT, TRIES = 8080, 20
"""Port that is tried first when none was asked for, and how many from there on."""

Fields = Sequence[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class AccessVerdict:
    """HTTP status (200 lets pass), why not, and the cookie to set."""

    status: int
    reason: str = ""
    cookie: str | None = None

    @property
    def passes(self) -> bool:
        """Whether viser may answer."""
        return self.status == 200


@dataclass(frozen=True, slots=True)
class Access:
    """The rules of one page.

    Attributes:
        loopback: Whether it listens on loopback alone.
        token: Secret to be presented, None for none.
        port: Of the page; names its cookie, since browsers do not keep cookies of two ports apart.
    """

    loopback: bool
    token: str | None
    port: int

    @property
    def cookie_name(self) -> str:
        """Name of the cookie that holds the token."""
        return f"otwarp-{self.port}"

    def judge(self, target: str, headers: Fields) -> AccessVerdict:
        """Judge a request.

        Args:
            target: Path and query of the request line.
            headers: All header fields, repeated ones included.
        """
        hosts = _values(headers, "host")
        if len(hosts) != 1:
            return AccessVerdict(400, "one Host, please")
        if self.loopback and not is_loopback_name(_hostname(hosts[0])):
            return AccessVerdict(403, "this page answers to loopback names alone")
        origins = _values(headers, "origin")
        if origins and (len(origins) > 1 or not _same_origin(origins[0], hosts[0])):
            return AccessVerdict(403, "this page takes no orders from other pages")
        query = parse_qs(target.partition("?")[2], keep_blank_values=True)
        if not all(QUERY.fullmatch(name) for name in query):
            return AccessVerdict(403, "this page may not be told such things by its address")
        if self.token is None:
            return AccessVerdict(200)
        given = query.get("token", [])
        if len(given) == 1 and _equal(given[0], self.token):
            cookie = f"{self.cookie_name}={self.token}; Path=/; HttpOnly; SameSite=Strict"
            return AccessVerdict(200, cookie=cookie)
        if any(_equal(value, self.token) for value in _cookies(headers, self.cookie_name)):
            return AccessVerdict(200)
        return AccessVerdict(403, "open the address that otwarp printed, with its token")


def choose_token(token: str | None, loopback: bool) -> str | None:
    """The token that a page must have: the one given, a random one where others could reach it, or none.

    Raises:
        InputError: One that is short enough to be guessed, or does not fit in an address.
    """
    if token is None:
        return None if loopback else secrets.token_urlsafe(24)
    if len(token) < SHORTEST_TOKEN or not _TOKEN.fullmatch(token):
        raise InputError(
            f"token = {'*' * len(token)!r}: must be {SHORTEST_TOKEN} or more letters, digits, '-', '.', '_' or '~'"
        )
    return token


def check_host(host: str) -> list[tuple[socket.AddressFamily, socket.SocketKind, int, str, tuple[Any, ...]]]:
    """Addresses of an interface, as `socket.getaddrinfo` gives them.

    Raises:
        InputError: None of this machine's.
    """
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE) if host.strip() else []
    except (OSError, UnicodeError):
        found = []
    if not found:
        raise InputError(f"host = {host!r}: must be a name or an address of this machine")
    return found


def listen(host: str, port: int | None) -> socket.socket:
    """A listening socket.

    Args:
        host: Name or number of the interface; a name means the first of its addresses, IPv4 first.
        port: 0 for any; None for the first free one from `USUAL_PORT` on.

    Raises:
        InputError: A host that is none of this machine's, or a port that is taken or not allowed.
    """
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"port = {port!r}: must be from 0 to 65535")
    family, _, _, _, place = min(check_host(host), key=lambda row: row[0] != socket.AF_INET)
    ports = [port] if port is not None else [*range(USUAL_PORT, USUAL_PORT + TRIES), 0]
    for candidate in ports:
        try:
            return socket.create_server((place[0], candidate), family=family, backlog=64)
        except OSError as error:
            if error.errno == errno.EADDRINUSE and port is None:
                continue
            if error.errno == errno.EADDRNOTAVAIL:
                raise InputError(f"host = {host!r}: must be a name or an address of this machine") from None
            raise InputError(f"port = {port!r}: {error.strerror}; must be a free one, or none for the next") from None
    raise InputError(f"port = {port!r}: none is free")  # pragma: no cover - any free port was asked for last


def access_for(listening: socket.socket, token: str | None) -> Access:
    """The rules of a page on this socket, with a token wherever others could reach it."""
    number, port = listening.getsockname()[:2]
    loopback = ipaddress.ip_address(number.partition("%")[0]).is_loopback
    return Access(loopback, choose_token(token, loopback), port)


def address(host: str, port: int, token: str | None) -> str:
    """Address of the page that the user opens."""
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/" + (f"?token={quote(token)}" if token else "")


def is_loopback_name(name: str) -> bool:
    """Whether a name of a `Host` field always means this machine."""
    if name.lower().rstrip(".") == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def _values(headers: Fields, name: str) -> list[str]:
    return [value.strip() for key, value in headers if key.lower() == name]


def _hostname(host: str) -> str:
    """A `Host` field without its port; empty if it is none."""
    if host.startswith("["):
        inside, bracket, rest = host[1:].partition("]")
        return inside if bracket and (not rest or re.fullmatch(r":\d*", rest)) else ""
    name, _, port = host.partition(":")
    return name if not port or port.isdigit() else ""


def _same_origin(origin: str, host: str) -> bool:
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and rest.lower() == host.lower()


def _cookies(headers: Fields, name: str) -> list[str]:
    pairs = [pair.strip().partition("=") for field in _values(headers, "cookie") for pair in field.split(";")]
    return [value for key, _, value in pairs if key == name]


def _equal(a: str, b: str) -> bool:
    """Compare in a time that does not tell how much of it was right."""
    return hmac.compare_digest(a.encode("utf-8", "surrogatepass"), b.encode("utf-8", "surrogatepass"))
