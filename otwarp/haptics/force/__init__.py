"""The local model: the optical force on the spheres near an operator's traps.

law         curves of eq. 1, and `LocalModel`, the sum of eq. 2 over traps and spheres; to begin with, open this
table       a force table as the servo reads it
compiled    `CompiledModel`, the same in one call of machine code, and `CompiledLaw`, where that lies
trial       a trial of machine code in a process of its own, against the law in Python
"""
