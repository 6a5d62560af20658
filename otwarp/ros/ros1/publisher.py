"""Publishing: one listening socket per node, one thread and one bounded queue per subscriber."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from otwarp.errors import InputError
from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.messages import MessageType
from otwarp.ros.ros1.wire import Malformed, decode_header, encode_header, packed, receive_header

HANDSHAKE = 5.0
"""Seconds that a subscriber may take for its header."""
STUCK = 5.0
"""Seconds that a subscriber may read nothing while there is something for it."""
IDLE = 0.5
"""Seconds after which a connection without messages is looked at: has the subscriber gone?"""
MOST_CONNECTIONS = 128
"""Subscribers of one node, and those that have not said yet what they want."""
QUEUE = 16
"""Messages that wait for one subscriber; 60 Hz for a quarter of a second."""
CHUNK = 1 << 12


class SubscriberLink:
    """What waits for one subscriber, and the socket to it."""

    def __init__(self, sock: socket.socket, peer: str, queue: int) -> None:
        self.sock, self.peer = sock, peer
        self.dropped = self.sent = 0
        self._waiting: deque[bytes] = deque(maxlen=queue)
        self._wake = threading.Condition()
        self._busy = self._ended = False

    def put(self, frame: bytes) -> bool:
        """Queue a message; False if the oldest had to go for it."""
        with self._wake:
            full = len(self._waiting) == self._waiting.maxlen
            self._waiting.append(frame)
            self.dropped += full
            self._wake.notify_all()
        return not full

    def run(self) -> None:
        """Send what is queued until the subscriber goes or `end` is called.

        Raises:
            OSError: The subscriber has gone, or does not read.
        """
        self.sock.settimeout(STUCK)
        while True:
            with self._wake:
                self._busy = False
                self._wake.notify_all()
                if not self._waiting and not self._ended:
                    self._wake.wait(IDLE)
                if self._ended and not self._waiting:
                    return
                frames, self._busy = list(self._waiting), True
                self._waiting.clear()
            if frames:
                self.sock.sendall(b"".join(frames))
                self.sent += len(frames)
            elif select.select([self.sock], [], [], 0.0)[0] and not self.sock.recv(CHUNK):
                raise ConnectionResetError("subscriber has gone")  # what a subscriber says after its header is ignored

    def flush(self, deadline: float) -> None:
        """Wait until all is sent, or the monotonic clock shows `deadline` [s]."""
        with self._wake:
            self._wake.wait_for(
                lambda: self._ended or not (self._waiting or self._busy), max(deadline - time.monotonic(), 0.0)
            )

    def end(self) -> None:
        """Hang up: what waits is dropped, and the thread ends."""
        with self._wake:
            self._ended = True
            self._waiting.clear()
            self._wake.notify_all()
        with contextlib.suppress(OSError):
            self.sock.shutdown(socket.SHUT_RDWR)


class Publisher:
    """A topic that this node publishes.

    Args:
        topic: Global name.
        message_type: Of its messages.
        latch: Whether a new subscriber gets the last message at once.
        queue: Messages that wait for a subscriber before the oldest is dropped.
        log: Counts `dropped`.
        release: Called once by `close`.
    """

    def __init__(
        self,
        topic: str,
        message_type: MessageType,
        *,
        latch: bool,
        queue: int,
        log: EventLog,
        release: Callable[[Publisher], None],
    ) -> None:
        if not 1 <= queue <= 10_000:
            raise InputError(f"queue of {topic} is {queue!r}; allowed: 1 to 10000 messages")
        self.topic, self.type, self.latch = topic, message_type, latch
        self._queue, self._log, self._release = queue, log, release
        self._lock = threading.Lock()
        self._connections: list[SubscriberLink] = []
        self._last: bytes | None = None
        self._closed = False

    @property
    def connections(self) -> int:
        """How many subscribers are connected."""
        return len(self._connections)

    def publish(self, message: Any) -> None:
        """Hand a message to all subscribers; never waits for one of them.

        Raises:
            InputError: The message is not of the topic's type.
        """
        frame = packed(self.type.encode(message))
        with self._lock:
            if self._closed:
                return
            if self.latch:
                self._last = frame
            for connection in self._connections:
                if not connection.put(frame):
                    self._log.count("dropped")

    def flush(self, timeout: float) -> None:
        """Wait until subscribers were sent what is queued, at most `timeout` [s]."""
        deadline = time.monotonic() + timeout
        for connection in list(self._connections):
            connection.flush(deadline)

    def refusal(self, header: dict[str, str]) -> str | None:
        """Why a subscriber's header does not fit this topic, or None."""
        for field, mine in (("md5sum", self.type.md5), ("type", self.type.name)):
            theirs = header.get(field)
            if theirs is None:
                return f"header lacks {field}"
            if theirs not in (mine, "*"):
                return f"{field} of {self.topic} is {mine}, subscriber has {theirs[:80]}"
        return None

    def serve(self, sock: socket.socket, peer: str) -> None:
        """Send to a subscriber whose header fits, until it goes or the topic is closed."""
        connection = SubscriberLink(sock, peer, self._queue)
        with self._lock:
            if self._closed:
                return
            if self._last is not None:
                connection.put(self._last)
            self._connections.append(connection)
        try:
            connection.run()
        finally:
            connection.end()
            with self._lock:
                self._connections.remove(connection)

    def close(self) -> None:
        """Take the topic back; may be called more than once."""
        with self._lock:
            closed, self._closed = self._closed, True
            connections = list(self._connections)
        for connection in connections:
            connection.end()
        if not closed:
            self._release(self)


