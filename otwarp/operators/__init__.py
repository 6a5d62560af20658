"""SIMULATED operators: models of people at haptic devices, thousands at once, with the servo's chains between.

Nobody was measured: who they are says `population.toml`, frozen before the first trial, and what they do the kernels.
With and without haptics an operator is the same, with the same random numbers, but for the force on its hands.

study         `OperatorStudy`: who runs which trials under which conditions; open this first
loop          hands, chains, traps, physics and pictures, a servo period after the other
population    distributions of the model's numbers, and operators drawn from them
task          what a scene asks of its hands
people        operators as arrays on the device
chain         `ChainBatch`, the servo's chains of all hands of all worlds
constants     what chains are made of, as arrays
folder        a study on disk, which goes on after whatever ended it
statistics    paired rates, standardised differences, small studies, Sobol indices
summary       what a study has found, beside the paper and meta-analyses
tables        the same line by line
figure        the same as a picture
perception    late and wrong estimates of where robots are: what they do to force and delivery
kernels       operators and chains on the device
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from otwarp.lazy import lazy_names

if TYPE_CHECKING:
    from otwarp.operators.chain import ChainBatch as ChainBatch
    from otwarp.operators.folder import open_folder as open_folder
    from otwarp.operators.folder import run_study as run_study
    from otwarp.operators.population import Population as Population
    from otwarp.operators.population import load_population as load_population
    from otwarp.operators.study import OperatorStudy as OperatorStudy
    from otwarp.operators.summary import summarise as summarise

_NAMES = {
    "chain": ("ChainBatch",),
    "folder": ("open_folder", "run_study"),
    "population": ("Population", "load_population"),
    "study": ("OperatorStudy",),
    "summary": ("summarise",),
}

__getattr__, __dir__ = lazy_names(__name__, _NAMES)
