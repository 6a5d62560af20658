"""Kernels are loaded together before the first step, and whoever waits for the compiler is told."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import warp as wp

import otwarp as ot
from otwarp.scene import Scene
from otwarp.simulation.drivers import stepping
from otwarp.simulation.drivers.compilation import is_compiled, load_kernels
from otwarp.simulation.simulation import Simulation

SCENES = Path(__file__).parents[3] / "scenes"


def tiny_kernels() -> tuple[Any, Any]:
    """Two kernels of a module each."""

    @wp.kernel(enable_backward=False, module="unique")
    def first(values: wp.array(dtype=float)):  # pyright: ignore[reportInvalidTypeForm]
        values[wp.tid()] = 1.25

    @wp.kernel(enable_backward=False, module="unique")
    def second(values: wp.array(dtype=float)):  # pyright: ignore[reportInvalidTypeForm]
        values[wp.tid()] = 2.25

    return first, second


@pytest.mark.thorough
def test_compiling_is_told_once(
    device: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    place, kernels = wp.get_device(device), tiny_kernels()
    assert not any(is_compiled(kernel.module, place) for kernel in kernels)
    with caplog.at_level(logging.INFO, logger="otwarp"):
        load_kernels(kernels, place)
        said = [record.getMessage() for record in caplog.records]
        load_kernels(kernels, place)
    assert said[0].startswith(f"compiling 2 of 2 kernel modules for {place.alias}") and str(tmp_path) in said[0]
    assert said[1:] == ["compiled 1 of 2", "compiled 2 of 2"]
    assert len(caplog.records) == len(said)
    assert all(is_compiled(kernel.module, place) for kernel in kernels)
    if place.is_cpu:  # two threads compiled
        assert len(list(tmp_path.glob("headers_*/*"))) == 1


@pytest.mark.parametrize("asked", [False, True])
def test_the_kernels_of_a_readout_that_will_be_used_load_beside_the_step(
    device: str, monkeypatch: pytest.MonkeyPatch, asked: bool
) -> None:
    loads: list[int] = []

    def noted(kernels: Sequence[Any], place: wp.Device) -> None:
        loads.append(len(kernels))
        load_kernels(kernels, place)

    monkeypatch.setattr(stepping, "load_kernels", noted)
    sim = Simulation(Scene.load(SCENES / "single_bead.usda"), device=device, readout=asked)
    assert loads == [3 if asked else 1]
    assert sim.readout.trap_force.numpy().shape == (1, 1, 3)


def test_a_module_that_threads_ask_for_at_once_is_loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else one of them runs machine code that the other's loading drops: it crashed in one of thirty starts."""
    place, (kernel, _) = wp.get_device("cpu"), tiny_kernels()
    load, inside = wp.Module.load, []

    def slow(module: wp.Module, *how: Any) -> Any:
        """Load it, or say that it is there, while another thread comes."""
        inside.append(module)
        alone = len(inside) == 1
        time.sleep(0.05)
        inside.remove(module)
        assert alone
        return load(module, *how)

    monkeypatch.setattr(wp.Module, "load", slow)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda _: load_kernels([kernel], place), range(2)))


@pytest.mark.thorough
def test_kernels_of_episodes_load_beside_the_step() -> None:
    """None is loaded by a launch, which threads may make at once."""
    sim = Simulation(Scene.load(SCENES / "single_bead.usda"), device="cpu", ends=[ot.timed_out(after=0.125)])
    assert all(launch.kernel.module.execs for launch in sim.episodes.launches.values())
