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
from otwarp.scene.keywords import known_keywords
from otwarp.simulation.frame import Frame, capture_frame
from otwarp.simulation.packing.arguments import whole
from otwarp.simulation.packing.arrays import device_view
from otwarp.simulation.packing.parameters import expand
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.starts import host_flags

Each = Callable[..., list[Any]]
"""(work, items) → what `work(shard, item)` gives for every shard; items are its worlds, a slice, if none are given."""

OWN = (
    "model",
    "writes",
    "layout",
    "fault_count",
    "living",
    "count",
    "values",
    "at_most",
    "origin",
    "views",
    "launches",
    "trap_velocity",
    "trap_since",
)
"""Fields of `State`, `Control`, `Readout` and `Episodes` that a shard has for itself."""


class Gathered:
    """A `State`, `Control`, `Readout` or `Episodes` of all shards, to be read on the host.

    Arrays have a row for every world, `running` counts all of them; times, ends and `follow` are the same everywhere.

    Raises:
        InputError: What is asked for is each shard's own.
    """

    def __init__(self, group: str, each: Each):
        self._group, self._each = group, each

    def __getattr__(self, name: str) -> Any:
        if name in OWN:
            raise InputError(f"{self._group}.{name} is each shard's own; allowed: shards[n].{self._group}.{name}")
        values = [getattr(group, name) for group in self._each(lambda s, _: getattr(s, self._group))]
        if name == "running":
            return sum(values)
        rows = [v.numpy() if isinstance(v, wp.array) else v for v in values]
        if not isinstance(rows[0], np.ndarray) or name == "follow":
            return rows[0]
        worlds = self._each(lambda s, _: s.model.worlds)
        # one row may serve all worlds of a shard
        return np.concatenate([np.broadcast_to(r, (n, *r.shape[1:])) for r, n in zip(rows, worlds, strict=True)])


class GatheredControl(Gathered):
    """A `Control` of all shards: read like the others, written by `set`."""

    @known_keywords
    def set(self, *, trap_position: Any = None, trap_power: Any = None, follow: Any = None) -> None:
        """Command traps of all worlds; arguments as for `Control.set`, and nothing is written unless all shards accept.

        Raises:
            InputError: As `Control.set`.
        """
        asked = {"trap_position": trap_position, "trap_power": trap_power}
        given = {name: value for name, value in asked.items() if value is not None}

        def accept(sim: Simulation, part: slice) -> tuple[dict[str, np.ndarray], np.ndarray]:
            worlds, traps = sim.model.all_worlds, len(sim.scene.traps)
            rows = {name: expand(name, value, worlds=worlds, traps=traps) for name, value in given.items()}
            return sim.control.accept(**{n: v if len(v) == 1 else v[part] for n, v in rows.items()}, follow=follow)

        self._each(lambda s, accepted: s.control.write(*accepted), self._each(accept))


class ShardedSimulation:
    """A scene in motion on several devices, which share out its worlds in order.

    World w has the seed, noise and parameters of world w of a `Simulation` of all worlds on one device, so results are
    the same bit for bit, whatever the devices. `state`, `control`, `readout` and `episodes` read as NumPy arrays over
    all worlds; `shards` are the simulations on the devices, for whoever works there. It is a context, whose end, like
    `close`, ends its threads: it steps no more.

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
        if own := sorted({"part", "device"} & set(options)):
            raise InputError(
                f"{own[0]} is {options[own[0]]!r}; allowed: none, each of the devices has a part of its own"
            )
        self.worlds = whole("worlds", worlds, len(devices))
        edges = [self.worlds * n // len(devices) for n in range(len(devices) + 1)]
        self.parts = [slice(*pair) for pair in itertools.pairwise(edges)]
        self.shards = [
            Simulation(scene, worlds=self.worlds, device=device, part=(part.start, part.stop), **options)
            for device, part in zip(devices, self.parts, strict=True)
        ]
        self._threads = _threads(self.shards)
        self.state, self.readout, self.episodes = (Gathered(g, self._each) for g in ("state", "readout", "episodes"))
        self.control = GatheredControl("control", self._each)

    def __enter__(self) -> ShardedSimulation:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the threads in which the shards work, when they have done what they do."""
        for thread in self._threads:
            thread.shutdown()

    def _each(self, work: Callable[[Simulation, Any], Any], items: Sequence[Any] | None = None) -> list[Any]:
        """What every shard gives when all of them are done, even if one fails; threads wait for their devices."""
        # Warp makes a device the default one while it copies from there to the host
        with wp.ScopedDevice(wp.get_device()):
            given = [
                thread.submit(work, shard, item)
                for thread, shard, item in zip(self._threads, self.shards, items or self.parts, strict=True)
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

    def step(self, steps: int = 1) -> None:
        """Take `steps` time steps (a whole number ≥ 0) on all devices at once.

        Raises:
            InputError, SimulationError: As `Simulation.step`, from the first device that has one.
        """
        self._each(lambda s, _: s.step(steps))

    def run(self, duration: float) -> None:
        """Simulate `duration` seconds (≥ 0) on all devices at once, to the nearest whole step.

        Raises:
            InputError, SimulationError: As `step`.
        """
        self._each(lambda s, _: s.run(duration))

    def set_state(self, **poses: Any) -> None:
        """Put the bodies elsewhere.

        Args:
            poses: `position`, (B, 3) for all worlds or (W, B, 3) [µm], and `orientation`, (B, 4) or (W, B, 4), where W
                counts the worlds of all devices; what is not given stays.

        Raises:
            InputError: As `Simulation.set_state`.
        """
        given = {name: values for name, values in poses.items() if values is not None}
        self._each(lambda s, part: s.set_state(**{n: self._rows(n, v, part) for n, v in given.items()}))

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
        arrays = [n for n, v in vars(frames[0]).items() if isinstance(v, np.ndarray)]
        return dataclasses.replace(frames[0], **{n: np.concatenate([getattr(f, n) for f in frames]) for n in arrays})

    def _rows(self, name: str, values: Any, part: slice) -> Any:
        """The rows of a part in what has one per world; the whole of what serves all.

        Raises:
            InputError: Another number of rows than worlds.
        """
        array = np.asarray(values)
        if array.ndim != (1 if name == "number" else 3):
            return array
        if len(array) != self.worlds:
            raise InputError(f"{name} has {len(array)} rows; allowed: {self.worlds}, one for each world")
        return array[part]


def _threads(shards: Sequence[Simulation]) -> list[ThreadPoolExecutor]:
    """The thread in which each shard works: one a GPU, whose stream Warp changes for all threads while it copies from
    there to the host; one a shard on a CPU.
    """
    threads: defaultdict[Any, ThreadPoolExecutor] = defaultdict(lambda: ThreadPoolExecutor(1))
    places = [shard.model.device for shard in shards]
    return [threads[place.alias if place.is_cuda else n] for n, place in enumerate(places)]
