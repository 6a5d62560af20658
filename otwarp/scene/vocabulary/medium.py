"""The liquid, its flow, and how the scene is stepped."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import Attribute, Schema

SCENE = Schema(
    name="OtSceneAPI",
    applies_to="the default prim",
    doc="The liquid and how the scene is to be stepped.",
    attributes=(
        Attribute(
            "ot:medium:refractiveIndex",
            1.33,
            range="[1, 3]",
            field="medium.refractive_index",
            doc="Refractive index of the medium.",
        ),
        Attribute(
            "ot:medium:viscosity",
            0.00089,
            "viscosity",
            "(0, 1000]",
            field="medium.viscosity",
            per_world=("medium_viscosity",),
            doc="Dynamic viscosity of the medium.",
        ),
        Attribute(
            "ot:medium:temperature",
            298.15,
            "temperature",
            "[0, 1000]",
            field="medium.temperature",
            per_world=("medium_temperature",),
            doc="Absolute temperature.",
        ),
        Attribute(
            "ot:medium:density",
            997.0,
            "density",
            "[0, 20000]",
            field="medium.density",
            doc="Mass density of the medium (used with gravity only).",
        ),
        Attribute(
            "ot:scene:accuracy",
            0.01,
            range="[1e-05, 0.5]",
            field="settings.accuracy",
            doc="Wanted relative error of variances, correlations, displacements and escapes; the time step follows.",
        ),
        Attribute(
            "ot:scene:timeStep",
            0.0,
            "time",
            "[0, 1]",
            none=0.0,
            field="settings.time_step",
            doc="Explicit time step; 0 lets otwarp choose it. Refused where its estimated errors are above 10 %.",
        ),
        Attribute(
            "ot:scene:integrator",
            "heun",
            allowed=("eulerMaruyama", "leimkuhlerMatthews", "heun", "exponential"),
            field="settings.integrator",
            doc="Time integrator.",
        ),
        Attribute(
            "ot:scene:noise",
            "gaussian",
            allowed=("gaussian", "threePoint", "uniform"),
            field="settings.noise",
            doc="Distribution of the thermal displacement of one time step. `threePoint` and `uniform` are cheaper and"
            " right only in averages over many steps; `uniform` makes every integrator one of first order.",
        ),
        Attribute("ot:scene:brownian", True, field="settings.brownian", doc="Whether thermal noise acts."),
        Attribute(
            "ot:scene:gravity", False, field="settings.gravity", doc="Whether weight minus buoyancy acts along −Z."
        ),
        Attribute(
            "ot:scene:hydrodynamicCoupling",
            False,
            field="settings.coupling",
            doc="Whether bodies carry each other along through the liquid: far field, by the Rotne–Prager–Yamakawa"
            " tensors of equivalent spheres, and noise that goes with it. For up to 24 bodies without hydrodynamic"
            " walls.",
        ),
        Attribute(
            "ot:scene:period",
            (0.0, 0.0, 0.0),
            "length",
            field="settings.period",
            doc="Lengths after which space repeats along x, y and z; 0 for an open axis. Along the others bodies touch,"
            " and feel traps and obstacles, by their nearest images.",
        ),
        Attribute(
            "ot:scene:periodCenter",
            (0.0, 0.0, 0.0),
            "length",
            field="settings.period_center",
            doc="Middle of the cell that repeats: what leaves the cell on one side enters it on the other.",
        ),
        Attribute(
            "ot:scene:domainLow",
            (0.0, 0.0, 0.0),
            "length",
            field="settings.domain_low",
            doc="Lower corner of the domain of cells: one whose centre leaves it comes in again at the inlet.",
        ),
        Attribute(
            "ot:scene:domainHigh",
            (0.0, 0.0, 0.0),
            "length",
            field="settings.domain_high",
            doc="Upper corner of the domain; along an axis where it equals the lower one the domain has no end.",
        ),
        Attribute(
            "ot:scene:inletLow",
            (0.0, 0.0, 0.0),
            "length",
            field="settings.inlet_low",
            doc="Lower corner of the box in which cells come in: at a place drawn evenly, where they overlap nothing.",
        ),
        Attribute(
            "ot:scene:inletHigh",
            (0.0, 0.0, 0.0),
            "length",
            field="settings.inlet_high",
            doc="Upper corner of that box, which may have no thickness.",
        ),
    ),
)

FLOW = Schema(
    name="OtFlowAPI",
    of="flow",
    applies_to="the default prim or an Xform",
    doc="Background flow along the prim's +X, varying along its +Z, or a velocity field in the prim's frame.",
    attributes=(
        Attribute(
            "ot:flow:kind",
            "uniform",
            allowed=("uniform", "shear", "poiseuille", "rectangular", "grid"),
            doc="Velocity profile; a sphere goes along with its mean over its surface. `poiseuille` flows between two"
            " plates, `rectangular` in a channel with side walls, `grid` is a field from a file; outside of these the"
            " liquid is at rest.",
        ),
        Attribute(
            "ot:flow:speed", 0.0, "speed", per_world=("flow_speed",), doc="Speed; at the centre line of a channel."
        ),
        Attribute(
            "ot:flow:shearRate", 0.0, "rate", per_world=("flow_shear_rate",), doc="Velocity gradient of `shear`."
        ),
        Attribute(
            "ot:flow:halfHeight",
            0.0,
            "length",
            "[0, inf)",
            doc="Half distance of the plates of `poiseuille` and `rectangular`; must be positive there.",
        ),
        Attribute(
            "ot:flow:halfWidth",
            0.0,
            "length",
            "[0, inf)",
            doc="Half distance, along the prim's Y, of the side walls of `rectangular`; must be positive there.",
        ),
        Attribute(
            "ot:flow:file",
            "",
            usd_type="asset",
            doc="Velocity field of `grid`: a NumPy `.npz`, netCDF `.nc`, VTK `.vti` or legacy VTK `.vtk` file.",
        ),
    ),
)
