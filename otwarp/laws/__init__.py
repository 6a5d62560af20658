"""Laws that several rooms evaluate, each in its own way: said once here, imported by all, importing nobody.

trap_law    `TrapLaw`, one force curve of a trap: authored, fitted, felt by an operator, packed for kernels
local_rows  how a hand's traps, spheres and laws lie in memory for compiled code
wall_fits   how much harder a sphere moves near a wall: the formulae of kernels and of float64 code
"""

from otwarp.laws.trap_law import TrapLaw

__all__ = ["TrapLaw"]
