"""Subscribing: one thread per publisher of a topic, which connects again for as long as the master lists it."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterable
from typing import Any

from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.messages import MessageType
from otwarp.ros.ros1.names import address
from otwarp.ros.ros1.rpc import NoAnswer, Refused, call
from otwarp.ros.ros1.wire import Frames, Malformed, decode_header, encode_header, receive_header

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


class Subscription:
    """One listener to a topic of this node.

    With a callback, each message is handed to it in the thread of its publisher. The newest message is kept in any
    case; `take` and `latest` fetch it.

    Args:
        topic: The topic that it listens to.
        callback: Takes each message, or None.

    Attributes:
        received: Messages that came.
    """

    def __init__(self, topic: SubscribedTopic, callback: Callback | None) -> None:
        self.topic, self.callback = topic, callback
        self.received = 0
        self._lock = threading.Lock()
        self._newest: tuple[int, Any] | None = None
        self._taken = 0
        self.closed = False

    @property
    def connections(self) -> int:
        """How many publishers are connected."""
        return 0 if self.closed else self.topic.connections

    @property
    def peers(self) -> tuple[str, ...]:
        """Names of the nodes that publish, or that did last if none is connected."""
        return self.topic.peers

    def latest(self) -> tuple[int, Any] | None:
        """(how many messages had come with it, the newest message), or None before the first."""
        return self._newest

    def take(self) -> Any | None:
        """The newest message if it was not taken yet, else None."""
        newest = self._newest
        if newest is None or newest[0] == self._taken:
            return None
        self._taken = newest[0]
        return newest[1]

    def deliver(self, message: Any, came: int) -> None:
        """A message, the last of so many that came."""
        if self.closed:
            return
        with self._lock:
            self.received += came
            self._newest = (self.received, message)
        if self.callback is None:
            return
        try:
            self.callback(message)
        except Exception as error:  # the user's function must not end the connection
            self.topic.log.note("callback", f"{self.topic.name}: {type(error).__name__}: {error}")

    def close(self) -> None:
        """Stop listening; may be called more than once. No message is handed on after it, save one in a callback."""
        closed, self.closed = self.closed, True
        if not closed:
            self.topic.leave(self)


class SubscribedTopic:
    """A topic that this node listens to: one connection to each publisher, however many listen to it here.

    Publishers of `rospy` drop the older of two connections from one node, so that a second one would end the first.

    Args:
        name: Global name.
        message_type: Of its messages.
        caller: Name of the node.
        most: Largest message accepted [bytes].
        log: Where lost connections and bad messages are noted.
        release: Called when the last listener has left.
    """

    def __init__(
        self,
        name: str,
        message_type: MessageType,
        *,
        caller: str,
        most: int,
        log: EventLog,
        release: Callable[[SubscribedTopic], None],
    ) -> None:
        self.name, self.type = name, message_type
        self.caller, self.most, self.log, self._release = caller, most, log, release
        self.received = 0
        self._links: dict[str, PublisherLink] = {}
        self._listeners: tuple[Subscription, ...] = ()
        self._latched: dict[str, Any] = {}
        self._peers: tuple[str, ...] = ()
        self.changing = threading.Lock()
        self._closed = False

    @property
    def connections(self) -> int:
        """How many publishers are connected."""
        return sum(link.connected for link in list(self._links.values()))

    @property
    def peers(self) -> tuple[str, ...]:
        """Names of the nodes that publish, or that did last if none is connected."""
        now = tuple(sorted(link.peer for link in list(self._links.values()) if link.connected))
        self._peers = now or self._peers
        return self._peers

    def greeted(self, peer: str) -> None:
        """A publisher of this name has connected."""
        self._peers = (peer,)

    def join(self, callback: Callback | None) -> Subscription:
        """One more listener; it gets the last message of publishers that latch."""
        subscription = Subscription(self, callback)
        with self.changing:
            self._listeners = (*self._listeners, subscription)
            latched = list(self._latched.values())
        for message in latched:
            subscription.deliver(message, 1)
        return subscription

    def leave(self, subscription: Subscription) -> None:
        """One listener less; the last one ends the connections."""
        with self.changing:
            self._listeners = tuple(one for one in self._listeners if one is not subscription)
            last = not self._listeners and not self._closed
            if last:
                self._closed = True
                links = list(self._links.values())
                self._links.clear()
        if last:
            for link in links:
                link.stop()
            self._release(self)

    def close(self) -> None:
        """End all listeners."""
        for subscription in self._listeners:
            subscription.close()

    def publishers(self, uris: Iterable[str]) -> None:
        """Listen to these publishers, by the URIs of their nodes.

        A connection to one that is not listed goes on until the publisher ends it, and is not made again: a master that
        has restarted lists them one by one, as they come back to it.
        """
        wanted = [uri for uri in dict.fromkeys(uris) if address(uri) is not None]
        if len(wanted) > MOST_PUBLISHERS:
            self.log.note("refused", f"{self.name} has {len(wanted)} publishers, {MOST_PUBLISHERS} are heard")
            wanted = wanted[:MOST_PUBLISHERS]
        with self.changing:
            if self._closed:
                return
            for uri, link in list(self._links.items()):
                link.wanted = uri in wanted
                if not link.wanted and not link.connected:
                    self.forget(link)
                    link.stop()
            for uri in wanted:
                if uri not in self._links:
                    self._links[uri] = PublisherLink(uri, self)

    def forget(self, link: PublisherLink) -> None:
        """Take a link from the list; the caller holds `changing`."""
        if self._links.get(link.uri) is link:
            del self._links[link.uri]
            self._latched.pop(link.uri, None)

    def deliver(self, bodies: list[bytes], latched_by: str | None) -> None:
        """Decode messages that came together, and hand them on; only the last, where nobody has a callback.

        Raises:
            Malformed: One of them is not of the topic's type.
        """
        every = any(listener.callback is not None for listener in self._listeners)
        for group in [[body] for body in bodies] if every else [bodies]:
            message = self.type.decode(group[-1])
            with self.changing:
                self.received += len(group)
                if latched_by is not None:
                    self._latched[latched_by] = message
                listeners = self._listeners
            for listener in listeners:
                listener.deliver(message, len(group))


class PublisherLink:
    """The thread that listens to one publisher.

    Args:
        uri: Of the publisher's node.
        topic: What it listens for.

    Attributes:
        peer: Name of the node, once it has said it.
        wanted: Whether the master lists the publisher; False lets the connection be the last.
        connected: Whether messages may come.
    """

    def __init__(self, uri: str, topic: SubscribedTopic) -> None:
        self.uri, self._topic = uri, topic
        self.wanted = True
        self._latching = False
        self.peer = uri
        self._stopped = threading.Event()
        self._socket: socket.socket | None = None
        self.connected = False
        threading.Thread(target=self._run, name="ros1-subscribe", daemon=True).start()

    def _run(self) -> None:
        log, name, pause = self._topic.log, self._topic.name, FIRST_PAUSE
        while not self._stopped.is_set():
            before = self._topic.received
            try:
                self._listen()
            except Malformed as error:
                log.note("malformed", f"{name} from {self._whom()}: {error}")
            except WrongPublisher as error:
                log.note("md5" if "md5sum" in str(error) else "refused", f"{name} from {self._whom()}: {error}")
                pause = LONGEST_PAUSE
            except (NoAnswer, Refused, OSError) as error:
                if not self._stopped.is_set():
                    log.note("connection", f"{name} from {self._whom()}: {error or type(error).__name__}")
            finally:
                self.connected = False
            with self._topic.changing:
                if not self.wanted:
                    self._topic.forget(self)
                    return
            if self._topic.received != before:
                pause = FIRST_PAUSE
            self._stopped.wait(pause)
            pause = min(2.0 * pause, LONGEST_PAUSE)

    def _whom(self) -> str:
        """The publisher, for messages."""
        return self.uri if self.peer == self.uri else f"{self.peer} ({self.uri})"

    def _listen(self) -> None:
        """Connect and hand messages on until the connection ends."""
        topic = self._topic
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
            frames, chunk = Frames(topic.most), self._greet(sock)
            self.connected = True
            topic.greeted(self.peer)
            sock.settimeout(None)
            while not self._stopped.is_set():
                bodies = frames.feed(chunk)
                if bodies:
                    topic.deliver(bodies, self.uri if self._latching else None)
                chunk = sock.recv(CHUNK)
                if not chunk:
                    raise ConnectionResetError("publisher has gone")

    def _ask(self) -> tuple[str, int]:
        """Where the publisher's node sends the topic."""
        found = call(self.uri, "requestTopic", self._topic.caller, self._topic.name, [["TCPROS"]])
        match found:
            case ["TCPROS", str(host), int(port), *_] if host.isascii() and 0 < port < 65536:
                return host, port
        raise NoAnswer(f"requestTopic of {self.uri}: no ['TCPROS', host, port]")

    def _greet(self, sock: socket.socket) -> bytes:
        """Exchange headers; what came right behind the publisher's."""
        wanted = self._topic.type
        sock.sendall(
            encode_header(
                {
                    "callerid": self._topic.caller,
                    "topic": self._topic.name,
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
        self._latching = header.get("latching") == "1"
        self.peer = header.get("callerid", self.uri)[:80]
        return rest

    def stop(self) -> None:
        """Hang up and try no more."""
        self._stopped.set()
        sock = self._socket
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
