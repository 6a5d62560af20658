"""The Inverse3 against a server that speaks the JSON of the Haply Inverse Service; no hardware, no service of Haply."""

from __future__ import annotations

import builtins
import math
import socket
import threading

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Device, DeviceLost
from otwarp.haptics.devices import create_device, inverse3, parse_devices
from otwarp.haptics.devices.exchange import GONE, HOLD, LOST, SILENCE, Exchange
from otwarp.haptics.devices.inverse3 import MOST_ANSWERS, SERVICE, Inverse3Device, ServiceLink, find_devices
from otwarp.haptics.devices.inverse3_messages import read_inventory
from otwarp.haptics.servo.link import HandSetup
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.devices.conftest import ServedHand, ended
from tests.haptics.devices.test_inverse3_messages import JUNK
from tests.haptics.haply_service import HaplyService
from tests.haptics.servo.test_servo_process import publishing, until
from tests.haptics.spring import SpringChain


@pytest.fixture
def service():
    with HaplyService(devices=("049D", "04BA"), grips=("61548", "61549")) as service:
        yield service
    assert not inverse3._taken
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("inverse3 ")]


@pytest.fixture
def device(service, clock):
    device = Inverse3Device(service.address, "049D", name="inverse3:049D", clock=clock)
    device.open()
    yield device
    device.close()


def drain(device: Inverse3Device, service: HaplyService) -> None:
    """Take what is there already; the service must be mute."""
    service.turns()
    while device.read(0.0).fresh:
        pass


def test_positions_buttons_and_axes_are_ours(device, service):
    assert isinstance(device, Device)
    assert device.info.kind == "inverse3"
    service.move("049D", 0.01, 0.02, 0.03)  # right, away from the user, up
    service.move("04BA", 0.5, 0.5, 0.5)
    service.grips["61548"] |= {"a": True, "c": True}
    service.grips["61549"] |= {"b": True}
    service.turns(3)
    sample = device.read(2.0)
    assert sample.position == (0.01, 0.03, -0.02)  # right, up, towards the user
    assert (sample.time, sample.buttons, sample.fresh) == (2.0, 0b101, True)


def test_forces_are_theirs(device, service):
    device.write((0.5, -1.0, 0.25))
    service.turns(3)
    assert service.forces["049D"][-1] == (0.5, -0.25, -1.0)
    assert service.forces["04BA"] == []
    assert service.forces["049D"][0] == ZERO  # the greeting
    assert service.greetings == [{"configure": {"basis": {"permutation": "XYZ"}}}]


@pytest.mark.parametrize("version", ["3.1", "3.5"])
def test_a_force_is_called_what_the_version_calls_it(version, clock):
    with HaplyService(version=version) as service:
        device = Inverse3Device(service.address, clock=clock)
        device.open()
        device.write((0.0, 1.0, 0.0))
        service.turns(3)
        device.close()
        assert (0.0, 0.0, 1.0) in service.forces["049D"]
        assert len(service.greetings) == (version == "3.5")
    assert read_inventory(service._frame(full=True)).key == service.key


def test_each_hand_gets_a_device_of_its_own(service, clock):
    first, second, third = (Inverse3Device(service.address, clock=clock) for _ in range(3))
    first.open()
    second.open()
    first.write((1.0, 0.0, 0.0))
    second.write((2.0, 0.0, 0.0))
    service.turns(8)
    assert service.forces["049D"][-1] == (1.0, 0.0, 0.0) and service.forces["04BA"][-1] == (2.0, 0.0, 0.0)
    with pytest.raises(InputError, match="no free Inverse3"):
        third.open()
    named = Inverse3Device(service.address, "04BA", clock=clock)
    with pytest.raises(InputError, match="each hand must have its own"):
        named.open()
    second.close()
    named.open()
    for one in (first, named):
        one.close()


@pytest.mark.parametrize("age", [0.0, HOLD, 0.04, 0.06, 0.0999, GONE, 1e9])
def test_the_force_of_a_servo_that_died_falls_to_zero(device, service, clock, age):
    device.write((0.0, 0.0, -3.0))
    service.turns(3)
    clock.now = age
    service.turns(3)
    expected = 3.0 * min(1.0, max(0.0, (GONE - age) / (GONE - HOLD)))
    assert service.forces["049D"][-1][1] == pytest.approx(expected, rel=1e-9, abs=1e-15)
    assert max(math.hypot(*force) for force in service.forces["049D"]) <= 3.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_force_that_is_no_number_is_none(device, service, bad):
    device.write((1.0, bad, 0.0))
    service.turns(3)
    assert service.forces["049D"][-1] == ZERO


