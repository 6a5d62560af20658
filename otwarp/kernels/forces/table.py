"""`FORCES`: all forces of the step, in the order in which they are summed."""

from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.body_forces.external import EXTERNAL
from otwarp.kernels.core.features import Features
from otwarp.kernels.forces.force import ForceRow
from otwarp.kernels.forces.gravity import weight_load, weight_of_body, weight_of_sphere
from otwarp.kernels.forces.parametric import parametric_on_body, parametric_on_sphere
from otwarp.kernels.forces.traps import is_trapped, trap_kinds, traps_on_sphere
from otwarp.kernels.optics.trap_wrench import trap_wrench_term, wrench_stiffness_term


def parametric(force: BodyForce, why: str, why_not: str, *, name: str = "", local: bool = True) -> ForceRow:
    """The row of a force with parameters per body; what it does not say is as in `ForceRow`."""

    def index_in(f: Features) -> int:
        return f.forces.index(force)

    return ForceRow(
        name=name or force.name,
        active=lambda f: force in f.forces,
        why=lambda f: why,
        why_not=why_not,
        local=local,
        # what is constant at a sphere turns a body all the same
        local_on_rigid=local or force.acts_on == "spheres",
        on_sphere=lambda f: parametric_on_sphere(f, index_in(f)),
        on_body=lambda f: parametric_on_body(f, index_in(f)),
        parametric=force,
    )


FORCES: dict[str, ForceRow] = {
    "traps": ForceRow(
        name="traps",
        active=lambda f: bool(f.trap_models),
        why=lambda f: "models: " + ", ".join(f.trap_models),
        why_not="no trap, or no sphere that traps act on",
        acts=lambda f: is_trapped,
        on_sphere=lambda f: traps_on_sphere(f, "force"),
        on_body=trap_wrench_term,
        sphere_stiffness=lambda f: traps_on_sphere(f, "stiffness"),
        body_stiffness=wrench_stiffness_term,
        listed=trap_kinds,
    ),
    "gravity": ForceRow(
        name="gravity",
        active=lambda f: f.gravity,
        why=lambda f: "ot:scene:gravity",
        why_not="ot:scene:gravity is false",
        local=False,
        on_sphere=weight_of_sphere,
        on_body=weight_of_body,
        load=weight_load,
    ),
    "external": parametric(
        EXTERNAL,
        "a body has ot:body:externalForce",
        "no body has ot:body:externalForce",
        name="external force",
        local=False,
    ),
}
"""Built-in forces by name. Contact is no row: it is solved after each stage, with what it needs of both bodies."""


def active_forces(f: Features) -> list[ForceRow]:
    """Rows of a step: the built-in ones that it has, then the user's."""
    known = [row.parametric for row in FORCES.values()]
    rows = [row for row in FORCES.values() if row.active(f)]
    return rows + [parametric(force, "given to the simulation", "") for force in f.forces if force not in known]
