"""Internal units, physical constants and the factors that lead from SI to them.

Inside otwarp: length µm, time s, force pN, power mW, temperature K. It follows that viscosity is in pN·s/µm²
(numerically equal to Pa·s), energy in pN·µm (1e-18 J), stiffness in pN/µm and torque in pN·µm.
"""

from __future__ import annotations

BOLTZMANN = 1.380649e-5
"""Boltzmann constant [pN·µm/K] (exact SI value 1.380649e-23 J/K)."""

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light in vacuum [m/s] (exact)."""

FORCE_PER_POWER = 1e9 / SPEED_OF_LIGHT
"""Momentum flux of light in vacuum [pN/mW]: F = FORCE_PER_POWER · n_medium · P · Q."""

STANDARD_GRAVITY = 9.80665e6
"""Standard acceleration of free fall [µm/s²]."""

FROM_SI: dict[str, float] = {
    "none": 1.0,
    "angle": 1.0,
    "length": 1e6,
    "inverse_length": 1e-6,
    "time": 1.0,
    "rate": 1.0,
    "speed": 1e6,
    "temperature": 1.0,
    "power": 1e3,
    "force": 1e12,
    "stiffness": 1e6,
    "force_area": 1e24,
    "pressure": 1.0,
    "viscosity": 1.0,
    "density": 1e-12,
    "surface_energy": 1e6,
}
"""Dimension → factor that turns a value in SI units into internal units."""

SI_SYMBOL: dict[str, str] = {
    "none": "",
    "angle": "rad",
    "length": "m",
    "inverse_length": "1/m",
    "time": "s",
    "rate": "1/s",
    "speed": "m/s",
    "temperature": "K",
    "power": "W",
    "force": "N",
    "stiffness": "N/m",
    "force_area": "N·m²",
    "pressure": "Pa",
    "viscosity": "Pa·s",
    "density": "kg/m³",
    "surface_energy": "J/m²",
}
"""Dimension → SI symbol, for error messages and documentation."""

INTERNAL_SYMBOL: dict[str, str] = {
    "none": "",
    "angle": "rad",
    "length": "µm",
    "inverse_length": "1/µm",
    "time": "s",
    "rate": "1/s",
    "speed": "µm/s",
    "temperature": "K",
    "power": "mW",
    "force": "pN",
    "stiffness": "pN/µm",
    "force_area": "pN·µm²",
    "pressure": "Pa",
    "viscosity": "Pa·s",
    "density": "pN·s²/µm⁴",
    "surface_energy": "pN/µm",
}
"""Dimension → symbol of its internal unit."""
