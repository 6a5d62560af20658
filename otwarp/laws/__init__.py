"""Laws that several rooms evaluate, each in its own way: said once here, imported by all, importing nobody.

Open trap_law first.

trap_law    `TrapLaw`, one force curve of a trap: authored, fitted, felt by an operator, packed for kernels
local_rows  how a hand's traps, spheres and laws lie in memory for compiled code
table       how the nested grids of a force table are laid out and addressed
wall_fits   how much harder a sphere moves near a wall: the formulae of kernels and of float64 code
"""

from otwarp.laws.trap_law import TrapLaw

__all__ = ["TrapLaw"]
