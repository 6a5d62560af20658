from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from otwarp.haptics.core import ServoFrame, Vec3
from otwarp.haptics.core.config import FACING_USER
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices.mouse import POINTER, SPEED, MouseDevice
from otwarp.teleop import HandFrame, MoveTraps
from otwarp.teleop.page.gizmos import HOLD_OFF, POINTER_EVERY, Gizmos, Pointer
from tests.teleop.page.frames import page_frame, trap

PLACES = [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 9.0, 2.0), (1.0, 1.0, 1.0)]
TRAPS = [trap("left", PLACES[0]), trap("left", PLACES[1]), trap("right", PLACES[2]), trap("none", PLACES[3])]


@dataclass
class Fake:
    """A transform control that counts how often it is put somewhere."""

    _position: Vec3
    visible: bool = True
    puts: int = 0

    @property
    def position(self) -> Vec3:
        return self._position

    @position.setter
    def position(self, place: Vec3) -> None:
        self._position, self.puts = place, self.puts + 1


def make(pointers: dict[str, Pointer] | None = None) -> tuple[Gizmos, dict[str, Fake]]:
    handles: dict[str, Fake] = {}

    def handle(name: str, position: Vec3, whole: bool) -> Fake:
        return handles.setdefault(name, Fake(position))

    return Gizmos(TRAPS, pointers or {}, handle), handles


def hand(**more: Any) -> HandFrame:
    given = {"name": "left", "device": "haply", "traps": (0, 1), "motion_gain": 200.0, "force_gain": 0.1, "clamp": 3.0}
    return HandFrame(**(given | {"present": True} | more))


def test_every_trap_has_a_handle_and_a_hand_of_several_one_more():
    gizmos, handles = make()
    assert set(gizmos.gizmos) == set(handles) == {"hand_left", "trap_0", "trap_1", "trap_2", "trap_3"}
    assert handles["hand_left"].position == (2.0, 0.0, 0.0)


def test_a_trap_goes_where_its_handle_goes():
    gizmos, _ = make()
    assert gizmos.drag("trap_2", 1, "start", PLACES[2], 0.0) == []
    assert gizmos.drag("trap_2", 1, "update", (1.0, 2.0, 3.0), 0.1) == [MoveTraps({2: (1.0, 2.0, 3.0)}, gently=True)]
    assert gizmos.drag("trap_2", 1, "end", (1.0, 2.0, 4.0), 0.2) == [MoveTraps({2: (1.0, 2.0, 4.0)}, gently=True)]


def test_a_hand_moves_its_traps_together_from_where_they_were():
    gizmos, handles = make()
    moved = [(10.0, 0.0, 0.0), (14.0, 0.0, 1.0), PLACES[2], PLACES[3]]
    gizmos.update(page_frame(moved), 0.0)
    assert handles["hand_left"].position == (12.0, 0.0, 0.5)
    gizmos.drag("hand_left", 1, "start", (12.0, 0.0, 0.5), 0.0)
    # frames that come meanwhile, with traps on their way, change nothing: targets are counted from the start
    for k in (1, 2):
        gizmos.update(page_frame([(10.0 + k, 5, 0), (14.0 + k, 5, 1), PLACES[2], PLACES[3]]), 0.1 * k)
        (asked,) = gizmos.drag("hand_left", 1, "update", (12.0, 1.0 * k, 0.5), 0.1 * k)
        assert asked == MoveTraps({0: (10.0, 1.0 * k, 0.0), 1: (14.0, 1.0 * k, 1.0)}, gently=True)


def test_the_server_leaves_a_handle_alone_that_somebody_holds_or_has_just_let_go():
    gizmos, handles = make()
    handle = handles["trap_3"]
    gizmos.drag("trap_3", 1, "start", PLACES[3], 0.0)
    gizmos.drag("trap_3", 1, "update", (5.0, 5.0, 5.0), 0.1)
    elsewhere = page_frame([*PLACES[:3], (7.0, 7.0, 7.0)])
    gizmos.update(elsewhere, 100.0)
    assert handle.puts == 0
    gizmos.drag("trap_3", 1, "end", (5.0, 5.0, 5.0), 100.0)
    gizmos.update(elsewhere, 100.0 + 0.9 * HOLD_OFF)
    assert handle.puts == 0
    gizmos.update(elsewhere, 100.0 + 1.1 * HOLD_OFF)
    assert handle.position == (7.0, 7.0, 7.0)


def test_a_handle_waits_for_traps_that_come_after_it():
    gizmos, handles = make()
    goals = {0: (10.0, 0.0, 0.0), 1: (14.0, 0.0, 0.0)}
    gizmos.drag("hand_left", 1, "start", (2.0, 0.0, 0.0), 0.0)
    assert gizmos.drag("hand_left", 1, "end", (12.0, 0.0, 0.0), 0.0) == [MoveTraps(goals, gently=True)]
    for k in range(1, 5):  # at 2 µm per frame
        gizmos.update(page_frame([(2.0 * k, 0, 0), (4.0 + 2.0 * k, 0, 0), *PLACES[2:]], trap_goals=goals), 1.0 * k)
        assert [handles[name].position[0] for name in ("hand_left", "trap_0", "trap_1")] == [12.0, 10.0, 14.0]
    # taken once more before they are there: they shall go on from where they are going
    gizmos.drag("hand_left", 1, "start", (12.0, 0.0, 0.0), 5.0)
    (asked,) = gizmos.drag("hand_left", 1, "end", (12.0, 1.0, 0.0), 5.0)
    assert asked == MoveTraps({0: (10.0, 1.0, 0.0), 1: (14.0, 1.0, 0.0)}, gently=True)
    # whose way has ended elsewhere is where it is
    gizmos.update(page_frame([(9.0, 0, 0), (13.0, 0, 0), *PLACES[2:]]), 6.0)
    assert handles["hand_left"].position == (11.0, 0.0, 0.0)


