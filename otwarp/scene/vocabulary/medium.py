"""The liquid, its flow, and how the scene is stepped."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import Attribute, Schema

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
            doc="Wanted relative error of variances, correlations and escape times; the time step follows from it.",
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
            default="heun",
            allowed=("eulerMaruyama", "leimkuhlerMatthews", "heun", "exponential"),
            doc="Time integrator.",
        ),
        Attribute(
            name="ot:scene:noise",
            field="noise",
            usd_type="token",
            default="gaussian",
            allowed=("gaussian", "threePoint", "uniform"),
            doc="Distribution of the thermal displacement of one time step. `threePoint` and `uniform` are cheaper and"
            " right only in averages over many steps; `uniform` makes every integrator one of first order.",
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
        Attribute(
            name="ot:scene:hydrodynamicCoupling",
            field="coupling",
            usd_type="bool",
            default=False,
            doc="Whether bodies carry each other along through the liquid: far field, by the Rotne–Prager–Yamakawa"
            " tensors of equivalent spheres, and noise that goes with it. For up to 24 bodies without hydrodynamic"
            " walls.",
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
