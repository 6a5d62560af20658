"""Microrobots, their spheres, and cells."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import INF, Attribute, Schema

_MATERIAL = {"low": 1.0, "high": 1e13}

BODY = Schema(
    name="OtBodyAPI",
    applies_to="Xform holding spheres (with PhysicsRigidBodyAPI)",
    doc="A rigid body made of the OtSphereAPI spheres and OtRodAPI rods below it.",
    attributes=(
        Attribute(
            name="ot:body:density",
            field="density",
            dimension="density",
            default=1190.0,
            low=0.0,
            high=3e4,
            doc="Mass density (used with gravity only).",
        ),
        Attribute(
            name="ot:body:youngsModulus",
            field="youngs_modulus",
            dimension="pressure",
            default=1e6,
            **_MATERIAL,
            doc="Young's modulus of the contact surface.",
        ),
        Attribute(
            name="ot:body:poissonRatio",
            field="poisson_ratio",
            default=0.4,
            low=0.0,
            high=0.5,
            doc="Poisson ratio of the contact surface.",
        ),
        Attribute(
            name="ot:body:mobility",
            field="mobility",
            usd_type="double[]",
            default=(),
            doc="Override of the geometric mobility: 36 numbers row by row about the prim's origin at unit viscosity"
            " [1/m, 1/m², 1/m³].",
        ),
        Attribute(
            name="ot:body:mobilityAccuracy",
            field="mobility_accuracy",
            default=0.01,
            low=0.0,
            high=0.5,
            doc="Wanted relative error of the computed mobility; 0 for the pair mobilities of its spheres, without"
            " rods and a few percent off.",
        ),
        Attribute(
            name="ot:body:warningForce",
            field="warning_force",
            dimension="force",
            default=INF,
            low=0.0,
            infinite=True,
            doc="Contact force above which the user is warned; inf for none.",
        ),
    ),
)

SPHERE = Schema(
    name="OtSphereAPI",
    applies_to="Sphere below an OtBodyAPI prim",
    doc="One sphere of a body and what acts on it.",
    attributes=(
        Attribute(
            name="ot:sphere:refractiveIndex",
            field="refractive_index",
            default=1.52,
            low=1.0,
            high=5.0,
            doc="Refractive index.",
        ),
        Attribute(
            name="ot:sphere:trapped", field="trapped", usd_type="bool", default=True, doc="Whether traps act on it."
        ),
        Attribute(
            name="ot:sphere:collides", field="collides", usd_type="bool", default=True, doc="Whether it collides."
        ),
        Attribute(
            name="ot:sphere:drag",
            field="drag",
            usd_type="bool",
            default=True,
            doc="Whether it counts in the mobility of its body.",
        ),
    ),
)

ROD = Schema(
    name="OtRodAPI",
    applies_to="Capsule or Cylinder below an OtBodyAPI prim",
    doc="A rod of a body: a Capsule with its own radius, height and axis, or the Capsule that fills a Cylinder from end"
    " to end. Traps do not act on rods.",
    attributes=(
        Attribute(name="ot:rod:collides", field="collides", usd_type="bool", default=True, doc="Whether it collides."),
        Attribute(
            name="ot:rod:drag",
            field="drag",
            usd_type="bool",
            default=True,
            doc="Whether it counts in the mobility of its body.",
        ),
    ),
)

CELL = Schema(
    name="OtCellAPI",
    applies_to="Sphere, or Sphere prototype of a PointInstancer",
    doc="A biological cell: an elastic, adhesive sphere.",
    attributes=(
        Attribute(
            name="ot:cell:youngsModulus",
            field="youngs_modulus",
            dimension="pressure",
            default=1e3,
            **_MATERIAL,
            doc="Young's modulus.",
        ),
        Attribute(
            name="ot:cell:poissonRatio", field="poisson_ratio", default=0.45, low=0.0, high=0.5, doc="Poisson ratio."
        ),
        Attribute(
            name="ot:cell:adhesion",
            field="adhesion",
            dimension="surface_energy",
            default=0.0,
            low=0.0,
            high=1.0,
            doc="Work of adhesion.",
        ),
        Attribute(
            name="ot:cell:adhesionRange",
            field="adhesion_range",
            dimension="length",
            default=1e-8,
            low=0.0,
            low_open=True,
            high=1e-6,
            doc="Gap over which the adhesion fades to zero.",
        ),
        Attribute(
            name="ot:cell:refractiveIndex",
            field="refractive_index",
            default=1.38,
            low=1.0,
            high=5.0,
            doc="Refractive index.",
        ),
        Attribute(
            name="ot:cell:trapped", field="trapped", usd_type="bool", default=False, doc="Whether traps act on it."
        ),
        Attribute(
            name="ot:cell:density",
            field="density",
            dimension="density",
            default=1060.0,
            low=0.0,
            high=3e4,
            doc="Mass density (used with gravity only).",
        ),
        Attribute(
            name="ot:cell:warningForce",
            field="warning_force",
            dimension="force",
            default=1e-11,
            low=0.0,
            infinite=True,
            doc="Contact force above which the user is warned; inf for none.",
        ),
    ),
)
