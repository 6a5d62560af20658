"""Powers that are commanded: what the time step of a model can carry."""

from __future__ import annotations

import math
import warnings

import numpy as np

from otwarp.errors import InputError
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.simulation.model import Model
from otwarp.simulation.time_step.speeds import authored_powers


def check_powers(model: Model, powers: np.ndarray) -> None:
    """Refuse powers (T,) [mW] that the time step of a model cannot carry; warn where variances miss the accuracy.

    Raises:
        InputError: Unstable; the message names the largest stable power, with all powers scaled alike.
    """
    authored = authored_powers(model.scene, model.values)
    # float32 powers read back may differ from the authored ones in the last bit
    if np.all(powers <= authored * (1.0 + 1e-6)):
        return
    rate, body = model.steepest.fastest(powers)
    scheme = INTEGRATORS[model.features.integrator]
    dt, stable = model.time_step, scheme.stable / rate if rate > 0.0 else math.inf
    worst = int(np.argmax(np.where(powers > authored, powers * model.steepest.stiffness, -1.0)))
    trap = model.scene.traps[worst].prim
    if dt >= stable:
        raise InputError(
            f"trap {trap}: power {powers[worst]:g} mW is unstable with the time step {dt:.4g} s, body {body} relaxes "
            f"at {rate:.4g} 1/s; allowed: below {powers[worst] * stable / dt:.4g} mW (all powers scaled alike), or a "
            f"time step below {stable:.4g} s"
        )
    utmost, _ = model.steepest.fastest(powers, anywhere=True)
    if dt * utmost >= scheme.stable:
        warnings.warn(
            f"trap {trap}: at power {powers[worst]:g} mW the time step {dt:.4g} s becomes unstable where all trapped "
            "bodies are as near to each other as they can come, because they are coupled; always stable: below "
            f"{powers[worst] * scheme.stable / (dt * utmost):.4g} mW (all powers scaled alike)",
            stacklevel=3,
        )
    rate, body = model.relaxation.fastest(powers)
    error = scheme.variance_error(rate * dt) if rate > 0.0 else 0.0
    if abs(error) > model.scales.accuracy:
        warnings.warn(
            f"trap {trap}: at power {powers[worst]:g} mW the time step {dt:.4g} s misses the wanted accuracy of "
            f"{100.0 * model.scales.accuracy:g} %: it makes stationary variances of body {body} "
            f"{100.0 * abs(error):.3g} % too {'large' if error > 0.0 else 'small'}",
            stacklevel=3,
        )
