"""Launches that are packed once: the same as fresh ones whatever changes, and none is packed again in a loop."""

from __future__ import annotations

import numpy as np
import warp as wp

import otwarp as ot
from otwarp.kernels.drivers.episodes import flag_worlds
from otwarp.simulation.drivers.launches import RecordedLaunch
from tests.simulation.test_episodes import lossy_scene, simulate


def test_what_changes_is_seen(device):
    """Sizes and arrays of later calls count, in any order."""
    rows = [wp.array(np.arange(8) % n == 0, dtype=wp.bool, device=device) for n in (2, 3)]
    record = RecordedLaunch(flag_worlds, wp.get_device(device), [])
    for dim, n in ((8, 0), (5, 1), (5, 1), (8, 1), (0, 0), (3, 0)):
        flags = wp.full(8, -1, dtype=wp.int32, device=device)
        record(dim, rows[n], flags)
        expected = np.where(np.arange(8) < dim, rows[n].numpy(), -1)
        assert flags.numpy().tolist() == expected.tolist()


def test_a_loop_packs_no_launch_again(device, monkeypatch):
    """Of steps, ends and resets, on one thread and on two."""
    for threads in (1, 2):
        sim = simulate(lossy_scene(), device, ends=[ot.escaped], threads=threads)

        def turn(sim=sim) -> None:
            sim.step(20)
            sim.reset(sim.episodes.done)

        turn()
        with monkeypatch.context() as patch:
            patch.setattr(wp, "launch", lambda kernel, *_a, **_k: (_ for _ in ()).throw(AssertionError(kernel.key)))
            for _ in range(3):
                turn()
        assert sim.state.step == 80
