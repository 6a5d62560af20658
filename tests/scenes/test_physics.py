"""What the shipped scenes must show when they run: the cell arrives, the pair lies down, speed loses the cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.record.monitor import Monitor
from otwarp.scene import Scene
from otwarp.simulation.frame import capture_frame
from otwarp.simulation.packing.traps import rotate
from otwarp.simulation.simulation import Simulation
from scenes.author import strategy_a

SCENES = Path(__file__).parents[2] / "scenes"
UNIT = 25.0
"""µm per unit of the paper's figures (docs/decisions.md)."""


def watch(scene: Scene, device: str, frames_per_second: float = 60.0) -> Monitor:
    """Run a scene to its end under the monitor that `otwarp run` uses."""
    sim = Simulation(scene, seed=0, device=device)
    monitor = Monitor(scene, sim.model.held, 1)
    for frame in range(round(scene.settings.duration * frames_per_second) + 1):
        sim.step(round(frame / frames_per_second / sim.time_step) - sim.state.step)
        monitor.update(capture_frame(sim))
    return monitor


@pytest.fixture(scope="module")
def delivery() -> Scene:
    return Scene.load(SCENES / "cell_delivery.usda")


def test_the_pair_delivers_the_cell(delivery, device):
    """The paper's order of magnitude: distance .02 ± .026 units, contact force 2.57 ± 3.18 pN, warning line 10 pN."""
    monitor = watch(delivery, device)
    end = monitor.outcome(0)
    assert end.outcome == "delivered"
    assert 9.0 < end.time < delivery.settings.duration
    assert "goal" in end.reason
    distance, force = monitor.distance.pooled(), monitor.force.pooled()
    assert 0.005 < distance["mean"] / UNIT < 0.05
    assert 1.0 < force["mean"] < 5.0
    assert force["fraction_above"] < 0.05 and monitor.load.pooled()["fraction_above"] < 0.05


def test_three_times_faster_loses_the_cell(delivery, device):
    end = watch(delivery.with_trap_speed(3.0), device).outcome(0)
    assert end.outcome in ("cell lost", "robot lost")
    assert end.time < delivery.settings.duration / 3.0
    assert "µm" in end.reason


def tilts(name: str, ends: tuple[str, str], device: str, worlds: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """(samples,) trap spacing [µm] and mean |tilt| [rad] of the line between two spheres of a scene's robot."""
    scene = Scene.load(SCENES / f"{name}.usda")
    spheres = {s.prim.rsplit("/", 1)[-1]: np.array(s.offset) for s in scene.bodies[0].spheres}
    line = spheres[ends[1]] - spheres[ends[0]]
    sim = Simulation(scene, worlds=worlds, seed=1, device=device)
    spacing, tilt = [], []
    for _ in range(samples):
        sim.run(scene.settings.duration / samples)
        across = rotate(sim.prim_poses()[1][:, 0], line)
        tilt.append(np.abs(np.arcsin(across[:, 2] / np.linalg.norm(line))).mean())
        foci = sim.readout.trap_position.numpy()[0].astype(float)
        spacing.append(np.linalg.norm(foci[1] - foci[0]))
    return np.array(spacing), np.array(tilt)


def test_strategy_a_follows_the_pitchfork(device):
    """cos θ = d/((1 − η)L), and flat beyond d = (1 − η)L, after the moving traps.

    The pair lags by the speed over its relaxation rate: below 1.5° up to 0.9 of the pitchfork and in the flat branch,
    where thermal noise leaves ⟨|θ|⟩ below 1°. The mean over 16 worlds has a standard error below 0.1°.
    """
    spacing, tilt = tilts("strategy_a", ("left", "right"), device, worlds=16, samples=24)
    law = np.array([strategy_a.tilt(d) for d in spacing])
    fork = (1.0 - strategy_a.ETA) * strategy_a.LENGTH
    clear = (spacing < 0.9 * fork) | (spacing > 1.05 * fork)
    assert np.sum(spacing < 0.9 * fork) > 5 and np.sum(spacing > 1.05 * fork) > 3
    assert np.degrees(np.abs(tilt - law)[clear]).max() < 1.5


def test_strategy_b_tilts_as_the_traps_close(device):
    """Flat while the traps hold the handles apart, then more and more; standard error of ⟨|θ|⟩ over 32 worlds ≈ 2°."""
    spacing, tilt = tilts("strategy_b", ("handle_left", "handle_right"), device, worlds=32, samples=12)
    assert np.all(np.diff(spacing) < 0.0)
    degrees = np.degrees(tilt)
    assert degrees[spacing > 8.4].max() < 2.0
    assert degrees[-1] > 12.0
    assert degrees[-1] > degrees[-3] > degrees[-5]
