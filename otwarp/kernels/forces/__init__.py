"""Forces: everything that pulls at a body between contacts, as rows of one table.

table holds `FORCES` (open it first): for each force the functions that evaluate it, when it is compiled in, and how
strong it is at rest. total sums the active rows for spheres and for rigid bodies: the only two places where a force
enters the step, of any driver, integrator, device and precision; it starts from zeros. force says what a row is; traps,
gravity and parametric are the functions of the rows; locality says which bodies feel another force elsewhere. readout
measures forces with parameters after a launch, probe wherever the host asks.
"""
