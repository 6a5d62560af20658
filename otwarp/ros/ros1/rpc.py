"""XML-RPC between nodes and master: calls with a limit on time and size, and the server of a node for theirs.

ROS answers `[code, text, value]`. Masters and other nodes report publishers to a node and ask it for topics.
"""

from __future__ import annotations

import contextlib
import http.client
import socket
import socketserver
import threading
import time
import xmlrpc.client
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler
from typing import Any, cast
from xml.parsers import expat

from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.names import address
from otwarp.ros.ros1.wire import Malformed

TIMEOUT = 5.0
"""Seconds for one call."""
MOST_BODY = 1 << 20
"""Largest call or answer [bytes]; the state of a graph of a thousand topics takes a fifth of it."""
CHUNK = 1 << 16
PATIENCE = 5.0
"""Seconds that a caller may take for each piece of its call."""
MOST_CALLERS = 32
"""Calls that are served at the same time; more are hung up on."""

Method = Callable[..., list[Any]]


class _OneLine(Exception):
    def __init__(self, text: str) -> None:
        # part of it is what the other side says
        super().__init__("".join(c if c.isprintable() else " " for c in text).strip())


class NoAnswer(_OneLine):
    """Nobody there, too late, or no XML-RPC; one line."""


class Refused(_OneLine):
    """The other side answered that it will not, and why; one line."""


def parse(body: bytes) -> tuple[list[Any], str | None]:
    """(parameters, method) of an XML-RPC message; the method of an answer is None.

    Document type declarations are refused, so that no entity can swell or reach out.

    Raises:
        Malformed: It is no XML-RPC.
        xmlrpc.client.Fault: It is a fault.
    """
    target = xmlrpc.client.Unmarshaller(use_builtin_types=True)
    parser = expat.ParserCreate()

    def _refuse(*_: object) -> None:
        raise Malformed("XML-RPC with a document type declaration")

    parser.StartDoctypeDeclHandler = _refuse
    parser.StartElementHandler, parser.EndElementHandler = target.start, target.end
    parser.CharacterDataHandler = target.data
    target.xml(cast("str", None), None)  # expat has decoded already
    try:
        parser.Parse(body, True)
        return list(target.close()), target.getmethodname()
    except (Malformed, xmlrpc.client.Fault):
        raise
    except Exception as error:  # a stranger's XML: whatever it makes the standard library raise
        raise Malformed(f"{len(body)} bytes are no XML-RPC ({type(error).__name__})") from None


