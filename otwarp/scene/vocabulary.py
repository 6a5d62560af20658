"""The one table of the scene vocabulary: every `ot:` attribute, its field, dimension, default and allowed range.

The schema files (`otwarp/scene/schema/`), the reader, the author and `docs/scene.md` all follow this table; tests
hold them to it. Values in USD are SI; geometry (radii, transforms) is in stage units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

INF = float("inf")


@dataclass(frozen=True, kw_only=True)
class Attribute:
    """One attribute of a schema.

    Attributes:
        name: Full USD name; a multiple-apply name holds `__INSTANCE_NAME__`.
        field: Field of the dataclass in `otwarp.scene.description` that it fills.
        usd_type: USD value type name (`double`, `token`, `bool`, `double[]`, `rel`).
        dimension: Key of `otwarp.units.FROM_SI`.
        default: Value in USD units when not authored.
        low, high: Allowed closed range in USD units; `low_open`/`high_open` exclude the end point.
        infinite: Whether +inf is allowed (numbers are finite otherwise).
        allowed: Tokens allowed.
        sampled: Whether time samples are allowed.
        doc: One sentence.
    """

    name: str
    field: str
    usd_type: str = "double"
    dimension: str = "none"
    default: Any = None
    low: float = -INF
    high: float = INF
    low_open: bool = False
    high_open: bool = False
    infinite: bool = False
    allowed: tuple[str, ...] = ()
    sampled: bool = False
    doc: str

    def range_text(self) -> str:
        """The allowed range, as error messages and documentation print it."""
        if self.allowed:
            return "one of " + ", ".join(self.allowed)
        if self.usd_type in ("bool", "rel", "double[]"):
            return {"bool": "true or false", "rel": "a prim path", "double[]": "36 finite numbers or none"}[
                self.usd_type
            ]
        left = "(" if self.low_open or self.low == -INF else "["
        right = ")" if self.high_open or (self.high == INF and not self.infinite) else "]"
        return f"{left}{self.low:g}, {self.high:g}{right}"


@dataclass(frozen=True, kw_only=True)
class Schema:
    """One applied API schema: its name, whether it is multiple-apply, what it may be applied to, its attributes."""

    name: str
    multiple: bool = False
    instances: tuple[str, ...] = ()
    applies_to: str
    doc: str
    attributes: tuple[Attribute, ...]


SCENE = Schema(
    name="OtSceneAPI",
    applies_to="the default prim",
    doc="The liquid and how the scene is to be stepped.",
    attributes=(
        Attribute(
            name="ot:medium:refractiveIndex",
            field="refractive_index",
            default=1.33,
            low=1.0,
            high=3.0,
            doc="Refractive index of the medium.",
        ),
        Attribute(
            name="ot:medium:viscosity",
            field="viscosity",
            dimension="viscosity",
            default=0.00089,
            low=0.0,
            high=1e3,
            low_open=True,
            doc="Dynamic viscosity of the medium.",
        ),
        Attribute(
            name="ot:medium:temperature",
            field="temperature",
            dimension="temperature",
            default=298.15,
            low=0.0,
            high=1000.0,
            doc="Absolute temperature.",
        ),
        Attribute(
            name="ot:medium:density",
            field="density",
            dimension="density",
            default=997.0,
            low=0.0,
            high=2e4,
            doc="Mass density of the medium (used with gravity only).",
        ),
        Attribute(
            name="ot:scene:accuracy",
            field="accuracy",
            default=0.01,
            low=1e-5,
            high=0.5,
            doc="Wanted relative error of stationary variances; the time step follows from it.",
        ),
        Attribute(
            name="ot:scene:timeStep",
            field="time_step",
            dimension="time",
            default=0.0,
            low=0.0,
            high=1.0,
            doc="Explicit time step; 0 lets otwarp choose it from the accuracy.",
        ),
        Attribute(
            name="ot:scene:integrator",
            field="integrator",
            usd_type="token",
            default="eulerMaruyama",
            allowed=("eulerMaruyama",),
            doc="Time integrator.",
        ),
        Attribute(
            name="ot:scene:brownian",
            field="brownian",
            usd_type="bool",
            default=True,
            doc="Whether thermal noise acts.",
        ),
        Attribute(
            name="ot:scene:gravity",
            field="gravity",
            usd_type="bool",
            default=False,
            doc="Whether weight minus buoyancy acts along −Z.",
        ),
    ),
)

TRAP = Schema(
    name="OtTrapAPI",
    applies_to="Xform",
    doc="An optical trap: a beam focused at the prim's origin, travelling along its +Z.",
    attributes=(
        Attribute(
            name="ot:trap:power",
            field="power",
            dimension="power",
            default=0.02,
            low=0.0,
            high=10.0,
            sampled=True,
            doc="Power in the medium.",
        ),
        Attribute(
            name="ot:trap:wavelength",
            field="wavelength",
            dimension="length",
            default=1.064e-6,
            low=1e-7,
            high=1e-5,
            doc="Vacuum wavelength.",
        ),
        Attribute(
            name="ot:trap:numericalAperture",
            field="numerical_aperture",
            default=1.25,
            low=0.0,
            high=3.0,
            low_open=True,
            doc="Numerical aperture of the objective; must stay below the index of the medium.",
        ),
        Attribute(
            name="ot:trap:polarization",
            field="polarization",
            usd_type="token",
            default="circular",
            allowed=("x", "y", "45", "circular", "left"),
            doc="Polarization of the beam.",
        ),
        Attribute(
            name="ot:trap:model",
            field="model",
            usd_type="token",
            default="piecewise",
            allowed=("harmonic", "piecewise"),
            doc="Force model.",
        ),
        Attribute(
            name="ot:trap:equilibrium",
            field="equilibrium",
            dimension="length",
            default=0.0,
            low=-1e-4,
            high=1e-4,
            doc="Where the force vanishes, measured from the focus along the beam.",
        ),
        Attribute(
            name="ot:trap:hand",
            field="hand",
            usd_type="token",
            default="none",
            allowed=("none", "left", "right"),
            doc="Which hand moves the trap.",
        ),
        Attribute(
            name="ot:trap:speedLimit",
            field="speed_limit",
            dimension="speed",
            default=INF,
            low=0.0,
            low_open=True,
            infinite=True,
            doc="Fastest the focus may move; inf for no limit.",
        ),
        Attribute(
            name="ot:trap:holds",
            field="holds",
            usd_type="rel",
            doc="The sphere this trap is meant to hold; without it, the nearest trapped sphere at the start.",
        ),
    ),
)

TRAP_LAW = Schema(
    name="OtTrapLawAPI",
    multiple=True,
    instances=("isotropic", "radial", "axial"),
    applies_to="Xform with OtTrapAPI",
    doc="A restoring force curve: K·d below the threshold, A/d² + C up to the cutoff, 0 beyond. Instance `isotropic`"
    " serves all directions; `radial` and `axial` come together. Lengths and forces are in `lengthUnit` and"
    " `forceUnit`, so that published constants can be authored as printed.",
    attributes=(
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:stiffness",
            field="stiffness",
            dimension="stiffness",
            default=1e-6,
            low=0.0,
            doc="K, slope of the restoring force below the threshold [forceUnit/lengthUnit].",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:threshold",
            field="threshold",
            dimension="length",
            default=INF,
            low=0.0,
            low_open=True,
            infinite=True,
            doc="δ, where the linear branch ends [lengthUnit].",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:inverseSquare",
            field="inverse_square",
            dimension="force_area",
            default=0.0,
            doc="A, coefficient of the inverse-square branch [forceUnit·lengthUnit²].",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:offset",
            field="offset",
            dimension="force",
            default=0.0,
            doc="C, constant of the inverse-square branch [forceUnit].",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:cutoff",
            field="cutoff",
            dimension="length",
            default=INF,
            low=0.0,
            low_open=True,
            infinite=True,
            doc="Distance beyond which the force is zero [lengthUnit].",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:power",
            field="power",
            dimension="power",
            default=0.02,
            low=0.0,
            low_open=True,
            doc="Trap power at which the curve holds [W]; the force is proportional to the power.",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:radius",
            field="radius",
            dimension="length",
            default=0.0,
            low=0.0,
            doc="Sphere radius for which the curve was fitted [lengthUnit]; 0 leaves distances unscaled.",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:lengthUnit",
            field="",
            dimension="length",
            default=1.0,
            low=0.0,
            low_open=True,
            doc="Length unit of the curve [m].",
        ),
        Attribute(
            name="ot:trapLaw:__INSTANCE_NAME__:forceUnit",
            field="",
            dimension="force",
            default=1.0,
            low=0.0,
            low_open=True,
            doc="Force unit of the curve [N].",
        ),
    ),
)

_MATERIAL = {"low": 1.0, "high": 1e13}

BODY = Schema(
    name="OtBodyAPI",
    applies_to="Xform holding spheres (with PhysicsRigidBodyAPI)",
    doc="A rigid body made of the OtSphereAPI spheres below it.",
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

FLOW = Schema(
    name="OtFlowAPI",
    applies_to="the default prim or an Xform",
    doc="Background flow along the prim's +X, varying along its +Z.",
    attributes=(
        Attribute(
            name="ot:flow:kind",
            field="kind",
            usd_type="token",
            default="uniform",
            allowed=("uniform", "shear", "poiseuille"),
            doc="Velocity profile.",
        ),
        Attribute(
            name="ot:flow:speed",
            field="speed",
            dimension="speed",
            default=0.0,
            doc="Speed; at the centre line for `poiseuille`.",
        ),
        Attribute(
            name="ot:flow:shearRate",
            field="shear_rate",
            dimension="rate",
            default=0.0,
            doc="Velocity gradient of `shear`.",
        ),
        Attribute(
            name="ot:flow:halfHeight",
            field="half_height",
            dimension="length",
            default=0.0,
            low=0.0,
            doc="Half distance of the plates of `poiseuille`; must be positive there.",
        ),
    ),
)

CAMERA = Schema(
    name="OtCameraAPI",
    applies_to="Camera",
    doc="The microscope behind a camera.",
    attributes=(
        Attribute(
            name="ot:camera:numericalAperture",
            field="numerical_aperture",
            default=1.45,
            low=0.0,
            high=3.0,
            low_open=True,
            doc="Numerical aperture of the imaging objective.",
        ),
        Attribute(
            name="ot:camera:condenserAperture",
            field="condenser_aperture",
            default=0.6,
            low=0.0,
            high=3.0,
            doc="Numerical aperture of the condenser.",
        ),
        Attribute(
            name="ot:camera:wavelength",
            field="wavelength",
            dimension="length",
            default=632.8e-9,
            low=1e-7,
            high=1e-5,
            doc="Illumination wavelength.",
        ),
        Attribute(
            name="ot:camera:pixelSize",
            field="pixel_size",
            dimension="length",
            default=65e-9,
            low=0.0,
            high=1e-4,
            low_open=True,
            doc="Pixel size in the object plane.",
        ),
        Attribute(
            name="ot:camera:focus",
            field="focus",
            dimension="length",
            default=0.0,
            low=-1e-2,
            high=1e-2,
            doc="Height of the focal plane.",
        ),
        Attribute(
            name="ot:camera:noise",
            field="noise",
            default=0.01,
            low=0.0,
            high=1.0,
            doc="Sensor noise, standard deviation relative to full scale.",
        ),
    ),
)

GOAL = Schema(
    name="OtGoalAPI",
    applies_to="Xform or Sphere at the goal",
    doc="The task: bring the cell here.",
    attributes=(
        Attribute(name="ot:goal:cell", field="cell", usd_type="rel", doc="The cell to deliver (required)."),
        Attribute(name="ot:goal:robots", field="robots", usd_type="rel", doc="The robots that carry it (required)."),
        Attribute(
            name="ot:goal:tolerance",
            field="tolerance",
            dimension="length",
            default=1e-6,
            low=0.0,
            low_open=True,
            doc="Delivered when the cell is this close.",
        ),
        Attribute(
            name="ot:goal:lostDistance",
            field="lost_distance",
            dimension="length",
            default=5e-6,
            low=0.0,
            low_open=True,
            doc="A robot is lost when one of its traps is this far from the sphere it holds.",
        ),
        Attribute(
            name="ot:goal:cellLostDistance",
            field="cell_lost_distance",
            dimension="length",
            default=5e-6,
            low=0.0,
            low_open=True,
            doc="The cell is lost when this far from the midpoint of its robots.",
        ),
        Attribute(
            name="ot:goal:distanceWarning",
            field="distance_warning",
            dimension="length",
            default=2e-6,
            low=0.0,
            low_open=True,
            doc="Warning line of the robot–trap distance.",
        ),
    ),
)

SCHEMAS: tuple[Schema, ...] = (SCENE, TRAP, TRAP_LAW, BODY, SPHERE, CELL, FLOW, CAMERA, GOAL)
