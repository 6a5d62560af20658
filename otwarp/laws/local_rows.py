"""The local model of an operator's hand as rows of float64, by which its compiled form is called.

`otwarp.haptics.force.compiled` fills the rows without Warp, `otwarp.kernels.optics.local_force` reads them; both find a
number by its name here. Lengths are in µm, powers in mW, forces in pN.
"""

_CURVE = ("stiffness", "threshold2", "inverse_square", "offset", "cutoff2")


def _vector(name: str) -> tuple[str, str, str]:
    return f"{name}_x", f"{name}_y", f"{name}_z"


HAND = (*_vector("carried"), *_vector("published"), *_vector("force"), "alpha")
"""How far the hand has carried its traps, how far they were carried in the newest state, the force (written), and the
share of their way that spheres go towards their published places with each call."""

LAW = (
    *("model", "table", *_vector("axis"), *_vector("side"), "equilibrium"),
    *(*_CURVE, *(f"axial_{name}" for name in _CURVE), "reach2"),
)
"""A law: index of its model, and of its table or -1; frame of the beam, equilibrium, curves per mW as kernels have them
(distances squared), and the squared distance at which it ends."""

PULL = ("x", "y", "z", "power", "law", "first", "end")
"""A trap on the spheres of one kind: place before it was carried, power, its law, and which spheres, end excluded."""

SPHERE = ("x", "y", "z", *_vector("target"), "share")
"""A sphere: place (written), published place, and the share of the traps' way that it is taken to follow."""
