"""Optical traps: from a command to the force on a sphere and the wrench on a body.

traps (force models and `TRAP_TERMS`; open this first) chooses among trap_laws, force_table and exact (its sums over
nodes in exact_waves, their memory in exact_room); trap_command says where a trap is, aims what a body needs of it,
trap_wrench sums over traps and spheres (MSDM, eq. 2 of the paper), near_traps over those that a
list says are near, which a thread has in its thread_rows;
escapes finds the step in which a trap loses its sphere; readout measures forces after a launch; local_force is what an
operator's hand feels, compiled for the servo; potentials is the energy of a sphere where a law has one.
"""
