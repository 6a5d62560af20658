"""Codes that `python -m benchmarks.speed` sets beside otwarp's, beyond those that `otwarp bench speed` brings along.

What such a file must have is written in `otwarp.bench.speed.peers`; `*_bead` are of case a, `*_crowd` of case b.
"""
