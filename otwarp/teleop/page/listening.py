"""viser behind the page's rules of access: on a socket of ours, with every request judged first.

viser's server offers no hook for either, so while it starts the function that it calls to listen is ours. That the
rules are in force is then asked of the running server by a request that must be refused: with a viser that starts in
another way there is no page, not an open one.
"""

from __future__ import annotations

import errno
import http.client
import ipaddress
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from otwarp.errors import InputError
from otwarp.teleop.page.access import HEADERS, Access, choose_token

if TYPE_CHECKING:
    import viser

USUAL_PORT, TRIES = 8080, 20
"""Port that is tried first when none was asked for, and how many from there on."""
ANSWER_WITHIN = 5.0
"""Seconds for the server to refuse the request that checks the rules."""


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
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE) if host.strip() else []
    except (OSError, UnicodeError):
        found = []
    if not found:
        raise InputError(f"host = {host!r}: must be a name or an address of this machine")
    family, _, _, _, place = min(found, key=lambda row: row[0] != socket.AF_INET)
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


def guarded_server(listening: socket.socket, access: Access, label: str) -> viser.ViserServer:
    """A viser server on this socket, under these rules.

    Raises:
        InputError: This viser starts in a way that the rules do not reach.
    """
    import viser
    import websockets.asyncio.server as library
    from viser import _messages

    serve = library.serve

    def ours(handler: Any, _host: Any, _port: Any, *, process_request: Any, **options: Any) -> Any:
        """What viser calls to listen: on our socket, and judged."""
        return serve(handler, sock=listening, process_request=_judged(access, process_request), **options)

    library.serve = ours  # type: ignore[assignment]
    try:
        server = viser.ViserServer(host="127.0.0.1", port=0, label=label, verbose=False)
    finally:
        library.serve = serve
    # viser can open a tunnel to a public server for whoever presses `Share`; past these rules, so not here
    connection = server._websock_server
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        connection.unregister_handler(message)
    if not refuses(access, listening.getsockname()[:2]):
        server.stop()
        raise InputError(f"page: access cannot be guarded with viser {viser.__version__}; install viser 1.1.1")
    return server


def _judged(access: Access, inner: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """viser's handler of requests behind the rules."""

    def judged(connection: Any, request: Any) -> Any:
        """None lets a websocket through, a response answers."""
        verdict = access.judge(request.path, list(request.headers.raw_items()))
        if not verdict.passes:
            response = connection.respond(verdict.status, verdict.reason + "\n")
        else:
            response = inner(connection, request)
        if response is not None:
            for name, value in HEADERS:
                response.headers[name] = value
            if verdict.cookie is not None:
                response.headers["Set-Cookie"] = verdict.cookie
        return response

    return judged


def refuses(access: Access, place: tuple[str, int]) -> bool:
    """Whether the server at `place` refuses a request that breaks each of its rules."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(place[0], place[0])
    connection = http.client.HTTPConnection(host, place[1], timeout=ANSWER_WITHIN)
    answer: list[int] = []

    def ask() -> None:
        """In a thread: a server that does not answer must not hold up the start for longer than told."""
        with suppress(OSError, http.client.HTTPException):
            connection.request("GET", "/", headers={"Host": "elsewhere.invalid", "Origin": "http://other.invalid"})
            answer.append(connection.getresponse().status)

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(2.0 * ANSWER_WITHIN)
    connection.close()
    return answer == [access.judge("/", [("Host", "elsewhere.invalid"), ("Origin", "http://other.invalid")]).status]
