"""Draggable handles: one per trap, one per hand that moves several, one per hand that the page itself moves.

While somebody drags, the server leaves that handle alone; after letting go it waits `HOLD_OFF` for the commands to come
back in a frame. So a handle never fights the mouse. Whenever nobody holds it, it shows where its traps are, or where
they are going: drags move them gently, so they may come after it.

A hand without a device is a `Pointer`: its handle writes where the hand is into the mailbox of the servo's `mouse`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from otwarp.haptics.core import ZERO, Vec3
from otwarp.haptics.core.fields import Matrix
from otwarp.teleop import HANDS, Command, HandFrame, MoveTraps, vec3
from otwarp.teleop.page.protocol import PageFrame, TrapDrawing

POINTER_EVERY = 0.1
"""Seconds between two words to the mailbox; the device takes `mouse.SILENCE` = 0.5 s of silence for a release."""
DEAD_MAN = 1
"""Button 0, held while the page lives."""
HOLD_OFF = 0.3
"""Seconds after a drag in which a handle stays where it was put."""
MODES = ("hands", "traps", "both", "none")
"""Which handles are shown."""


class Pointer:
    """Where one hand is to be.

    Args:
        write: Puts (x, y, z, buttons) [m] into the mailbox.
        axis_map: A, orthogonal, scene = A·device.
    """

    def __init__(self, write: Callable[[tuple[float, float, float, int]], None], axis_map: Matrix):
        self._write, self._axes = write, axis_map
        self._target: Vec3 = ZERO
        self._base: Vec3 = ZERO
        self._written = float("-inf")

    @property
    def target(self) -> Vec3:
        """In the device's frame [m]."""
        return self._target

    def take(self, hand: Vec3 | None) -> None:
        """The gizmo is taken while the hand is there [m]; None if nobody knows, for where it was to be."""
        self._base = self._target if hand is None else hand

    def move(self, shift: Vec3, gain: float) -> None:
        """The gizmo is at this distance from where it was taken.

        target = base + Aᵀ·shift / gain

        Args:
            shift: In the scene's frame [µm].
            gain: Motion gain [µm/m].
        """
        a, (x, y, z) = self._axes, self._base
        dx, dy, dz = (sum(a[row][column] * shift[row] for row in range(3)) / gain for column in range(3))
        self._target = (x + dx, y + dy, z + dz)
        self._written = float("-inf")

    def tick(self, now: float, watched: bool) -> None:
        """Write if it is time to, and only while a window is open: silence lets go of the dead-man switch."""
        if watched and now - self._written >= POINTER_EVERY:
            self._written = now
            self._write((*self._target, DEAD_MAN))


class Handle(Protocol):
    """What of viser's transform controls is used."""

    position: Any
    visible: bool


@dataclass(eq=False)
class Gizmo:
    """A handle and the traps it moves.

    Attributes:
        name: Unique.
        traps: Indices.
        hand: `left`, `right` or `none`.
        whole: Whether it moves a whole hand.
        pointer: Of a hand that the page moves, else None.
        handle: In viser.
        draggers: Windows that hold it.
        free_at: Time until which the server leaves it alone [s].
        taken: Where it was when the drag began, and where its traps were or were going, by index [µm].
    """

    name: str
    traps: tuple[int, ...]
    hand: str
    whole: bool
    pointer: Pointer | None
    handle: Handle
    draggers: set[int] = field(default_factory=set)
    free_at: float = float("-inf")
    taken: tuple[Vec3, dict[int, Vec3]] | None = None


