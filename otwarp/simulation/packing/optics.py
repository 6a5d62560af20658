"""What the beams of a scene do to its spheres: one force table for every distinct pair, shared where pairs are equal.

A trap whose force comes from optics has no authored curve, but the rest of the model asks for one: how stiff the trap
is, how far it reaches, where its equilibrium lies. `TrapOptics.resolve` answers with the trap's law for the sphere it
holds.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import warp as wp

from otwarp.device import empty
from otwarp.kernels.core.exact_data import ExactData
from otwarp.kernels.core.table_data import ForceTableData, GridLevel
from otwarp.kernels.optics.traps import exact_name, table_name
from otwarp.laws.trap_law import FIELDS, TrapLaw
from otwarp.scene import IDENTITY, Medium, Scene, Trap
from otwarp.scene.transforms import rotate
from otwarp.simulation.packing.arrays import Place, device_array

if TYPE_CHECKING:
    from otwarp.optics import Beam, ForceTable
    from otwarp.optics.batched import PackedForce


def beam_of(trap: Trap, medium: Medium) -> Beam:
    """The beam of a trap at 1 mW."""
    from otwarp.optics import Beam

    return Beam(
        kind=trap.beam,
        numerical_aperture=trap.numerical_aperture,
        medium_index=medium.refractive_index,
        wavelength=trap.wavelength,
        polarization=trap.polarization,
        filling=trap.filling,
        charge=trap.charge,
        depth=trap.depth,
        glass_index=trap.glass_index,
    )


@dataclass(frozen=True, eq=False)
class TrapOptics:
    """Optical pairs of a scene; T traps, K optical kinds of trapped spheres.

    Attributes:
        kinds: (radius [µm], refractive index) of each kind.
        tables: One per distinct beam, sphere, tolerance and interpolation.
        table: (T, K) index into `tables`, -1 for a trap that follows an authored law.
        exact: Tables of the exact force by index into `tables`, for the pairs of traps whose model is `exact`.
        nearest: (T,) kind of the sphere that the trap names, or else of the one nearest to its focus; 0 without any.
    """

    kinds: tuple[tuple[float, float], ...]
    tables: tuple[ForceTable, ...]
    table: np.ndarray
    nearest: np.ndarray
    exact: Mapping[int, PackedForce] = field(default_factory=dict)

    @classmethod
    def of(cls, scene: Scene, focus: np.ndarray, device: wp.Device) -> TrapOptics:
        """Find or make the tables a scene needs; a scene without optical traps costs nothing.

        Args:
            focus: (T, 3) foci at the start, in world 0 [µm].
            device: Where missing tables are made.
        """
        spheres = [s for b in scene.bodies for s in b.spheres if s.trapped]
        kinds = tuple(sorted({(s.radius, s.refractive_index) for s in spheres}))
        table = np.full((len(scene.traps), len(kinds)), -1, dtype=np.int32)
        nearest = np.zeros(len(scene.traps), dtype=int)
        if not kinds or not any(t.optical for t in scene.traps):
            return cls(kinds, (), table, nearest)
        from otwarp.optics import Particle, build_table

        place = np.array(
            [
                np.array(b.position) + rotate(np.array(b.orientation), np.array(s.offset))
                for b in scene.bodies
                for s in b.spheres
                if s.trapped
            ]
        )
        tables: dict[tuple[object, ...], int] = {}
        made: list[ForceTable] = []
        for t, trap in enumerate(scene.traps):
            if not trap.optical:
                continue
            named = [i for i, s in enumerate(spheres) if s.prim == trap.holds]
            chosen = spheres[named[0] if named else int(np.argmin(np.linalg.norm(place - focus[t], axis=1)))]
            nearest[t] = kinds.index((chosen.radius, chosen.refractive_index))
            beam = beam_of(trap, scene.medium)
            for k, (radius, index) in enumerate(kinds):
                key = (beam, radius, index, trap.tolerance, trap.interpolation, trap.reach)
                if key not in tables:
                    tables[key] = len(made)
                    sphere = Particle(radius=radius, index=index)
                    made.append(
                        build_table(
                            beam,
                            sphere,
                            tolerance=trap.tolerance,
                            interpolation=trap.interpolation,
                            device=device.alias,
                        ).cut(trap.reach)
                    )
                table[t, k] = tables[key]
        exact: dict[int, PackedForce] = {}
        if any(t.model == "exact" for t in scene.traps):
            from otwarp.optics.batched import pack_force

            used = {int(i) for t, trap in enumerate(scene.traps) if trap.model == "exact" for i in table[t]}
            exact = {i: pack_force(made[i].beam, made[i].sphere, reach=made[i].cutoff, device=device) for i in used}
        return cls(kinds, tuple(made), table, nearest, exact)

    @classmethod
    def without_tables(cls, scene: Scene) -> TrapOptics:
        """What serves where only the kinds of terms count: optical traps pass for harmonic ones."""
        traps = len(scene.traps)
        return cls((), (), np.full((traps, 0), -1, dtype=np.int32), np.zeros(traps, dtype=int))

    def kind(self, radius: float, index: float) -> int:
        """Optical kind of a trapped sphere."""
        return self.kinds.index((radius, index))

    def held(self, trap: int) -> ForceTable | None:
        """Table of a trap for the sphere it holds, None for a trap that follows an authored law."""
        return self.tables[self.table[trap, self.nearest[trap]]] if self._optical(trap) else None

    def term_name(self, scene: Scene, trap: int) -> str:
        """Key of the trap's force model, as `kernels.optics.traps.trap_term` knows it."""
        entry = scene.traps[trap]
        if not self._optical(trap):
            # without a sphere to act on, any term serves
            return f"{'harmonic' if entry.optical else entry.model}_{'split' if entry.axial else 'isotropic'}"
        table = self.tables[self.table[trap, 0]]
        if entry.model == "exact":
            shared = any(e.data.table.device.is_cuda for e in self.exact.values())
            return exact_name(*self.exact_capacities, entry.interpolation, table.layers, shared)
        return table_name(entry.interpolation, table.layers, _upright(entry, table.beam))

    @property
    def exact_capacities(self) -> tuple[int, int]:
        """Orders and nodes that serve all exact forces of the scene."""
        return max(e.orders for e in self.exact.values()), max(e.nodes for e in self.exact.values())

    def _optical(self, trap: int) -> bool:
        return bool(self.table.shape[1]) and bool(self.table[trap, 0] >= 0)

    def resolve(self, scene: Scene) -> Scene:
        """The scene with every optical trap's law, per mW, for the sphere it holds; it reaches as far as any table."""
        if not any(trap.optical for trap in scene.traps):
            return scene
        traps = []
        for t, trap in enumerate(scene.traps):
            table = self.held(t)
            if table is None:
                # an optical trap in a scene without a sphere to act on has nothing to compute
                law = TrapLaw(stiffness=0.0, cutoff=1.0) if trap.optical else trap.radial
                traps.append(dataclasses.replace(trap, radial=law))
                continue
            about = table.properties
            height = about.equilibrium if about else 0.0
            stiffness = about.stiffness if about else (0.0, 0.0, 0.0)
            reach = max(self.tables[i].cutoff for i in self.table[t]) + abs(height)
            traps.append(
                dataclasses.replace(
                    trap,
                    equilibrium=height,
                    radial=TrapLaw(stiffness=max(stiffness[:2]), cutoff=reach, power=1.0),
                    axial=TrapLaw(stiffness=stiffness[2], cutoff=reach, power=1.0),
                )
            )
        return dataclasses.replace(scene, traps=tuple(traps))

    def keep_laws(self, values: dict[str, np.ndarray], own: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """`values` with the laws of optical traps as they follow from optics, whatever the user asks of the others."""
        optical = np.array([self._optical(t) for t in range(len(self.table))], dtype=bool)
        if not optical.any():
            return values
        laws = [n for n in values if n.removeprefix("trap_").removeprefix("axial_") in FIELDS]
        return {**values, **{name: np.where(optical, own[name], values[name]) for name in laws}}

    def stiffest(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Parameters with every optical trap's largest stiffness at an equilibrium of any kind of sphere."""
        found = [
            max((max(p.stiffness) for i in row if i >= 0 and (p := self.tables[i].properties)), default=0.0)
            for row in self.table
        ]
        names = ("trap_stiffness", "trap_axial_stiffness")
        return {**values, **{name: np.maximum(values[name], found) for name in names}}

    def steepest(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Parameters with the steepest restoring slope of every trap, on any kind of sphere, as its stiffness.

        The branch A/d² + C of a piecewise law may be steeper than K where it begins, by −2A/δ³.
        """
        slopes = self.steepest_slopes()
        found = dict(values)
        for curve in ("trap_", "trap_axial_"):
            start, inverse_square = values[curve + "threshold"], values[curve + "inverse_square"]
            branch = np.where(np.isfinite(start), -2.0 * inverse_square / start**3, 0.0)
            found[curve + "stiffness"] = np.maximum(np.maximum(values[curve + "stiffness"], slopes), branch)
        return found

    def steepest_slopes(self) -> np.ndarray:
        """(T,) steepest restoring slope of every optical trap on any kind of sphere [pN/µm per mW], 0 of the others."""
        return np.array([max((self.tables[i].steepest for i in row if i >= 0), default=0.0) for row in self.table])

    def depths(self) -> np.ndarray:
        """(T,) depth of every optical trap for the sphere that it holds [pN·µm per mW], 0 where it holds none."""
        found = [self.held(t) for t in range(len(self.table))]
        return np.array([f.properties.depth if f and f.properties else 0.0 for f in found])

    def escape_distance(self) -> np.ndarray:
        """(T,) distance from the equilibrium at which the held sphere has escaped [µm], inf if nothing is held."""
        found = [self.held(t) for t in range(len(self.table))]
        return np.array([max(f.properties.escape_distance) if f and f.properties else math.inf for f in found])


def polarization_azimuth(beam: Beam) -> float:
    """Azimuth of the polarization's major axis [rad], from which a table counts; 0 for a beam that has none."""
    from otwarp.optics.table import layer_count, major_axis

    return major_axis(beam) if layer_count(beam) > 1 else 0.0


def _upright(trap: Trap, beam: Beam) -> bool:
    """Whether the frame of a trap's table is the world's."""
    return trap.orientation == IDENTITY and polarization_azimuth(beam) == 0.0


def trap_sides(scene: Scene) -> np.ndarray:
    """(T, 3) direction across each beam: the polarization's major axis, from which a table measures azimuth, or x."""
    sides = []
    for trap in scene.traps:
        turn = polarization_azimuth(beam_of(trap, scene.medium)) if trap.model == "table" else 0.0
        sides.append(rotate(np.array(trap.orientation), np.array([math.cos(turn), math.sin(turn), 0.0])))
    return np.array(sides).reshape(-1, 3)


def exact_room(optics: TrapOptics, threads: int, device: wp.Device) -> wp.array:
    """What up to so many threads of a GPU keep of exact forces, one at a time; of length 0 on a CPU, or without any."""
    if not optics.exact:
        return empty(0, wp.vec2d, device)
    from otwarp.optics.batched import room_for

    return room_for(threads, *optics.exact_capacities, device)


def pack_exact(optics: TrapOptics, room: wp.array, device: Place) -> wp.array:
    """What exact forces are computed from by table, all with the same room."""
    if not optics.exact:
        return empty(0, ExactData, device.device)
    from otwarp.optics.batched import in_room

    known = [
        in_room(optics.exact[i].data, room) if i in optics.exact else ExactData() for i in range(len(optics.tables))
    ]
    return wp.array(known, dtype=ExactData, device=device.device)


def pack_tables(
    optics: TrapOptics, equilibrium: Sequence[float], device: Place
) -> tuple[Annotated[Any, ForceTableData], wp.array, wp.array]:
    """All tables one after another, in forces per mW; and `near_nodes` and `near_grid` of `TrapData`.

    Args:
        equilibrium: Of the traps, along their axes from the focus [µm].
    """
    grid_level = device.typed(GridLevel)
    real = np.dtype(device.precision).type
    starts, nodes, total = [], [np.zeros((0, 4), dtype=real)], 0
    for table in optics.tables:
        for level in table.levels:
            starts.append(total // table.layers)
            # padded to multiples of 6, so that a level starts at a whole node whether nodes have 1, 2 or 3 layers
            count = level.node.size // 3
            rows = np.zeros((count + -count % 6, 4), dtype=real)
            rows[:count, :3] = real(table.beam.force_scale) * level.node.reshape(-1, 3)
            nodes.append(rows)
            total += len(rows)
    levels = [level for table in optics.tables for level in table.levels]
    packed: np.ndarray = np.zeros(len(levels), dtype=grid_level.numpy_dtype())
    for row, (start, level) in enumerate(zip(starts, levels, strict=True)):
        per_spacing = real(1.0 / level.spacing)
        middle = real(level.radius) * per_spacing
        packed[row] = (start, level.node.shape[1], level.end, per_spacing, middle)
    data = device.typed(ForceTableData)()
    data.node = device_array(np.concatenate(nodes), wp.vec4, device)
    first = np.cumsum([0] + [len(table.levels) for table in optics.tables])
    data.level_start = device_array(first, wp.int32, device)
    data.level = wp.array(packed, dtype=grid_level, device=device.device)
    nodes_of, grid_of = (np.zeros((*optics.table.shape, 4), dtype=kind) for kind in (np.int32, real))
    if len(packed):
        finest: np.ndarray = packed[first[np.maximum(optics.table, 0)]]
        nodes_of[..., :3] = np.stack((optics.table, finest["node"], finest["columns"]), axis=-1)
        grid_of[..., :3] = np.stack([finest[name] for name in ("radius", "per_spacing", "middle")], axis=-1)
        grid_of[..., 3] = np.reshape(equilibrium, (-1, 1))
    return data, device_array(nodes_of, wp.vec4i, device, ndim=2), device_array(grid_of, wp.vec4, device, ndim=2)
