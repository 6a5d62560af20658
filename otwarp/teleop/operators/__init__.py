"""What operators do and feel.

`hands` says which hand moves which traps, how, with what device, and what it feels of the scene; `felt` compiles that;
`servo` is the session's side of the process that runs devices and chains, and `virtual_servo` one in this process, on a
virtual clock; `trap_commands` brings together what hands, page and programs command of the traps.
"""