def test_a_window_that_closes_lets_go():
    gizmos, handles = make()
    gizmos.drag("trap_3", 1, "start", PLACES[3], 0.0)
    gizmos.drag("trap_3", 2, "start", PLACES[3], 0.0)
    gizmos.release(1, 1.0)
    gizmos.update(page_frame(PLACES), 5.0)
    assert handles["trap_3"].puts == 0 and gizmos.dragged == {3}
    gizmos.release(2, 6.0)
    gizmos.update(page_frame(PLACES), 7.0)
    assert handles["trap_3"].puts == 1 and gizmos.dragged == frozenset()


def test_what_a_device_holds_cannot_be_dragged_but_follows():
    gizmos, handles = make()
    gizmos.update(page_frame([(1.0, 0, 0), (5.0, 0, 0), *PLACES[2:]], hands=(hand(),)), 0.0)
    for name in ("hand_left", "trap_0", "trap_1"):
        assert not handles[name].visible
        assert gizmos.drag(name, 1, "start", (0.0, 0.0, 0.0), 0.0) == []
        assert gizmos.drag(name, 1, "update", (1.0, 0.0, 0.0), 0.0) == []
    assert handles["trap_1"].position == (5.0, 0.0, 0.0) and handles["trap_2"].visible
    gizmos.update(page_frame(PLACES, hands=(hand(present=False),)), 1.0)  # unplugged: the mouse may help
    assert handles["trap_0"].visible and gizmos.drag("trap_0", 1, "update", (1.0, 0.0, 0.0), 1.0)


@pytest.mark.parametrize(
    ("mode", "shown"),
    [
        ("both", {"hand_left", "trap_0", "trap_1", "trap_2", "trap_3"}),
        ("hands", {"hand_left", "trap_2", "trap_3"}),
        ("traps", {"trap_0", "trap_1", "trap_2", "trap_3"}),
        ("none", set()),
    ],
)
def test_handles_can_be_chosen(mode: str, shown: set[str]):
    gizmos, handles = make()
    gizmos.mode = mode
    gizmos.update(page_frame(PLACES), 0.0)
    assert {name for name, handle in handles.items() if handle.visible} == shown


@pytest.mark.parametrize("place", [(float("nan"), 0.0, 0.0), (0.0, float("inf"), 0.0)])
def test_places_that_are_none_are_ignored(place: Vec3):
    gizmos, handles = make()
    assert gizmos.drag("trap_3", 1, "update", place, 0.0) == []
    gizmos.update(page_frame([*PLACES[:3], place]), 1.0)
    assert handles["trap_3"].puts == 0 and handles["trap_2"].puts == 1
    assert gizmos.drag("no such", 1, "update", PLACES[0], 0.0) == []


def test_the_page_moves_a_hand_through_its_pointer():
    """From the handle through mailbox and device: the hand moves the other way round the axis map and the gain."""
    with Mailbox.create(POINTER) as box:
        device = MouseDevice(box.name)
        device.open()
        writer = Mailbox.attach(POINTER, box.name)
        pointer = Pointer(writer.write, FACING_USER)
        gizmos, handles = make({"left": pointer})
        assert set(handles) == {"hand_left", "trap_2", "trap_3"}  # its traps are moved as one
        gizmos.update(page_frame(PLACES, hands=(hand(device="mouse"),)), 0.0)
        pointer.tick(0.0, watched=True)
        assert device.read(0.0).buttons == 1
        gizmos.drag("hand_left", 1, "start", (2.0, 0.0, 0.0), 0.0)
        assert gizmos.drag("hand_left", 1, "update", (4.0, 6.0, -8.0), 0.1) == []
        pointer.tick(0.1, watched=True)
        # FACING_USER: scene x, y, z = device x, −z, y; 2 µm at 200 µm/m is 1 cm
        wanted = (0.01, -0.04, -0.03)
        assert pointer.target == pytest.approx(wanted)
        for k in range(1, 40):
            sample = device.read(0.1 * k)
            pointer.tick(0.1 * k, watched=True)
        assert sample.position == pytest.approx(wanted) and sample.buttons == 1 and 3.9 * SPEED > 0.1
        # taken again where the hand is by then, whatever was told before
        now = ServoFrame(1, 0.0, (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (), "armed", 0.0)
        gizmos.drag("hand_left", 1, "end", (4.0, 6.0, -8.0), 4.0)
        gizmos.update(page_frame(PLACES, hands=(hand(device="mouse", now=now),)), 5.0)
        gizmos.drag("hand_left", 1, "start", (2.0, 0.0, 0.0), 5.0)
        gizmos.drag("hand_left", 1, "update", (2.0, 2.0, 0.0), 5.0)
        assert pointer.target == pytest.approx((0.5, 0.0, -0.01))
        writer.close()
        device.close()


def test_the_pointer_falls_silent_when_nobody_looks():
    words: list[tuple[float, float, float, int]] = []
    pointer = Pointer(words.append, FACING_USER)
    for k in range(100):
        pointer.tick(0.03 * k, watched=True)
    assert 0.8 * 3.0 / POINTER_EVERY < len(words) <= 3.0 / POINTER_EVERY + 1
    told = len(words)
    for k in range(100):
        pointer.tick(3.0 + 0.03 * k, watched=False)
    assert len(words) == told and all(word[3] == 1 for word in words)