def test_a_silent_service_is_not_fresh_then_lost(device, service):
    service.grips["61548"]["a"] = True
    service.turns(3)
    service.mute = True
    drain(device, service)
    assert device.read(0.0).buttons == 1
    sample = device.read(1.1 * SILENCE)
    assert not sample.fresh and sample.buttons == 0
    service.mute = False
    service.turns(3)
    assert device.read(0.2).fresh
    service.mute = True
    drain(device, service)
    with pytest.raises(DeviceLost, match="silent"):
        device.read(0.2 + 1.1 * LOST)


def test_a_service_that_hangs_up_is_lost_and_found_again(device, service):
    service.turns()
    link = device._link
    service.hang_up()
    ended(link)
    for call in (lambda: device.read(0.0), lambda: device.write(ZERO)):
        with pytest.raises(DeviceLost, match="connection to the Inverse Service ended"):
            call()
    device.open()
    service.turns(3)
    assert device.read(0.0).fresh


def test_a_device_that_is_not_listed_any_more_is_lost(device, service):
    service.turns()
    kept, link = service.devices.pop("049D"), device._link
    ended(link)
    with pytest.raises(DeviceLost, match="does not list it"):
        device.read(0.0)
    with pytest.raises(InputError, match=r"no Inverse3 '049D'.*it has 04BA"):
        device.open()
    service.devices["049D"] = kept
    device.open()
    service.turns(3)
    assert device.read(0.0).fresh


def test_the_one_that_comes_back_is_the_same(service, clock):
    device = Inverse3Device(service.address, clock=clock)
    device.open()
    kept, link = service.devices.pop("049D"), device._link
    ended(link)
    with pytest.raises(InputError, match="no Inverse3 '049D'"):  # not the other one, which is free
        device.open()
    service.devices["049D"] = kept
    device.open()
    assert device._link._device == "049D"
    device.close()


def test_a_device_that_is_not_ready_is_not_fresh_and_cannot_be_opened(device, service):
    service.devices["049D"]["status"]["ready"] = False
    service.turns(3)
    while device.read(0.0).fresh:
        pass
    service.turns(3)
    assert not device.read(0.0).fresh
    with pytest.raises(InputError, match="must be ready"):
        device.open()


def test_after_close_the_force_is_zero(device, service):
    device.write((1.0, 1.0, 1.0))
    service.turns(3)
    assert service.forces["049D"][-1] != ZERO
    device.close()
    device.close()
    service.wait_for(lambda: service.forces["049D"][-1] == ZERO)
    for call in (lambda: device.read(0.0), lambda: device.write(ZERO)):
        with pytest.raises(DeviceLost, match="not open"):
            call()


def test_junk_is_ignored_and_counted(device, service):
    """The servo reads the last good state, and nothing is raised."""
    service.turns(3)
    good, turn = device.read(0.0).position, iter(range(10**9))
    # the first as text: a text frame that is not UTF-8 may not be sent by a server that keeps to the rules
    service.says = lambda: JUNK[next(turn) % len(JUNK)]
    service.turns(3 * len(JUNK))
    assert device.ignored >= 2 * len(JUNK)
    while device.read(0.0).fresh:
        pass
    assert device.read(0.0).position == good
    service.says = None
    service.turns(3)
    assert device.read(0.0).fresh


def test_a_service_that_does_not_stop_talking_does_not_keep_forces_from_being_sent():
    class Endless:
        said = 0

        def recv(self, **_: object) -> bytes:
            self.said += 1
            return b"{}"

    link = ServiceLink(Endless(), Exchange("x"), "049D", None, "vector")
    link._hear()
    assert link._socket.said == MOST_ANSWERS


def test_a_hand_of_the_servo_disarms_and_comes_back(service, clock):
    """The service is gone in mid-run and back, with the servo's own code and a virtual clock."""
    device = Inverse3Device(service.address, "049D", clock=clock)
    with ServedHand(device) as hand:
        service.turns(3)
        hand.arm()
        service.turns(3)
        assert service.forces["049D"][-1] != ZERO
        link = device._link
        service.hang_up()
        ended(link)
        hand.run(2)
        assert hand.status.losses == 1
        hand.come_back()
        service.turns(3)
        assert service.forces["049D"][-1] == ZERO  # disarmed


def test_the_servo_process_serves_two_hands(service):
    """The whole way, in the servo's own process."""
    hands = [HandSetup(f"haply:{service.address}/{device}", SpringChain) for device in service.devices]
    with ServoProcess(hands, spheres=1, traps=1) as servo:
        publish = publishing(servo)
        for forces in service.forces.values():
            until(lambda forces=forces: forces and forces[-1] != ZERO, publish)
        assert all(hand.present for hand in servo.status().hands)
    for forces in service.forces.values():
        service.wait_for(lambda forces=forces: forces[-1] == ZERO)


