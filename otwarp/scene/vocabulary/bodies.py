"""Microrobots, their spheres, and cells."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import INF, Attribute, Schema
from otwarp.scene.vocabulary.forces import FORCES, for_cells

BODY = Schema(
    name="OtBodyAPI",
    of="bodies",
    applies_to="Xform holding spheres (with PhysicsRigidBodyAPI)",
    doc="A rigid body made of the OtSphereAPI spheres and OtRodAPI rods below it.",
    attributes=(
        Attribute("ot:body:density", 1190.0, "density", "[0, 30000]", doc="Mass density (used with gravity only)."),
        Attribute(
            "ot:body:youngsModulus",
            1e6,
            "pressure",
            "[1, 1e+13]",
            field="material.youngs_modulus",
            doc="Young's modulus of the contact surface.",
        ),
        Attribute(
            "ot:body:poissonRatio",
            0.4,
            range="[0, 0.5]",
            field="material.poisson_ratio",
            doc="Poisson ratio of the contact surface.",
        ),
        Attribute(
            "ot:body:mobility",
            (),
            unit="1/m, 1/m², 1/m³",
            doc="Override of the geometric mobility: 36 numbers row by row about the prim's origin at unit viscosity"
            " [1/m, 1/m², 1/m³].",
        ),
        Attribute(
            "ot:body:mobilityAccuracy",
            0.01,
            range="[0, 0.5]",
            doc="Wanted relative error of the computed mobility; 0 for the pair mobilities of its spheres, without"
            " rods and a few percent off.",
        ),
        Attribute(
            "ot:body:warningForce",
            INF,
            "force",
            "[0, inf]",
            doc="Contact force above which the user is warned; inf for none.",
        ),
        *FORCES,
    ),
)

SPHERE = Schema(
    name="OtSphereAPI",
    of="bodies",
    applies_to="Sphere below an OtBodyAPI prim",
    doc="One sphere of a body and what acts on it.",
    attributes=(
        Attribute("ot:sphere:refractiveIndex", 1.52, range="[1, 5]", doc="Refractive index."),
        Attribute("ot:sphere:trapped", True, doc="Whether traps act on it."),
        Attribute("ot:sphere:collides", True, doc="Whether it collides."),
        Attribute("ot:sphere:drag", True, doc="Whether it counts in the mobility of its body."),
    ),
)

ROD = Schema(
    name="OtRodAPI",
    of="bodies",
    applies_to="Capsule or Cylinder below an OtBodyAPI prim",
    doc="A rod of a body: a Capsule with its own radius, height and axis, or the Capsule that fills a Cylinder from end"
    " to end. Traps do not act on rods.",
    attributes=(
        Attribute(
            "ot:rod:refractiveIndex",
            0.0,
            range="[1, 5]",
            none=0.0,
            doc="Refractive index, which microscopes see; 0 for that of the body's first sphere.",
        ),
        Attribute("ot:rod:collides", True, doc="Whether it collides."),
        Attribute("ot:rod:drag", True, doc="Whether it counts in the mobility of its body."),
    ),
)

CELL = Schema(
    name="OtCellAPI",
    of="bodies",
    applies_to="Sphere, or Sphere prototype of a PointInstancer",
    doc="A biological cell: an elastic, adhesive sphere.",
    attributes=(
        Attribute(
            "ot:cell:youngsModulus",
            1e3,
            "pressure",
            "[1, 1e+13]",
            field="material.youngs_modulus",
            doc="Young's modulus.",
        ),
        Attribute("ot:cell:poissonRatio", 0.45, range="[0, 0.5]", field="material.poisson_ratio", doc="Poisson ratio."),
        Attribute(
            "ot:cell:adhesion", 0.0, "surface_energy", "[0, 1]", field="material.adhesion", doc="Work of adhesion."
        ),
        Attribute(
            "ot:cell:adhesionRange",
            1e-8,
            "length",
            "(0, 1e-06]",
            field="material.adhesion_range",
            doc="Gap over which the adhesion fades to zero.",
        ),
        Attribute(
            "ot:cell:refractiveIndex", 1.38, range="[1, 5]", field="sphere.refractive_index", doc="Refractive index."
        ),
        Attribute("ot:cell:trapped", False, field="sphere.trapped", doc="Whether traps act on it."),
        Attribute("ot:cell:density", 1060.0, "density", "[0, 30000]", doc="Mass density (used with gravity only)."),
        Attribute(
            "ot:cell:warningForce",
            1e-11,
            "force",
            "[0, inf]",
            doc="Contact force above which the user is warned; inf for none.",
        ),
        *for_cells(FORCES),
    ),
)
