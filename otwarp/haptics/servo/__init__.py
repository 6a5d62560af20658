"""The loop that runs the chains at 1 kHz, in a process of its own.

process    `ServoProcess`, as the parent holds it; to begin with, open this
child      what runs in that process
cycles     what the parent fetches of a recording
link       what passes between them: states and orders in, forces and status out
servo      the cycle itself, a function of clock, devices, chains and mailboxes
hand       one side in it
guard      what passes to and from the guardian, and its process as the parent holds it
guardian   what runs there: zero force for devices whose servo was killed or stands still
"""