@pytest.mark.parametrize(
    ("text", "address", "device", "grip"),
    [
        ("haply", SERVICE, None, None),
        ("inverse3:049D", SERVICE, "049D", None),
        ("haply:049D,grip=61548", SERVICE, "049D", "61548"),
        ("haply:ws://lab:10001", "ws://lab:10001", None, None),
        ("haply:ws://lab:10001/049D", "ws://lab:10001", "049D", None),
        ("inverse3:wss://lab:7/049D,grip=6", "wss://lab:7", "049D", "6"),
    ],
)
def test_specs_say_where_and_which(text, address, device, grip):
    (spec,) = parse_devices([text])
    made = create_device(spec)
    assert isinstance(made, Inverse3Device) and spec.kind == "inverse3"
    assert (made._service, made._device, made._grip) == (address, device, grip)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("haply:http://lab:10001", "must be ws://host:port"),
        ("haply:ws://:10001", "must be ws://host:port"),
        ("haply:ws://lab:99999", "address"),
        ("haply:ws://lab:0", "must be ws://host:port"),
        ("haply:ws://lab:10001/a/b", "must be 1 to 64"),
        ("haply:ws://lab:10001?x=1", "must be ws://host:port"),
        ("inverse3:04 9D", "must be 1 to 64"),
        ("inverse3:049D,grip=", "must be 1 to 64"),
        ("inverse3:049D,hand=left", "must be one of grip"),
    ],
)
def test_bad_specs_are_one_clear_line(text, says):
    (spec,) = parse_devices([text])
    with pytest.raises(InputError, match=says) as error:
        create_device(spec)
    assert "\n" not in str(error.value) and text in str(error.value)


def test_haply_and_inverse3_are_the_same():
    with pytest.raises(InputError, match="both hands name it"):
        parse_devices(["haply:049D", "inverse3:049D"])
    first, second = parse_devices(["haply", "inverse3"])
    assert (first.ordinal, second.ordinal) == (0, 1)
    with pytest.raises(InputError, match="haply, inverse3"):
        parse_devices(["happily"])


def test_no_service_is_one_clear_line(clock):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"ws://127.0.0.1:{free.getsockname()[1]}"
    for call in (Inverse3Device(address, clock=clock).open, lambda: find_devices(address)):
        with pytest.raises(InputError, match=r"no Haply Inverse Service at .* start it") as error:
            call()
        assert "\n" not in str(error.value)
    (typed,) = parse_devices([f"haply:{address}"])
    with pytest.raises(InputError, match=rf"^device 'haply:{address}': .*; start it there, or correct the address$"):
        create_device(typed).open()


@pytest.mark.parametrize(("typed", "kind"), [("haply", "haply"), ("inverse3:049D", "inverse3")])
def test_the_advice_names_the_kind_as_it_was_typed(typed, kind):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"ws://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(InputError, match=rf"start it, or name {kind}:ws://host:port$"):
        inverse3.connect(address, typed)


@pytest.mark.parametrize("hello", ["", "{}}", '{"inverse3": 1}', "[" * 100_000])
def test_another_server_is_one_clear_line(service, clock, hello):
    service.hello = hello
    with pytest.raises(InputError, match="is no Haply Inverse Service") as error:
        Inverse3Device(service.address, clock=clock).open()
    assert "\n" not in str(error.value)


def test_a_handle_that_is_not_there_is_one_clear_line(service, clock):
    with pytest.raises(InputError, match=r"no handle '7' .* it has 61548, 61549"):
        Inverse3Device(service.address, "049D", "7", clock=clock).open()


def test_without_the_package_it_says_what_to_install(monkeypatch, clock):
    true_import = builtins.__import__

    def no_websockets(name, *rest):
        if name.startswith("websockets"):
            raise ImportError(name)
        return true_import(name, *rest)

    monkeypatch.setattr(builtins, "__import__", no_websockets)
    for call in (Inverse3Device(clock=clock).open, find_devices):
        with pytest.raises(InputError, match=r"websockets: pip install 'otwarp\[haptics\]'"):
            call()


def test_devices_are_found(service):
    assert find_devices(service.address) == (
        f"inverse3:{service.address}/049D  Haply Inverse3, handle 61548",
        f"inverse3:{service.address}/04BA  Haply Inverse3, handle 61549",
    )
    service.devices.clear()
    assert find_devices(service.address) == ()
