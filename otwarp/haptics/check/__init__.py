"""What `otwarp haptics check` measures, and what bounds the force that an operator feels.

check     `run_check`: devices, grants, costs, and all of the below
timing    jitter of a loop, latency of a force in the servo process
zwidth    the stiffest wall that a chain renders on a bare device
"""