class TopicServer:
    """The TCPROS socket of a node.

    Args:
        address: To listen on, this one only.
        name: Of the node.
        find: Publisher of a topic, or None.
        log: Where refused subscribers are noted.
    """

    def __init__(self, address: str, name: str, find: Callable[[str], Publisher | None], log: EventLog) -> None:
        self._name, self._find, self._log = name, find, log
        self._socket = socket.create_server((address, 0), backlog=64)
        self.port: int = self._socket.getsockname()[1]
        self._places = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self._closed = False
        self._thread = threading.Thread(target=self._accept, name="ros1-topics", daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        while True:
            try:
                sock, where = self._socket.accept()
            except OSError as error:
                if self._closed:
                    return
                self._log.note("connection", f"accept failed ({error})")
                time.sleep(IDLE)  # out of file descriptors, or the like: do not spin on it
                continue
            if self._closed:
                sock.close()
                return
            if not self._places.acquire(blocking=False):
                self._log.note("refused", f"more than {MOST_CONNECTIONS} subscribers")
                sock.close()
                continue
            peer = f"{where[0]}:{where[1]}"
            threading.Thread(target=self._serve, args=(sock, peer), name="ros1-publish", daemon=True).start()

    def _serve(self, sock: socket.socket, peer: str) -> None:
        try:
            with sock:
                sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                publisher = self._greet(sock, peer)
                if publisher is not None:
                    publisher.serve(sock, peer)
        except Malformed as error:
            self._log.note("malformed", f"subscriber {peer}: {error}")
        except OSError:
            self._log.count("connection")
        finally:
            self._places.release()

    def _greet(self, sock: socket.socket, peer: str) -> Publisher | None:
        """The publisher that a subscriber asks for in its header, after it was answered; None if it was refused."""
        header = decode_header(receive_header(sock, HANDSHAKE)[0])
        publisher = self._find(header.get("topic", ""))
        if publisher is None:
            complaint = f"no topic {header.get('topic', '')[:80]!r} here"
        else:
            complaint = publisher.refusal(header)
        if publisher is None or complaint is not None:
            kind = "md5" if complaint and complaint.startswith("md5sum of") else "refused"
            self._log.note(kind, f"subscriber {peer} ({header.get('callerid', '')[:60]}): {complaint}")
            sock.sendall(encode_header({"error": complaint or ""}))
            return None
        sock.sendall(
            encode_header(
                {
                    "callerid": self._name,
                    "topic": publisher.topic,
                    "type": publisher.type.name,
                    "md5sum": publisher.type.md5,
                    "message_definition": publisher.type.definition,
                    "latching": "1" if publisher.latch else "0",
                }
            )
        )
        return publisher

    def close(self) -> None:
        """Stop listening."""
        self._closed = True
        with contextlib.suppress(OSError), socket.create_connection(self._socket.getsockname(), HANDSHAKE):
            pass  # wakes the thread, on every system
        self._thread.join(HANDSHAKE)
        self._socket.close()
