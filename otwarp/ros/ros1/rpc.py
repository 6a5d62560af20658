"""XML-RPC calls to a master or another node, with a limit on time and size; ROS answers `[code, text, value]`."""

from __future__ import annotations

import contextlib
import http.client
import time
import xmlrpc.client
from typing import Any, cast
from xml.parsers import expat

from otwarp.ros.ros1.names import address
from otwarp.ros.ros1.wire import Malformed

TIMEOUT = 5.0
"""Seconds for one call."""
MOST_BODY = 1 << 20
"""Largest call or answer [bytes]; the state of a graph of a thousand topics takes a fifth of it."""
CHUNK = 1 << 16


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
