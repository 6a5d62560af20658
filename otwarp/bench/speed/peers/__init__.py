"""One workload as other people would write it: a file for every language or library, none of which knows otwarp.

Case a, the modules here (`c_bead`, `numba_bead`, `numpy_bead`: open the last first): N independent Brownian beads in
three dimensions, each in its own harmonic trap, by the Euler–Maruyama scheme in float32 (Ermak and McCammon 1978,
doi:10.1063/1.436761):

    x ← x + h·(c − x) + s·ξ,  h = k·dt/γ,  s = √(2 k_B T dt/γ)

with Gaussian ξ and c = (3, 5, 7) µm. Every file has `missing(kind) -> str | None`, why it cannot run on `cpu` or `cuda`
here, and a class `Peer(beads, relaxation=h, kick=s, seed=…, kind=…)` with `name`, `step(steps)`, which returns when the
work is done, and `variance() -> float` of the distance from the trap along one axis, to be compared with
s²/(1 − (1 − h)²).

Case b, modules that a caller may give: the soft Brownian spheres of `otwarp.bench.speed.many_body`. `missing(kind)` as
above, and a class `Peer(count, seed=…, kind=…)` with `name`, `step(steps)`, and `positions()`, (count, 3) in the order
of the start [µm]. All draw Gaussian noise and take the force at the start of the step, as otwarp does where contacts
are so soft.
"""
