"""A device that takes datagrams: opened by name, and stepped with a chain."""

import socket

import pytest

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.core import SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import HandConfig
from otwarp.haptics.devices import create_device, parse_devices, probe_devices
from otwarp.haptics.force import local_model
from otwarp.haptics.force.law import IsotropicLaw
from otwarp.laws import TrapLaw


def test_udp():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        port = peer.getsockname()[1]
    specs = parse_devices([f"udp:{port}"])
    probe_devices(specs)
    device, config = create_device(specs[0]), HandConfig(traps=(0,))
    chain = Chain(config, local_model(config, {0: (IsotropicLaw(TrapLaw(stiffness=0.5, power=1.0)),)}))
    device.open()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        for n in range(300):
            word = "0 0 0 1" if n < 100 else "0.01 0 0 1"
            peer.sendto(word.encode(), ("127.0.0.1", port))
            scene = SceneFrame(n, 1e-3 * n, (SphereFrame((0.0, 0.0, 0.0), 0),), (TrapFrame(0, (0.0, 0.0, 0.0), 20.0),))
            frame = chain.step(device.read(1e-3 * n), scene)
    assert frame.position == (0.01, 0.0, 0.0) and frame.buttons == 1
    moved = sum(part**2 for part in chain.moved) ** 0.5
    assert moved == pytest.approx(0.01 * config.motion_gain, rel=1e-3)  # 1 µm
    device.close()
    with pytest.raises(InputError, match="a port from 1024"):
        create_device(parse_devices(["udp:http"])[0])
