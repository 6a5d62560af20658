"""Cells that leave come in again, in every driver: how often, told how, and what scenes may not say."""

from __future__ import annotations

import dataclasses

import netCDF4
import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.record import record_run
from otwarp.scene import Vec3
from otwarp.simulation.options import StepOptions
from otwarp.simulation.simulation import Simulation
from tests.simulation.streams import COUNT, DRIVERS, SETTINGS, SPEED, STEP, row, simulate, stream
from tests.simulation.test_checkpoint import authored


@pytest.fixture(params=list(DRIVERS))
def driver(request, monkeypatch) -> str:
    if request.param in ("soft", "stiff"):
        monkeypatch.setattr("otwarp.simulation.composition.MAX_WORLD_BODIES", 0)
    return request.param


def test_cells_come_in_and_robots_go_on(driver, device):
    """Everybody stays in the domain but the robot, and cells come by as often as the flow takes them around."""
    sim = simulate(stream(driver), device, worlds=3)
    assert sim.model.features.driver == {"solo": "solo", "world": "world"}.get(driver, "grid")
    assert sim.model.features.soft_contacts == (driver == "soft")
    for _ in range(10):
        sim.step(100)
        x = sim.state.position.numpy()[..., 0]
        assert np.all(np.abs(x[:, :COUNT]) <= 10.0 + SPEED * STEP)
    entries = sim.readout.entries.numpy()
    assert np.all(entries[:, COUNT] == 0) and x[:, COUNT] == pytest.approx(SPEED * sim.time, rel=1e-3)
    # 100 µm in all; a turn is from a place in the inlet to the outlet: 16 to 19 µm
    assert np.all((entries[:, :COUNT] >= 4) & (entries[:, :COUNT] <= 7))
    assert len(np.unique(entries.sum(axis=1))) > 1 or len({tuple(r) for r in x}) == 3, "worlds differ"


def test_the_same_whatever_the_calls_and_the_worlds_beside(driver, device):
    whole, parts = simulate(stream(driver), device, worlds=3), simulate(stream(driver), device, worlds=2)
    whole.step(700)
    for steps in (1, 299, 400):
        parts.step(steps)
    assert np.array_equal(whole.state.position.numpy()[:2], parts.state.position.numpy())
    assert np.array_equal(whole.readout.entries.numpy()[:2], parts.readout.entries.numpy())
    assert whole.readout.entries.numpy().sum() > 20


def test_crossings_of_a_period_count_from_the_entry(device):
    """Across y space repeats: who comes in anew is at home."""
    settings = dataclasses.replace(SETTINGS, period=(0.0, 20.0, 0.0))
    sim = simulate(stream("world", settings=settings), device, worlds=2)
    sim.set_state(position=row(10.5) + np.array((0.0, 45.0, 0.0)))
    sim.step(1)
    assert np.all(sim.readout.entries.numpy()[:, :COUNT] == 1)
    assert not sim.state.image.numpy()[:, :COUNT].any() and sim.state.image.numpy()[:, COUNT].any()
    assert np.all(np.abs(sim.unwrapped_position()[:, :COUNT, 1]) <= 4.0)


def test_a_reset_world_counts_anew(device):
    sim = simulate(stream("solo"), device, worlds=2, ends=())
    sim.step(400)
    before = sim.readout.entries.numpy().copy()
    sim.reset([1])
    after = sim.readout.entries.numpy()
    assert before.min(axis=0)[0] > 0 and np.array_equal(after[0], before[0]) and not after[1].any()


def test_files_tell_who_came_in(device, tmp_path):
    """The recording per frame, the summary in all; and a checkpoint goes on with the same places."""
    settings = dataclasses.replace(SETTINGS, duration=0.6, frames_per_second=10.0)
    scene = authored(stream("world", settings=settings), tmp_path / "scene.usda")
    assert scene.settings.domain_high == (10.0, 0.0, 0.0) and scene.settings.inlet_high == (-6.0, 4.0, 3.0)
    options = {"worlds": 2, "seed": 5, "device": device, "options": StepOptions(allow_large_step=True)}
    summary = record_run(scene, tmp_path / "run", **options)
    whole = simulate(scene, device, worlds=2)
    whole.step(600)
    with netCDF4.Dataset(tmp_path / "run" / "run.nc") as data:
        entries = data["entries"][:]
    assert np.array_equal(entries[-1], whole.readout.entries.numpy()) and np.all(np.diff(entries, axis=0) >= 0)
    assert summary["entries"] == entries[-1].sum() > 20
    assert f"{summary['entries']} times a cell left the domain and came in again" in summary["text"]
    parts = simulate(scene, device, worlds=2)
    parts.step(250)
    again = Simulation.restore(parts.save(tmp_path / "half.npz"), device=device)
    again.step(350)
    assert np.array_equal(again.state.position.numpy(), whole.state.position.numpy())
    assert np.array_equal(again.readout.entries.numpy(), entries[-1])


BAD: dict[str, tuple[dict[str, Vec3], str]] = {
    "inside out": ({"domain_low": (1.0, 0.0, 0.0), "domain_high": (0.0, 0.0, 0.0)},
                   r"ot:scene:domainHigh = \(0, 0, 0\): must be at least 1e-06 m, ot:scene:domainLow, along x"),
    "inlet inside out": ({"inlet_high": (-6.0, -5.0, 3.0)}, "ot:scene:inletHigh = .*: must be at least -4e-06 m"),
    "inlet outside": ({"inlet_low": (-11.0, -4.0, -3.0)},
                      r"ot:scene:inletLow = .*: must be in the domain, \[-1e-05, 1e-05\] m along x"),
    "inlet beyond": ({"inlet_high": (11.0, 4.0, 3.0)}, r"ot:scene:inletHigh = .*: must be in the domain"),
    "no domain": ({"domain_low": (0.0, 0.0, 0.0), "domain_high": (0.0, 0.0, 0.0)},
                  "ot:scene:inletHigh = .*: must be 0 m without ot:scene:domainLow and domainHigh"),
    "periodic": ({"period": (20.0, 0.0, 0.0)}, "ot:scene:domainHigh = .*: no end, as space repeats, along x|must be"),
    "out of the cell": ({"period": (0.0, 0.0, 5.0)}, "ot:scene:inletHigh = .*: must be in the cell that repeats"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_refused(case, device):
    changed, message = BAD[case]
    scene = stream("solo", settings=dataclasses.replace(SETTINGS, **changed))
    with pytest.raises(InputError, match=message) as error:
        simulate(scene, device)
    assert "\n" not in str(error.value)


def test_a_domain_without_cells_is_refused(device):
    scene = stream("solo")
    alone = dataclasses.replace(scene, bodies=scene.bodies[-1:])
    with pytest.raises(InputError, match=r"ot:scene:domainHigh = .*: must be as ot:scene:domainLow in a"):
        simulate(alone, device)
