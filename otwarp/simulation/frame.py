"""`Frame`: one moment of a simulation, on the host; what is recorded, shown and felt of it is made from this."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from otwarp.scene import Scene
from otwarp.scene.transforms import rotate

if TYPE_CHECKING:  # frames are also read where nothing is simulated, as in the page's process
    from otwarp.simulation.simulation import Simulation

SHAPES: dict[str, tuple[str, int]] = {
    "position": ("body", 3),
    "orientation": ("body", 4),
    "trap_position": ("trap", 3),
    "trap_power": ("trap", 0),
    "trap_force": ("trap", 3),
    "trap_distance": ("trap", 0),
    "escape_time": ("trap", 0),
    "contact_force": ("body", 3),
    "contact_load": ("body", 0),
}
"""Field → what its second axis counts, and the length of its last axis (0: none)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """One moment of W worlds with B bodies and T traps. Obstacle poses are functions of time.

    Attributes:
        step: Steps taken since the start.
        time: Simulated time [s].
        position: (W, B, 3) origins of the bodies' prims [µm].
        orientation: (W, B, 4) quaternions (x, y, z, w) of the bodies' prims.
        trap_position: (W, T, 3) foci [µm].
        trap_power: (W, T) [mW].
        trap_force: (W, T, 3) force of each trap on the bodies [pN].
        trap_distance: (W, T) between a trap and the sphere it holds, nan if it holds none [µm].
        escape_time: (W, T) when the held sphere was first out of its trap's reach, nan if it never was [s].
        contact_force: (W, B, 3) net contact force [pN].
        contact_load: (W, B) sum of the magnitudes of the normal forces [pN].
        unwrapped: (W, B, 3) positions where space repeats, as if it did not [µm]; else None.
        entries: (W, B) how often each cell has come in again at the inlet, None without one: where it has gone up
            between two frames, the cell has not moved from place to place but left and come in.
    """

    step: int
    time: float
    position: np.ndarray
    orientation: np.ndarray
    trap_position: np.ndarray
    trap_power: np.ndarray
    trap_force: np.ndarray
    trap_distance: np.ndarray
    escape_time: np.ndarray
    contact_force: np.ndarray
    contact_load: np.ndarray
    unwrapped: np.ndarray | None = None
    entries: np.ndarray | None = None

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return self.position.shape[0]

    def copy(self) -> Frame:
        """The frame in arrays of its own: on the CPU those of a readout are the simulation's, which goes on."""
        return dataclasses.replace(self, **{name: np.array(getattr(self, name)) for name in SHAPES})

    def spheres(self, body: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """(W, n, 3) where points that are fixed to bodies are in the world [µm].

        Args:
            body: (n,) indices of bodies.
            offset: (n, 3) the points in the frames of the bodies' prims, as `Sphere.offset` [µm].
        """
        return self.position[:, body] + rotate(self.orientation[:, body], offset)

    def check(self, scene: Scene, worlds: int | None = None) -> None:
        """Compare every shape with the scene.

        Args:
            scene: The scene that is being run.
            worlds: Number of worlds wanted, or None for whatever `position` has.

        Raises:
            ValueError: An array of another shape, or a time that is not finite.
        """
        count = {"body": len(scene.bodies), "trap": len(scene.traps)}
        worlds = self.worlds if worlds is None else worlds
        for name, (axis, width) in SHAPES.items():
            wanted = (worlds, count[axis], *((width,) if width else ()))
            if getattr(self, name).shape != wanted:
                raise ValueError(f"frame {name} has shape {getattr(self, name).shape}; allowed: {wanted}")
        if not np.isfinite(self.time):
            raise ValueError(f"frame time is {self.time}; allowed: a finite time [s]")


def capture_frame(sim: Simulation) -> Frame:
    """The present state and readout of a simulation, on the host."""
    readout = sim.readout
    position, orientation = sim.prim_poses()
    worlds, bodies = position.shape[:2]
    touching = sim.model.features.contacts
    traps = len(sim.scene.traps)
    empty = np.zeros((worlds, traps, 3))
    unwrapped = None
    if sim.model.features.periodic:
        unwrapped = position + sim.unwrapped_position() - sim.state.position.numpy().astype(float)
    # traps that nothing feels are not evaluated on the device: they stand where they were authored
    acting = sim.model.features.traps > 0
    return Frame(
        step=sim.state.step,
        time=sim.time,
        position=position,
        orientation=np.asarray(orientation),
        trap_position=readout.trap_position.numpy() if acting else empty + _authored(sim, 3),
        trap_power=readout.trap_power.numpy() if acting else empty[..., 0] + _authored(sim, 1)[..., 0],
        trap_force=readout.trap_force.numpy() if acting else empty,
        trap_distance=readout.trap_distance.numpy() if acting else np.full((worlds, traps), np.nan),
        escape_time=_escape_time(sim, readout.escape_step.numpy()),
        contact_force=readout.contact_force.numpy() if touching else np.zeros((worlds, bodies, 3)),
        contact_load=readout.contact_load.numpy() if touching else np.zeros((worlds, bodies)),
        unwrapped=unwrapped,
        entries=readout.entries.numpy().copy() if sim.model.features.inlet else None,
    )


def _escape_time(sim: Simulation, step: np.ndarray) -> np.ndarray:
    """(W, T) times of the first escapes [s], nan for none; all nan where no trap has an end to its reach."""
    if not step.size:
        return np.full((sim.model.worlds, len(sim.scene.traps)), np.nan)
    # a step records a loss when it arrives: on average half of it is past
    return np.where(step >= 0, (step - 0.5) * sim.time_step, np.nan)


def _authored(sim: Simulation, width: int) -> np.ndarray:
    """(T, width) authored positions (3) or powers (1) of the traps at the present time."""
    tracks = [t.position if width == 3 else t.power for t in sim.scene.traps]
    return np.array([track.at(sim.time) for track in tracks]).reshape(len(tracks), width)