def call(uri: str, method: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
    """The value that a master or node returns.

    Args:
        uri: `http://host:port/`.
        method: As `requestTopic`.
        arguments: The caller's name first.
        timeout: For all of it [s].

    Raises:
        NoAnswer: See there.
        Refused: The answer's code is not 1.
    """
    where = address(uri)
    if where is None:
        raise NoAnswer(f"{uri[:80]!r} is no http://host:port")
    body = xmlrpc.client.dumps(arguments, method, allow_none=False).encode()
    try:
        answer = _post(where, body, timeout)
        values, _ = parse(answer)
        code, text, value = values[0]
    except (OSError, http.client.HTTPException, UnicodeError) as error:
        raise NoAnswer(f"{method} of {uri}: {str(error)[:120] or type(error).__name__}") from None
    except xmlrpc.client.Fault as fault:
        raise NoAnswer(f"{method} of {uri}: fault {str(fault.faultString)[:120]}") from None
    except (Malformed, ValueError, TypeError, IndexError, KeyError) as error:
        raise NoAnswer(f"{method} of {uri}: no [code, text, value] ({str(error)[:120]})") from None
    if not isinstance(code, int) or not isinstance(text, str):
        raise NoAnswer(f"{method} of {uri}: no [code, text, value]")
    if code != 1:
        raise Refused(f"{method} of {uri}: {text[:120]}")
    return value


def _post(where: tuple[str, int], body: bytes, timeout: float) -> bytes:
    """The body of the answer to an HTTP POST."""
    deadline = time.monotonic() + timeout
    with contextlib.ExitStack() as opened:
        connection = http.client.HTTPConnection(*where, timeout=timeout)
        opened.callback(connection.close)
        connection.request("POST", "/", body, {"Content-Type": "text/xml"})
        response = opened.enter_context(connection.getresponse())
        if response.status != 200:
            raise http.client.HTTPException(f"HTTP status {response.status}")
        answer = bytearray()
        while chunk := response.read1(CHUNK):
            answer += chunk
            if len(answer) > MOST_BODY:
                raise http.client.HTTPException(f"answer above {MOST_BODY} bytes")
            if time.monotonic() > deadline:
                raise TimeoutError("timed out")
        return bytes(answer)


def answer(methods: Mapping[str, Method], body: bytes, log: EventLog) -> bytes:
    """XML of the answer to the XML of a call; a bad call gets a fault or a code of −1, never an exception.

    Args:
        methods: By name; each takes the caller's name and its arguments and returns `[code, text, value]`, and raises
            `TypeError` or `ValueError` for arguments that are not what they must be.
        body: As received.
        log: Where bad calls are noted.
    """
    try:
        arguments, name = parse(body)
    except (Malformed, xmlrpc.client.Fault) as error:
        log.note("rpc", f"bad call ({error})")
        return _xml(xmlrpc.client.Fault(1, "no XML-RPC call"))
    method = methods.get(name or "")
    if method is None:
        log.note("rpc", f"call of unknown method {str(name)[:60]!r}")
        return _xml(xmlrpc.client.Fault(1, "unknown method"))
    try:
        return _xml((method(*arguments),))
    except (TypeError, ValueError) as error:
        log.note("rpc", f"{name} with wrong arguments ({error})")
        return _xml(([-1, "wrong arguments", 0],))


def _xml(value: Any) -> bytes:
    return xmlrpc.client.dumps(value, methodresponse=True).encode()


class _Calls(BaseHTTPRequestHandler):
    """One call: HTTP/1.0, so that the connection ends with it."""

    server: SlaveServer
    timeout = PATIENCE

    def do_POST(self) -> None:
        """Answer a call."""
        try:
            size = int(self.headers.get("Content-Length", ""))
        except ValueError:
            size = -1
        if not 0 <= size <= MOST_BODY:
            self.server.log.note("rpc", f"call of {self.headers.get('Content-Length')!r} bytes")
            self.send_error(411 if size < 0 else 413)
            return
        body = self.rfile.read(size)
        if len(body) < size:
            self.server.log.note("rpc", f"call of {size} bytes ended after {len(body)}")
            return
        reply = answer(self.server.methods, body, self.server.log)
        self.send_response(200)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(reply)))
        self.end_headers()
        self.wfile.write(reply)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: what matters is in the log."""


class SlaveServer(socketserver.ThreadingMixIn, socketserver.TCPServer):
    """Serves calls until closed, each in a thread.

    Args:
        address: To listen on, this one only.
        methods: See `answer`.
        log: Where bad calls are noted.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True
    request_queue_size = 64

    def __init__(self, address: str, methods: Mapping[str, Method], log: EventLog) -> None:
        self.methods, self.log = methods, log
        self._places = threading.BoundedSemaphore(MOST_CALLERS)
        super().__init__((address, 0), _Calls)
        self._closed = False
        self._thread = threading.Thread(target=self._serve, name="ros1-slave", daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self._closed:
            self.handle_request()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve it if there is a place."""
        if not self._places.acquire(blocking=False):
            self.log.note("refused", f"more than {MOST_CALLERS} calls at once")
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except BaseException:
            self._places.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve it and give the place back."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    def handle_error(self, request: socket.socket | tuple[bytes, socket.socket], client_address: Any) -> None:
        """A caller that hung up or was too slow."""
        self.log.count("rpc")

    def close(self) -> None:
        """Stop listening."""
        self._closed = True
        with (
            contextlib.suppress(OSError),
            socket.create_connection(cast("tuple[str, int]", self.server_address), PATIENCE),
        ):
            pass  # wakes the thread, on every system
        self._thread.join(PATIENCE)
        self.server_close()
