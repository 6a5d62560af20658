"""The loop that runs the chains at 1 kHz, in a process of its own.

process    `ServoProcess`, as the parent holds it, and `child`, what runs there; to begin with, open this
link       what passes between them: states and orders in, forces and status out
servo      the cycle itself, a function of clock, devices, chains and mailboxes
"""
