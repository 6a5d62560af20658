"""Haptic rendering: devices, the servo's signal chain and its safety, and the mailbox to the simulation.

Plain Python numbers only: nothing here knows of Warp or USD, so that a servo process starts fast and stays small.
"""
