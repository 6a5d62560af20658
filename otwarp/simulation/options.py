"""How a scene is stepped: one object, passed whole from the user to the kernels."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

from otwarp.simulation.packing.arguments import number

if TYPE_CHECKING:
    from otwarp.scene import Scene
    from otwarp.simulation.ends import End
    from otwarp.simulation.user_forces import Force


@dataclass(frozen=True, kw_only=True)
class StepOptions:
    """What a user may choose about the step, beyond the scene and its parameters.

    Its fields are arguments of `Simulation`, which says what each allows; a checkpoint keeps all of them.

    Attributes:
        time_step: Explicit step [s]; None lets the scene and its accuracy decide.
        integrator, noise: Names; None for the scene's.
        fast_math: Whether approximate instructions will do.
        crossings: Whether escapes between the ends of two steps count.
        precision: `float32` or `float64`.
        forces: The user's, beside those of the scene.
        allow_large_step: Whether an explicit step that is stable may make any errors.
        ends: What ends the task of a world; None: nothing does, and the host's clock counts for all.
        glides: Whether foci can be commanded velocities.
    """

    time_step: float | None = None
    integrator: str | None = None
    noise: str | None = None
    fast_math: bool = False
    crossings: bool = True
    precision: str = "float32"
    forces: tuple[Force, ...] = ()
    allow_large_step: bool = False
    ends: tuple[End, ...] | None = None
    glides: bool = False

    def of(self, scene: Scene) -> Scene:
        """The scene with its time step [s], integrator and noise replaced by those that are chosen here.

        Raises:
            InputError: The time step is no number.
        """
        chosen = {"time_step": self.time_step, "integrator": self.integrator, "noise": self.noise}
        given = {name: value for name, value in chosen.items() if value is not None}
        if "time_step" in given:
            given["time_step"] = number("time step", given["time_step"])
        return dataclasses.replace(scene, settings=dataclasses.replace(scene.settings, **given))
