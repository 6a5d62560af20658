"""Benchmarks: each module measures one question and prints its tables; `python -m benchmarks --write` runs them all."""
