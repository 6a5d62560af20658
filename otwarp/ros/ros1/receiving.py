"""Subscribing: one thread per publisher of a topic, which connects again for as long as the master lists it."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterable
from typing import Any

from otwarp.ros.ros1.interface import Newest
from otwarp.ros.ros1.journal import Journal
from otwarp.ros.ros1.messages import MessageType
from otwarp.ros.ros1.names import address
from otwarp.ros.ros1.rpc import NoAnswer, Refused, call
from otwarp.ros.ros1.sending import receive_header
from otwarp.ros.ros1.wire import Frames, Malformed, decode_header, encode_header

CONNECT = 5.0
"""Seconds that a publisher may take to accept and to answer with its header."""
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 2.0
"""Seconds before a lost publisher is tried again; doubled after each failure."""
CHUNK = 1 << 16
MOST_PUBLISHERS = 32
"""Publishers of one topic that are listened to."""
KEEPALIVE = (("TCP_KEEPIDLE", 10), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3))
"""A publisher whose machine died is noticed after 25 s; where the system lacks an option it keeps its own."""

Callback = Callable[[Any], None]


class WrongPublisher(Exception):
    """A publisher whose answer does not fit the subscription; one line."""


class Subscription(Newest):
    """A topic that this node listens to.

    With a callback, each message is handed to it in the thread of its publisher. Without one, only the newest message
    is kept and of messages that come together only the last is decoded; `take` and `latest` fetch it.

    Args:
        topic: Global name.
        message_type: Of its messages.
        callback: Or None.
        caller: Name of the node.
        most: Largest message accepted [bytes].
        journal: Where lost connections and bad messages are noted.
        release: Called once by `close`.
    """

    def __init__(
        self,
        topic: str,
        message_type: MessageType,
        callback: Callback | None,
        *,
        caller: str,
        most: int,
        journal: Journal,
        release: Callable[[Subscription], None],
    ) -> None:
        super().__init__()
        self.topic, self.type, self._callback = topic, message_type, callback
        self.caller, self.most, self.journal, self._release = caller, most, journal, release
        self._links: dict[str, Link] = {}
        self._changing = threading.Lock()
        self._closed = False

    @property
    def connections(self) -> int:
        """How many publishers are connected."""
        return sum(link.connected for link in list(self._links.values()))

    def publishers(self, uris: Iterable[str]) -> None:
        """Listen to these publishers, by the URIs of their nodes, and to no others."""
        wanted = [uri for uri in dict.fromkeys(uris) if address(uri) is not None]
        if len(wanted) > MOST_PUBLISHERS:
            self.journal.note("refused", f"{self.topic} has {len(wanted)} publishers, {MOST_PUBLISHERS} are heard")
            wanted = wanted[:MOST_PUBLISHERS]
        with self._changing:
            if self._closed:
                return
            gone = [self._links.pop(uri) for uri in list(self._links) if uri not in wanted]
            for uri in wanted:
                if uri not in self._links:
                    self._links[uri] = Link(uri, self)
        for link in gone:
            link.stop()

    def deliver(self, bodies: list[bytes]) -> None:
        """Decode messages and hand them on.

        Raises:
            Malformed: One of them is not of the topic's type.
        """
        if self._callback is None:
            self.put(self.type.decode(bodies[-1]), len(bodies))
            return
        for body in bodies:
            message = self.type.decode(body)
            self.put(message)
            try:
                self._callback(message)
            except Exception as error:  # the user's function must not end the connection
                self.journal.note("callback", f"{self.topic}: {type(error).__name__}: {error}")

    def close(self) -> None:
        """Stop listening; may be called more than once. No message is handed on after it, save one in a callback."""
        with self._changing:
            closed, self._closed = self._closed, True
            links = list(self._links.values())
            self._links.clear()
        for link in links:
            link.stop()
        if not closed:
            self._release(self)


class Link:
    """The thread that listens to one publisher.

    Args:
        uri: Of the publisher's node.
        subscription: What it listens for.
    """

    def __init__(self, uri: str, subscription: Subscription) -> None:
        self._uri, self._for = uri, subscription
        self._stopped = threading.Event()
        self._socket: socket.socket | None = None
        self.connected = False
        threading.Thread(target=self._run, name="ros1-subscribe", daemon=True).start()

    def _run(self) -> None:
        journal, topic, pause = self._for.journal, self._for.topic, FIRST_PAUSE
        while not self._stopped.is_set():
            before = self._for.received
            try:
                self._listen()
            except Malformed as error:
                journal.note("malformed", f"{topic} from {self._uri}: {error}")
            except WrongPublisher as error:
                journal.note("md5" if "md5sum" in str(error) else "refused", f"{topic} from {self._uri}: {error}")
                pause = LONGEST_PAUSE
            except (NoAnswer, Refused, OSError) as error:
                if not self._stopped.is_set():
                    journal.note("connection", f"{topic} from {self._uri}: {error or type(error).__name__}")
            finally:
                self.connected = False
            if self._for.received != before:
                pause = FIRST_PAUSE
            self._stopped.wait(pause)
            pause = min(2.0 * pause, LONGEST_PAUSE)

    def _listen(self) -> None:
        """Connect and hand messages on until the connection ends."""
        subscription = self._for
        sock = socket.create_connection(self._ask(), timeout=CONNECT)
        with sock:
            self._socket = sock
            if self._stopped.is_set():
                return
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for option, value in KEEPALIVE:
                if hasattr(socket, option):
                    sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
            frames, chunk = Frames(subscription.most), self._greet(sock)
            self.connected = True
            sock.settimeout(None)
            while not self._stopped.is_set():
                bodies = frames.feed(chunk)
                if bodies:
                    subscription.deliver(bodies)
                chunk = sock.recv(CHUNK)
                if not chunk:
                    raise ConnectionResetError("publisher has gone")

    def _ask(self) -> tuple[str, int]:
        """Where the publisher's node sends the topic."""
        found = call(self._uri, "requestTopic", self._for.caller, self._for.topic, [["TCPROS"]])
        match found:
            case ["TCPROS", str(host), int(port), *_] if host.isascii() and 0 < port < 65536:
                return host, port
        raise NoAnswer(f"requestTopic of {self._uri}: no ['TCPROS', host, port]")

    def _greet(self, sock: socket.socket) -> bytes:
        """Exchange headers; what came right behind the publisher's."""
        wanted = self._for.type
        sock.sendall(
            encode_header(
                {
                    "callerid": self._for.caller,
                    "topic": self._for.topic,
                    "type": wanted.name,
                    "md5sum": wanted.md5,
                    "message_definition": wanted.definition,
                    "tcp_nodelay": "1",
                }
            )
        )
        body, rest = receive_header(sock, CONNECT)
        header = decode_header(body)
        if "error" in header:
            raise WrongPublisher(f"refused: {header['error'][:120]}")
        for field, mine in (("md5sum", wanted.md5), ("type", wanted.name)):
            theirs = header.get(field)
            if theirs not in (mine, "*"):
                raise WrongPublisher(f"{field} is {str(theirs)[:80]}, must be {mine}")
        return rest

    def stop(self) -> None:
        """Hang up and try no more."""
        self._stopped.set()
        sock = self._socket
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
