"""Model, State, Control, Readout, and the one object that steps: Simulation."""

from otwarp.simulation.model import Model
from otwarp.simulation.simulation import Simulation
from otwarp.simulation.state import Control, Readout, State

__all__ = ["Control", "Model", "Readout", "Simulation", "State"]
