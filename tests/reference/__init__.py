"""Float64 NumPy twins of every kernel term, written from the equations and independent of any kernel code.

Quaternions are (x, y, z, w); lengths in µm, forces in pN, times in s, power in mW. One point, sphere or contact at a
time, so that each reads like its equation; only the random numbers are vectorised.
"""
