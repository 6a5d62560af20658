"""What the inner rooms of haptics share.

types            device, samples, states, the record of a cycle
config, fields   every number that shapes a force, with its range; presets; the way to JSON and back
realtime         clocks, and what the operating system grants a punctual loop
named_memory     pieces of shared memory, all of whose pages are there
shared_memory    `Mailbox` for the latest value, `Ring` for every cycle
"""
