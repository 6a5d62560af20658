"""A simulation on several devices: each steps a part of the worlds, and all of them together are one device's bits."""

from __future__ import annotations

import dataclasses
import itertools
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.simulation.frame import SHAPES, Frame, capture_frame
from otwarp.simulation.packing.arguments import whole
from otwarp.simulation.packing.arrays import device_view
from otwarp.simulation.packing.parameters import expand
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.starts import host_flags


class Gathered:
    """A `State`, `Readout` or `Episodes` of all shards: its arrays of worlds are gathered on the host when read."""

    def __init__(self, parts: Callable[[], list[Any]]):
        self._parts = parts

    def __getattr__(self, name: str) -> Any:
        values = [getattr(part, name) for part in self._parts()]
        if all(isinstance(v, wp.array) for v in values):
            return np.concatenate([v.numpy() for v in values])
        return np.concatenate(values) if all(isinstance(v, np.ndarray) for v in values) else values[0]


class ShardedSimulation:
    """A scene in motion on several devices, which share out its worlds in order.

    World w has the seed, noise and parameters of world w of a `Simulation` of all worlds on one device, so results are
    the same bit for bit, whatever the devices. `state`, `readout` and `episodes` read as NumPy arrays over all worlds;
    `shards` are the simulations on the devices, for whoever works there.

    Args:
        scene: What to simulate.
        devices: Names of the devices, one part of the worlds each; the same may stand there twice.
        worlds: Independent copies in all, at least one per device.
        options: As for `Simulation`; parameters are those of all worlds.

    Raises:
        InputError: An argument out of range.

    Example:
        >>> import otwarp as ot
        >>> scene = ot.Scene.load("scenes/single_bead.usda")
        >>> sim = ot.ShardedSimulation(scene, devices=["cpu", "cpu"], worlds=6, seed=7)
        >>> sim.run(0.01)
        >>> sim.state.position.shape
        (6, 1, 3)
    """

    def __init__(self, scene: Scene, *, devices: Sequence[str | wp.Device], worlds: int, **options: Any):
        if isinstance(devices, str) or not isinstance(devices, Sequence) or not len(devices):
            raise InputError(f"devices is {devices!r}; allowed: a list of one or more, such as ['cuda:0', 'cuda:1']")
        self.worlds = whole("worlds", worlds, len(devices))
        edges = [self.worlds * n // len(devices) for n in range(len(devices) + 1)]
        self.parts = [slice(*pair) for pair in itertools.pairwise(edges)]
        self.shards = [
            Simulation(scene, worlds=self.worlds, device=device, part=(part.start, part.stop), **options)
            for device, part in zip(devices, self.parts, strict=True)
        ]
        self._threads = _threads(self.shards)
        self.state = Gathered(lambda: [s.state for s in self.shards])
        self.episodes = Gathered(lambda: [s.episodes for s in self.shards])
        self.readout = Gathered(lambda: self._each(lambda s, _: s.readout))

    def _each(self, work: Callable[[Simulation, slice], Any]) -> list[Any]:
        """What every shard gives when all of them are done, even if one fails; threads wait for their devices."""
        # Warp makes a device the default one while it copies from there to the host
        with wp.ScopedDevice(wp.get_device()):
            given = [
                thread.submit(work, shard, part)
                for thread, shard, part in zip(self._threads, self.shards, self.parts, strict=True)
            ]
            wait(given)
        return [one.result() for one in given]

    @property
    def time_step(self) -> float:
        """Time step [s]."""
        return self.shards[0].time_step

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.shards[0].time

    @property
    def running(self) -> int:
        """Worlds in motion, as `Episodes.running`."""
        return sum(s.episodes.running for s in self.shards)

    def step(self, steps: int = 1) -> None:
        """Take `steps` time steps on all devices at once; see `Simulation.step`."""
        self._each(lambda s, _: s.step(steps))

    def run(self, duration: float) -> None:
        """Simulate `duration` seconds on all devices at once, to the nearest whole step."""
        self._each(lambda s, _: s.run(duration))

    def command(self, *, trap_position: Any = None, trap_power: Any = None, follow: Any = None) -> None:
        """Command traps of all worlds; arguments as for `Control.set`."""
        asked = {"trap_position": trap_position, "trap_power": trap_power}
        traps = len(self.shards[0].scene.traps)
        rows = {n: expand(n, v, worlds=self.worlds, traps=traps) for n, v in asked.items() if v is not None}
        self._each(
            lambda s, part: s.control.set(
                **{n: v[0] if len(v) == 1 else v[part] for n, v in rows.items()}, follow=follow
            )
        )

    def set_state(self, **poses: Any) -> None:
        """Put the bodies elsewhere; arguments as for `Simulation.set_state`."""
        self._each(lambda s, part: s.set_state(**{n: self._rows(n, v, part) for n, v in poses.items()}))

    def reset(self, worlds: Any = None, *, number: Any = None, **poses: Any) -> None:
        """Start worlds anew; arguments as for `Simulation.reset`, on the host, `worlds` flags (W) or indices.

        What is on the devices is reset there: `shards[n].reset(...)`.

        Raises:
            InputError: As `Simulation.reset`, or an array on a device.
        """
        for name, values in {"worlds": worlds, "number": number, **poses}.items():
            if device_view(values) is not None:
                raise InputError(f"{name} is on a device; allowed: the host, or shards[n].reset(…) there")
        flags = np.ones(self.worlds, dtype=bool) if worlds is None else host_flags(worlds, self.worlds)
        given = {"number": number, **poses}
        self._each(
            lambda s, part: s.reset(
                flags[part], **{n: self._rows(n, v, part) for n, v in given.items() if v is not None}
            )
        )

    def frame(self) -> Frame:
        """The present state and readout of all worlds; see `Frame`."""
        frames = self._each(lambda s, _: capture_frame(s))
        joined = {n: np.concatenate([getattr(f, n) for f in frames]) for n in SHAPES}
        for name in ("unwrapped", "entries"):
            if getattr(frames[0], name) is not None:
                joined[name] = np.concatenate([getattr(f, name) for f in frames])
        return dataclasses.replace(frames[0], **joined)

    def _rows(self, name: str, values: Any, part: slice) -> Any:
        """The rows of a part in what has one per world; the whole of what serves all."""
        array = np.asarray(values)
        return array[part] if array.ndim == (1 if name == "number" else 3) else array


def _threads(shards: Sequence[Simulation]) -> list[ThreadPoolExecutor]:
    """The thread in which each shard works: one a GPU, whose stream Warp changes for all threads while it copies from
    there to the host; one a shard on a CPU.
    """
    threads: defaultdict[Any, ThreadPoolExecutor] = defaultdict(lambda: ThreadPoolExecutor(1))
    places = [shard.model.device for shard in shards]
    return [threads[place.alias if place.is_cuda else n] for n, place in enumerate(places)]