class Gizmos:
    """All handles of a page; one thread.

    Args:
        traps: As drawn.
        pointers: Hand → pointer, for hands that the page moves.
        make: (name of the gizmo, position, whether it moves a whole hand) → handle.
    """

    def __init__(
        self,
        traps: Sequence[TrapDrawing],
        pointers: Mapping[str, Pointer],
        make: Callable[[str, Vec3, bool], Handle],
    ):
        self.gizmos: dict[str, Gizmo] = {}
        self._places = {k: trap.position for k, trap in enumerate(traps)}
        self._hands: dict[str, HandFrame] = {}
        for hand in HANDS:
            group = tuple(k for k, trap in enumerate(traps) if trap.hand == hand)
            if len(group) > 1 or (group and hand in pointers):
                centre = self._centre(group)
                self._add(
                    Gizmo(f"hand_{hand}", group, hand, True, pointers.get(hand), make(f"hand_{hand}", centre, True))
                )
        for k, trap in enumerate(traps):
            if trap.hand not in pointers:
                handle = make(f"trap_{k}", trap.position, False)
                self._add(Gizmo(f"trap_{k}", (k,), trap.hand, False, None, handle))
        self.mode = "both"

    @property
    def dragged(self) -> frozenset[int]:
        """Traps that somebody drags."""
        return frozenset(k for gizmo in self.gizmos.values() if gizmo.draggers for k in gizmo.traps)

    def update(self, frame: PageFrame, now: float) -> None:
        """Follow a frame, but for handles that somebody holds or has just let go."""
        # a trap on its way counts as there already: its handle waits for it, and a further drag begins at the goal
        places = {k: vec3(row) for k, row in enumerate(frame.trap_position) if np.isfinite(row).all()}
        self._places = places | dict(frame.trap_goals)
        self._hands = {hand.name: hand for hand in frame.hands}
        for gizmo in self.gizmos.values():
            gizmo.handle.visible = self.shown(gizmo)
            known = all(k in self._places for k in gizmo.traps)
            if not gizmo.draggers and now >= gizmo.free_at and known:
                gizmo.handle.position = self._centre(gizmo.traps)

    def shown(self, gizmo: Gizmo) -> bool:
        """Whether a handle is to be seen: not if hidden by choice, nor if a device holds one of its traps."""
        if self.locked(gizmo) or self.mode == "none":
            return False
        return self.mode == "both" or gizmo.whole == (self.mode == "hands") or not self._has_other(gizmo)

    def locked(self, gizmo: Gizmo) -> bool:
        """Whether a device that answers holds one of its traps."""
        if gizmo.pointer is not None:
            return False
        holding = {k for hand in self._hands.values() if hand.present for k in hand.traps}
        return not holding.isdisjoint(gizmo.traps)

    def drag(self, name: str, client: int, phase: str, position: Vec3, now: float) -> list[Command]:
        """Somebody drags a handle.

        Args:
            name: Of the gizmo.
            client: Window.
            phase: `start`, `update` or `end`.
            position: Of the handle [µm].
            now: On the clock of `update` [s].

        Returns:
            What to ask of the session; nothing for a hand that the page moves, whose pointer is moved instead.
        """
        gizmo = self.gizmos.get(name)
        if gizmo is None or self.locked(gizmo) or not np.isfinite(position).all():
            return []
        if phase == "start" or gizmo.taken is None:
            self._take(gizmo, position)
        moved = self._moved(gizmo, position)
        if phase == "end":
            gizmo.draggers.discard(client)
            gizmo.taken = None if not gizmo.draggers else gizmo.taken
            gizmo.free_at = now + HOLD_OFF
        else:
            gizmo.draggers.add(client)
        return moved if phase != "start" else []

    def release(self, client: int, now: float) -> None:
        """A window has gone, and with it whatever it dragged."""
        for gizmo in self.gizmos.values():
            if client in gizmo.draggers:
                gizmo.draggers.discard(client)
                gizmo.taken = None if not gizmo.draggers else gizmo.taken
                gizmo.free_at = now + HOLD_OFF

    def _take(self, gizmo: Gizmo, position: Vec3) -> None:
        # a trap that no frame has placed yet is where it was drawn
        gizmo.taken = (position, {k: self._places[k] for k in gizmo.traps if k in self._places})
        if gizmo.pointer is not None:
            hand = self._hands.get(gizmo.hand)
            gizmo.pointer.take(hand.now.position if hand is not None and hand.now is not None else None)

    def _moved(self, gizmo: Gizmo, position: Vec3) -> list[Command]:
        assert gizmo.taken is not None
        start, places = gizmo.taken
        shift = (position[0] - start[0], position[1] - start[1], position[2] - start[2])
        if gizmo.pointer is not None:
            hand = self._hands.get(gizmo.hand)
            if hand is not None:  # its gain is not known before the first frame
                gizmo.pointer.move(shift, hand.motion_gain)
            return []
        if not gizmo.whole:
            return [MoveTraps({gizmo.traps[0]: position}, gently=True)]
        goals = {k: (x + shift[0], y + shift[1], z + shift[2]) for k, (x, y, z) in places.items()}
        return [MoveTraps(goals, gently=True)]

    def _add(self, gizmo: Gizmo) -> None:
        self.gizmos[gizmo.name] = gizmo

    def _has_other(self, gizmo: Gizmo) -> bool:
        """Whether another handle moves the same traps: a lone trap keeps its own in every mode but `none`."""
        return any(o is not gizmo and not set(o.traps).isdisjoint(gizmo.traps) for o in self.gizmos.values())

    def _centre(self, traps: Sequence[int]) -> Vec3:
        return vec3(np.mean([self._places[k] for k in traps], axis=0))
