"""Forces with parameters per body: a function of `ForceInput` each, which any driver, device and precision takes.

body_force says what such a force is (open it first). Every other file, as external, is one built-in force with scene
attributes; a
user's force is the same thing made outside the package, by `otwarp.force`.
"""
