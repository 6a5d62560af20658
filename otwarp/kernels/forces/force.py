"""What the step knows of a force: a row of `FORCES`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.core.features import Features

Term = tuple[str, bool, str, str]
"""A term of the step, whether a step has it, why if so, and why not if not."""


@dataclass(frozen=True)
class BodyFacts:
    """What a force's strength at rest may follow from: one body of a scene, on the host.

    Attributes:
        weight: Weight minus buoyancy [pN].
        weight_arm: Distance of the centroid, where it acts, from the centre of diffusion [µm]; 0 where nobody asks for
            torques.
        body: The `otwarp.scene.Body`.
        values: Parameters of medium, flow, traps and this body by name, (1|W, …) in internal units.
    """

    weight: float
    weight_arm: float
    body: Any = None
    values: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Load:
    """How strong a force is, whatever the traps do: bounds for one body.

    Attributes:
        force: [pN].
        torque: [pN·µm].
        rate: Fastest relaxation that it causes, times viscosity [1/s·Pa·s = Pa].
    """

    force: float = 0.0
    torque: float = 0.0
    rate: float = 0.0

    def __add__(self, other: Load) -> Load:
        return Load(self.force + other.force, self.torque + other.torque, self.rate + other.rate)


@dataclass(frozen=True, kw_only=True)
class ForceRow:
    """A row of `FORCES`. What a force does not have is None.

    Attributes:
        name: What `otwarp info` calls it.
        active: Whether a step with these features has it; time steps and budgets ask it of the model's own features.
        why: Why it is in such a step; a function of the features.
        why_not: Why it is not in the others.
        local: Whether it depends on where a lone sphere is, so that an integrator's second look finds another one.
        local_on_rigid: Whether it depends on where a rigid body is, or on how it is turned.
        acts: Factory of `(model, b) -> bool`, whether it can act on body b; None: on any.
        on_sphere: Factory of `(model, control, state, bead, world, b, position, time) -> vec3` [pN], on a lone sphere.
        on_body: Factory of `(model, control, state, body, world, b, pose, time) -> Wrench`, on a rigid body.
        sphere_stiffness: Factory of the symmetric part of −∂F/∂x on a sphere [pN/µm], arguments as `on_sphere`.
        body_stiffness: The same on a rigid body, `(model, control, state, world, b, pose, time) -> (6, 6)`.
        load: `BodyFacts → Load`, for a force that all follows from them; traps count by their powers instead, and
            `parametric` forces by their parameters.
        parametric: The force with parameters per body that this row is.
        listed: What `otwarp info` lists in its place, where it is several terms.
    """

    name: str
    active: Callable[[Features], bool]
    why: Callable[[Features], str]
    why_not: str
    local: bool = True
    local_on_rigid: bool = True
    acts: Callable[[Features], wp.Function] | None = None
    on_sphere: Callable[[Features], wp.Function] | None = None
    on_body: Callable[[Features], wp.Function] | None = None
    sphere_stiffness: Callable[[Features], wp.Function] | None = None
    body_stiffness: Callable[[Features], wp.Function] | None = None
    load: Callable[[BodyFacts], Load] | None = None
    parametric: BodyForce | None = None
    listed: Callable[[Features], list[Term]] | None = None

    def is_local(self, *, rigid: bool) -> bool:
        """Whether it depends on the place of a lone sphere, or with `rigid` of a body that turns."""
        return self.local_on_rigid if rigid else self.local
