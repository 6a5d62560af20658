"""The same workload as other people would write it: one self-contained file per language or library.

Case a: N independent Brownian beads in three dimensions, each in its own harmonic trap, by the Euler–Maruyama scheme in
float32 (Ermak and McCammon 1978, doi:10.1063/1.436761):

    x ← x + h·(c − x) + s·ξ,  h = k·dt/γ,  s = √(2 k_B T dt/γ)

with Gaussian ξ. Every file has `missing(kind) -> str | None`, why it cannot run on `cpu` or `cuda` here, and a class
`Peer(beads, relaxation=h, kick=s, seed=…, kind=…)` with `name`, `step(steps)`, which returns when the work is done, and
`variance() -> float` of the distance from the trap along one axis, to be compared with s²/(1 − (1 − h)²).

Case b: the soft Brownian spheres of `benchmarks.crowd`, in numbers in `case_b`. Every file has `missing(kind)` and a
class `Peer(count, seed=…, kind=…)` with `name`, `step(steps)`, and `positions()`, (count, 3) in the order of the start
[µm]. All draw Gaussian noise and take the force at the start of the step, as otwarp does where contacts are so soft.
"""
