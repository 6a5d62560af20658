"""What a scene needs: the feature set from which a step is composed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

MAX_WORLD_BODIES = 24
"""Bodies that may touch above which neighbours are found by a grid instead of by trying all pairs in one thread."""

MAX_CONTACTS = 64
"""Contacts a world can carry at once when one thread owns it."""

KEPT_CONTACTS = 4
"""Contacts of a world, at most, that the thread which steps it has room for: those of a bead and an obstacle."""

MAX_BODY_CONTACTS = 24
"""Contacts one body can carry at once when neighbours come from the grid."""

FEW_TRAPS = 2
"""Up to this many traps a lone sphere carries their constants along; beyond, they are read at the point of use."""

BLOCK = 256
"""Threads of a block on CUDA."""

KEPT_AIMS = 4
"""Up to this many traps the loops over those of a body that turns are unrolled, and traps that stay where they are stay
in registers."""

TURNING_BLOCK = 64
"""The same where a thread steps a body that turns: few are spread over more multiprocessors, and more of them fit
beside each other where each takes as many registers as a thread can have."""

BODY_BLOCKS, FEW_BODY_BLOCKS = 8, 6
"""Blocks of bodies that turn, and of worlds of few bodies, which a multiprocessor is to hold: 128 and 168 registers a
thread, in place of 255."""

GRID_WORLD_BODIES = 512
"""Bodies, and what collides of them, up to which a block of threads steps a world of the grid driver by itself."""

WORLD_BLOCK = 512
"""Threads of a block of such worlds, as many as a multiprocessor holds of 128 registers each: the parts of a step are
begun by all of them together, as a multiprocessor keeps no more code at hand than a part of it."""

WORLD_LANES = 64
"""Threads that share out such a world at least: a block has barriers for no more worlds than these make."""


def world_lanes(worlds: int, processors: int, least: int = WORLD_LANES) -> int:
    """Threads that share out a world: no more than give each multiprocessor a block, a power of two from `least` on."""
    lanes = WORLD_BLOCK
    while lanes > least and worlds * lanes > WORLD_BLOCK * processors:
        lanes //= 2
    return lanes


CPU_FLAGS = "-march=native -mllvm=-inline-threshold=200000 -mllvm=-inline-cold-callsite-threshold=200000"
"""How a CPU's step is compiled: with every function in its place. Warp passes structs by value, and a call that the
compiler does not inline copies the 4 kB of a model: with the default thresholds that made steps with contact, moving
traps and flow 1.6 times slower. Compiling takes 6 % longer."""


@dataclass(frozen=True, kw_only=True)
class Features:
    """The terms one step is made of.

    Attributes:
        driver: `solo`, one thread owns one body for many steps (bodies do not touch each other); `world`, one thread
            owns a world for many steps; `grid`, one thread per body and step, neighbours from lists.
        bodies, traps: How many of each in a world.
        trap_models: Force models in use, keys of `TRAP_TERMS`.
        moving_traps: Traps follow key frames.
        leaps: Some of them vary so much within a step that its stages have commands of their own.
        gliding_traps: Commanded foci have velocities.
        speed_limits: Some trap has a finite speed limit.
        spheres, rigid: There are lone spheres; there are bodies with rotation.
        brownian, gravity: Whether the terms act.
        flow: Profile of the background flow, or None.
        forces: Forces with parameters per body, the scene's and the user's; `kernels.body_forces.body_force.BodyForce`
            each.
        obstacles: Shapes of obstacles that something can hit.
        moving_obstacles: Some of them move.
        pairs: Bodies can touch each other.
        rods: Some of them touch by rods too.
        soft_contacts: In the `grid` driver, contacts of lone spheres are so soft against the time step that their force
            at its start serves for all of it.
        by_world: In the `grid` driver, worlds are so small that a block of threads takes one through many steps, where
            contacts are not soft; see `kernels.drivers.grid.world`.
        body_space: In the `world` driver, contacts are solved for what they move the bodies, because some are soft; see
            `kernels.contact.body_solve`.
        escapes: Traps hold spheres that can escape.
        crossings: Escapes between steps count; off only where a benchmark asks what that is worth.
        walls: Planes that hinder motion hydrodynamically: 0, 1, or 2 for several.
        coupling: Bodies carry each other along through the liquid.
        periodic: Space repeats along some axis.
        inlet: Cells that leave come in again at an inlet.
        max_contacts: Contacts the `world` driver makes room for: no more than the scene can have, because every
            thread keeps that room to itself.
        fast_math: Approximate instructions instead of accurate functions; see `Simulation`.
        precision: Of all real numbers but the noise: `float32` or `float64`.
        integrator: Key of `INTEGRATORS`.
        noise: Distribution of the thermal noise, one of `NOISES`.
        episodes: Worlds end and start anew, each with a clock of its own; see `kernels.core.worlds`.
        in_turn: CPU form of the contacts of the `grid` driver: solved one after the other, not all at once in sweeps.
        keeps: GPU form of the `world` driver for many worlds of few contacts that are solved for their forces: they lie
            in local arrays, which are read faster, and which a GPU reserves for as many threads as it can hold.
        phased: GPU form of the `world` driver for bodies that turn and touch, and of `by_world` for many worlds whose
            bodies touch: a kernel for each part of a step.
        cached: CPU form of the `world` driver: a thread has a cache to itself, so that constants of the bodies are read
            once a launch and not once a stage, and few contacts are solved for their forces.
        looks_once: In phases, key frames are looked up once for all worlds, into rows of `StepTimes`.
        team: In phases, threads that share out a world, several where worlds are few; see `kernels.core.team`.
        listed: GPU form of the `solo` driver for robots in traps of finite reach: which of these may reach which sphere
            is known from a list; see `kernels.optics.near_traps`.
        lanes: CPU form of the `solo` driver and of the `grid` driver for lone spheres: noise in blocks, several
            bodies to a thread.
        blocks: CPU form of the `grid` driver where some bodies turn and others do not: noise of the latter in blocks.
        vectors: In `lanes` of lone spheres, there are worlds enough to step equal ones in a processor's vectors.
    """

    driver: Literal["solo", "world", "grid"] = "solo"
    bodies: int = 1
    traps: int = 0
    trap_models: tuple[str, ...] = ()
    moving_traps: bool = False
    leaps: bool = False
    gliding_traps: bool = False
    speed_limits: bool = False
    spheres: bool = True
    rigid: bool = False
    brownian: bool = True
    gravity: bool = False
    flow: str | None = None
    forces: tuple[Any, ...] = ()
    obstacles: tuple[str, ...] = ()
    moving_obstacles: bool = False
    pairs: bool = False
    rods: bool = False
    soft_contacts: bool = False
    by_world: bool = False
    body_space: bool = False
    escapes: bool = False
    crossings: bool = True
    walls: int = 0
    coupling: bool = False
    periodic: bool = False
    inlet: bool = False
    max_contacts: int = MAX_CONTACTS
    fast_math: bool = False
    precision: Literal["float32", "float64"] = "float32"
    integrator: str = "heun"
    noise: str = "gaussian"
    episodes: bool = False
    in_turn: bool = False
    keeps: bool = False
    phased: bool = False
    cached: bool = False
    looks_once: bool = False
    team: int = 1
    listed: bool = False
    lanes: bool = False
    blocks: bool = False
    vectors: bool = False

    @property
    def kept_traps(self) -> bool:
        """Whether foci and powers change by command only, that is not within a launch, but for their velocities."""
        return not (self.moving_traps or self.speed_limits)

    @property
    def still_traps(self) -> bool:
        """Whether they do not change within a launch at all."""
        return self.kept_traps and not self.gliding_traps

    @property
    def keeps_aims(self) -> bool:
        """Whether where the traps are, or glide from, is known before a loop of steps: `RigidConstants` holds it."""
        return self.kept_traps and 0 < self.traps <= KEPT_AIMS and not self.periodic

    @property
    def monitors(self) -> int:
        """How many traps a lone sphere monitors itself: those whose constants it carries along."""
        return self.traps if self.escapes and self.kept_traps and self.traps <= FEW_TRAPS else 0

    @property
    def draws_blocks(self) -> bool:
        """Whether the noise of lone spheres comes in blocks."""
        return self.brownian and (self.lanes or self.blocks)

    @property
    def module_options(self) -> dict[str, Any]:
        """How Warp compiles the step."""
        block = BLOCK if self.blocks_held is None else TURNING_BLOCK
        if self.by_world:
            block = WORLD_BLOCK
        return {"fast_math": self.fast_math, "cpu_compiler_flags": CPU_FLAGS, "block_dim": block}

    @property
    def blocks_held(self) -> int | None:
        """Blocks of `TURNING_BLOCK` threads that a multiprocessor is to hold, or None where blocks are larger."""
        if self.driver == "solo" and self.rigid:
            return BODY_BLOCKS
        return FEW_BODY_BLOCKS if self.driver == "world" and not self.coupling else None

    @property
    def launch_bounds(self) -> tuple[int, ...] | None:
        """What a kernel of one thread a body or world is compiled for: threads of a block, and how many blocks are to
        fit; float64 and exact forces need all registers."""
        if self.blocks_held is None:
            return None
        exact = any(name.startswith("exact_") for name in self.trap_models)
        whole = exact or self.precision == "float64"
        return (TURNING_BLOCK,) if whole else (TURNING_BLOCK, self.blocks_held)

    @property
    def contacts(self) -> bool:
        """Whether anything can touch anything."""
        return self.pairs or bool(self.obstacles)

    @property
    def bends(self) -> bool:
        """Whether motion across a gap opens it: between bodies, of a body that turns, before what is not flat."""
        return self.pairs or (self.rigid and self.contacts) or bool(set(self.obstacles) - {"plane", "mesh"})
