"""ROS as a sink of a live session: states out as topics, hands' and controllers' motions in as commands."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from otwarp.errors import InputError
from otwarp.ros.motion import Group, move_pair
from otwarp.ros.roles import Roles
from otwarp.teleop import Command, LiveFrame, MoveTraps, Reset, ShiftTraps, Stop

if TYPE_CHECKING:
    from otwarp.ros.ros1.bridge import Ros1Bridge
    from otwarp.ros.ros1.node import Ros1Node
    from otwarp.ros.ros2.bridge import Ros2Bridge
    from otwarp.ros.ros2.node import Ros2Node

LINES = 20
"""Refused commands and peers that are reported on the terminal; a controller may repeat its mistake at 60 Hz."""


class Ros1Sink:
    """The paper's ROS 1 contract, see `otwarp.ros.ros1.bridge`.

    Args:
        node: Closed with the sink.
        bridge: On that node, with `time.perf_counter` or `clock` as its clock.
        roles: What the topics mean.
        say: Takes lines for the user.
        clock: Of the bridge.
        alone: Whether the session has no other sink for a user: then the session ends with the node.
    """

    interval = 0.0  # the bridge has a rate of its own

    def __init__(
        self,
        node: Ros1Node,
        bridge: Ros1Bridge,
        roles: Roles,
        *,
        say: Callable[[str], None] = print,
        clock: Callable[[], float] = time.perf_counter,
        alone: bool = False,
    ):
        self._node, self._bridge, self._roles, self._clock, self._alone = node, bridge, roles, clock, alone
        self._say, self._say_of_node = _Sayer(say), _Sayer(say)  # no flood of refused peers hides a lost master
        self._warned = self._still = False
        self._noted = 0

    def publish(self, live: LiveFrame) -> None:
        """See `Sink`."""
        self._still = live.pace.paused
        self._noted, lines = self._node.log.since(self._noted)
        for line in lines:  # a peer of another type or md5, messages that are none, a master that went
            say = self._say_of_node if line.startswith("master:") else self._say
            say(f"ros1: {line}")
        if not self._node.alive:
            then = "ends" if self._alone else "goes on without it"
            self._warn_once(f"ros1: the node was shut down through ROS; the session {then}")
            return
        state = self._roles.state(live)
        self._bridge.publish(self._clock(), state.trap_points, state.robots, state.obstacles)

    def commands(self) -> Sequence[Command]:
        """See `Sink`: how far the hands' twists move each group; in a pause they move nothing."""
        if self._alone and not self._node.alive:
            return [Stop()]
        moved = self._bridge.commands(self._clock())
        if self._still:  # or the traps would leap when it ends, and lose what they hold
            return []
        return [ShiftTraps(traps, by) for traps, by in zip(self._roles.groups, moved, strict=True) if any(by)]

    def complain(self, line: str) -> None:
        """See `Sink`."""
        self._say(line)

    def close(self) -> None:
        """See `Sink`."""
        self._node.close()

    def _warn_once(self, line: str) -> None:
        if not self._warned:
            self._warned = True
            self._say_of_node(line)


class Ros2Sink:
    """The ROS 2 topics of the paper and of its RL companion, see `otwarp.ros.ros2.bridge`.

    Args:
        node: Closed with the sink.
        bridge: On that node.
        roles: What the topics mean.
        say: Takes lines for the user.
        clock: Monotonic [s].
    """

    interval = 0.0

    def __init__(
        self,
        node: Ros2Node,
        bridge: Ros2Bridge,
        roles: Roles,
        *,
        say: Callable[[str], None] = print,
        clock: Callable[[], float] = time.perf_counter,
    ):
        self._node, self._bridge, self._roles, self._clock = node, bridge, roles, clock
        self._traps: tuple[Group, Group] | None = None
        self._say = _Sayer(say)
        self._still = False

    def publish(self, live: LiveFrame) -> None:
        """See `Sink`; a state that is not finite is reported and not sent."""
        self._still = live.pace.paused
        state = self._roles.state(live)
        self._traps = state.traps
        try:
            self._bridge.publish(self._clock(), state)
        except InputError as error:
            self._say(f"ros2: {error}")

    def commands(self) -> Sequence[Command]:
        """See `Sink`: a reset, motions of the pair as one, motions of each group; in a pause nothing moves."""
        asked = self._bridge.commands(self._clock())
        if asked.reset:
            return [Reset()]
        if self._still:
            return []
        out: list[Command] = []
        if self._traps is not None and (asked.angle or any(asked.shift)):
            moved = move_pair(*self._traps, asked.shift, asked.angle)
            pairs = (
                pair
                for group, foci in zip(self._roles.groups, moved, strict=True)
                for pair in zip(group, foci, strict=True)
            )
            out.append(MoveTraps(dict(pairs)))
        out += [ShiftTraps(traps, by) for traps, by in zip(self._roles.groups, asked.hands, strict=True) if any(by)]
        return out

    def complain(self, line: str) -> None:
        """See `Sink`."""
        self._say(line)

    def close(self) -> None:
        """See `Sink`."""
        self._node.close()


class _Sayer:
    """Says the first lines, then that it will say no more."""

    def __init__(self, say: Callable[[str], None]):
        self._say, self._left = say, LINES

    def __call__(self, line: str) -> None:
        if self._left > 0:
            self._left -= 1
            self._say(line if self._left else f"{line} (no more of these are shown)")
