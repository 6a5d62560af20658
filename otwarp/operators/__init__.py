"""Simulated operators: the servo's chains for thousands of hands at once.

chain         `ChainBatch`, the chains of all hands of all worlds; open this first
constants     what chains are made of, as arrays
kernels       the chain on the device
"""
