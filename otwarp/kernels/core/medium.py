"""The liquid of a world: its thermal energy and viscosity, and what turns a mobility into a move."""

import warp as wp

from otwarp.kernels.core.types import ModelData, world_row


@wp.func
def thermal_energy_of(model: ModelData, world: int) -> float:
    """Thermal energy k_B·T of a world's liquid [pN·µm]."""
    return model.medium.thermal_energy[world_row(model.medium.thermal_energy.shape[0], world)]


@wp.func
def viscosity_of(model: ModelData, world: int) -> float:
    """Dynamic viscosity η of a world's liquid [pN·s/µm² = Pa·s]."""
    return model.medium.viscosity[world_row(model.medium.viscosity.shape[0], world)]


@wp.func
def step_over_viscosity(model: ModelData, world: int) -> float:
    """dt/η [µm²/pN]: what turns a mobility at unit viscosity into a move per force."""
    return wp.float32(model.time_step) / viscosity_of(model, world)
