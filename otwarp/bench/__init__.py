"""Benchmarks that a user runs on the machine at hand: what accuracy costs."""
