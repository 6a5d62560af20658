"""What reaches into viser: everything of the page that counts on more than viser promises stands here.

Made for viser 1.1; `pyproject.toml` allows no other. `tests/teleop/page/test_viser_internals.py` fails when what is
listed here is not there any more.

- *A guard before every request.* viser lets in everybody who reaches its port, and has no hook for a socket or for
  rules. While it starts, the function of `websockets` by which it listens is ours: it takes our socket, and puts the
  rules of `access` before viser's own handler of requests. Whether they hold is then asked of the running server by a
  request that must be refused: with a viser that starts in another way there is no page, not an open one.
- *No tunnel.* viser opens one to a public server for whoever presses `Share`, past the rules. The button is hidden by
  a public option, but a window may send the message all the same; so its handlers are taken from `_websock_server`.
- *No other port.* The variable `_VISER_PORT_OVERRIDE` would replace the port that was asked for.
- *The page itself.* What `front` adds is put at the end of the head of the one file that viser serves.
- *Colours of instances.* viser hands them to three.js as linear components, other than those of single meshes.
"""

from __future__ import annotations

import gzip
import http.client
import socket
import threading
from collections.abc import Callable, MutableMapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.errors import InputError
from otwarp.teleop.page.access import HEADERS, Access
from otwarp.teleop.page.front import with_head

if TYPE_CHECKING:
    import viser

MADE_FOR = "1.1"
"""Release of viser whose insides these are."""
PORT_OVERRIDE = "_VISER_PORT_OVERRIDE"
SHARING = ("ShareUrlRequest", "ShareUrlDisconnect")
"""Messages by which a window asks for a tunnel, and for its end."""
ANSWER_WITHIN = 5.0
"""Seconds for the server to refuse the request that checks the rules."""


def without_override(environment: MutableMapping[str, str]) -> MutableMapping[str, str]:
    """The environment of a process whose viser listens at the port that was asked for."""
    environment.pop(PORT_OVERRIDE, None)
    return environment


def guarded_server(listening: socket.socket, access: Access, label: str, head: str = "") -> viser.ViserServer:
    """A viser server on this socket, under these rules.

    Args:
        listening: The socket.
        access: The rules.
        label: Of the panel.
        head: HTML that is put at the end of the head of the page.

    Raises:
        InputError: This viser starts in a way that the rules do not reach.
    """
    import viser
    import websockets.asyncio.server as library
    from viser import _messages

    serve = library.serve

    def ours(handler: Any, _host: Any, _port: Any, *, process_request: Any, **options: Any) -> Any:
        """What viser calls to listen: on our socket, and judged."""
        return serve(handler, sock=listening, process_request=_judged(access, process_request, head), **options)

    library.serve = ours  # type: ignore[assignment]
    try:
        server = viser.ViserServer(host="127.0.0.1", port=0, label=label, verbose=False)
    finally:
        library.serve = serve
    for message in SHARING:
        server._websock_server.unregister_handler(getattr(_messages, message))
    if not refuses(access, listening.getsockname()[:2]):
        server.stop()
        raise InputError(f"page: access cannot be guarded with viser {viser.__version__}; install viser 1.1.1")
    return server


def _judged(access: Access, inner: Callable[[Any, Any], Any], head: str) -> Callable[[Any, Any], Any]:
    """viser's handler of requests behind the rules."""

    def judged(connection: Any, request: Any) -> Any:
        """None lets a websocket through, a response answers."""
        verdict = access.judge(request.path, list(request.headers.raw_items()))
        if not verdict.passes:
            response = connection.respond(verdict.status, verdict.reason + "\n")
        else:
            response = inner(connection, request)
            if response is not None and head:
                _add_head(response, head)
        if response is not None:
            for name, value in HEADERS:
                response.headers[name] = value
            if verdict.cookie is not None:
                response.headers["Set-Cookie"] = verdict.cookie
        return response

    return judged


def _add_head(response: Any, head: str) -> None:
    """Put HTML into the head of a page that viser answers with; other answers stay."""
    fields = response.headers
    if response.status_code != 200 or not fields.get("Content-Type", "").startswith("text/html"):
        return
    zipped = fields.get("Content-Encoding") == "gzip"
    page = (gzip.decompress(response.body) if zipped else response.body).decode()
    body = with_head(page, head).encode()
    response.body = gzip.compress(body, compresslevel=1) if zipped else body
    if "Content-Length" in fields:
        del fields["Content-Length"]
        fields["Content-Length"] = str(len(response.body))


def refuses(access: Access, place: tuple[str, int]) -> bool:
    """Whether the server at `place` refuses a request that breaks each of its rules."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(place[0], place[0])
    connection = http.client.HTTPConnection(host, place[1], timeout=ANSWER_WITHIN)
    answer: list[int] = []

    def ask() -> None:
        """In a thread: a server that does not answer must not hold up the start for longer than that."""
        with suppress(OSError, http.client.HTTPException):
            connection.request("GET", "/", headers={"Host": "elsewhere.invalid", "Origin": "http://other.invalid"})
            answer.append(connection.getresponse().status)

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(2.0 * ANSWER_WITHIN)
    connection.close()
    return answer == [access.judge("/", [("Host", "elsewhere.invalid"), ("Origin", "http://other.invalid")]).status]


def instanced(colours: np.ndarray) -> np.ndarray:
    """sRGB colours (..., 3) from 0 to 255 → what viser 1.1.1 wants for instances and arrows.

    It hands those to three.js as linear components, other than the colours of single meshes (IEC 61966-2-1).
    """
    x = np.asarray(colours, dtype=float) / 255.0
    linear = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return np.rint(255.0 * linear).astype(np.uint8)
