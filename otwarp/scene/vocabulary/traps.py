"""Traps and their force curves."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import INF, Attribute, Schema

TRAP = Schema(
    name="OtTrapAPI",
    of="traps",
    applies_to="Xform",
    doc="An optical trap: a beam focused at the prim's origin, travelling along its +Z.",
    attributes=(
        Attribute(
            "ot:trap:power",
            0.02,
            "power",
            "[0, 10]",
            sampled=True,
            per_world=("trap_power",),
            doc="Power in the medium.",
        ),
        Attribute("ot:trap:wavelength", 1.064e-6, "length", "[1e-07, 1e-05]", doc="Vacuum wavelength."),
        Attribute(
            "ot:trap:numericalAperture",
            1.25,
            range="(0, 3]",
            doc="Numerical aperture of the objective; must stay below the index of the medium.",
        ),
        Attribute(
            "ot:trap:polarization",
            "circular",
            allowed=("x", "y", "45", "circular", "left"),
            doc="Polarization of the beam.",
        ),
        Attribute(
            "ot:trap:model",
            "piecewise",
            allowed=("harmonic", "piecewise", "table", "exact"),
            doc="Force model: `harmonic` and `piecewise` follow the authored force curves; `table` and `exact` compute"
            " the force from the beam and each sphere, and need no curve.",
        ),
        Attribute(
            "ot:trap:beam",
            "gaussian",
            allowed=("gaussian", "sine", "aplanatic"),
            doc="Angular spectrum of the beam, for `table` and `exact`: `gaussian` in tan θ, without an edge; `sine`, a"
            " Gaussian in sin θ that ends at the aperture; `aplanatic`, the same times √cos θ (the sine condition).",
        ),
        Attribute(
            "ot:trap:filling",
            1.0,
            range="[0.01, 100]",
            doc="Radius where the intensity in the pupil falls to 1/e², over the radius of the aperture.",
        ),
        Attribute("ot:trap:charge", 0, range="[-20, 20]", doc="Azimuthal charge ℓ of a vortex beam."),
        Attribute(
            "ot:trap:depth",
            0.0,
            "length",
            "[0, 0.001]",
            doc="Nominal depth of the focus below the cover glass; with `ot:trap:glassIndex`, the spherical aberration"
            " of the interface between glass and medium.",
        ),
        Attribute(
            "ot:trap:glassIndex",
            0.0,
            range="[1, 4]",
            none=0.0,
            doc="Refractive index of the cover glass and immersion oil; 0 for no interface.",
        ),
        Attribute(
            "ot:trap:tolerance",
            1e-3,
            range="[1e-05, 0.1]",
            doc="Largest error of the force table, relative to the peak force; for `table`.",
        ),
        Attribute(
            "ot:trap:interpolation",
            "bilinear",
            allowed=("bilinear", "bicubic"),
            doc="Interpolation in the force table; for `table`.",
        ),
        Attribute(
            "ot:trap:reach",
            INF,
            "length",
            "(0, inf]",
            doc="Distance from the focus up to which the optical force is computed, for `table` and `exact`; it fades"
            " to zero over a quarter more. inf for as far as the tolerance asks.",
        ),
        Attribute(
            "ot:trap:equilibrium",
            0.0,
            "length",
            "[-0.0001, 0.0001]",
            doc="Where the force curves vanish, measured from the focus along the beam; ignored by `table` and `exact`,"
            " which compute it.",
        ),
        Attribute("ot:trap:hand", "none", allowed=("none", "left", "right"), doc="Which hand moves the trap."),
        Attribute(
            "ot:trap:speedLimit",
            INF,
            "speed",
            "(0, inf]",
            per_world=("trap_speed_limit",),
            doc="Fastest the focus may move; inf for no limit.",
        ),
        Attribute(
            "ot:trap:holds",
            None,
            doc="The sphere this trap is meant to hold; without it, the nearest trapped sphere at the start.",
        ),
    ),
)

TRAP_LAW = Schema(
    name="OtTrapLawAPI",
    of="traps",
    instances=("isotropic", "radial", "axial"),
    applies_to="Xform with OtTrapAPI",
    doc="A restoring force curve: K·d below the threshold, A/d² + C up to the cutoff, 0 beyond. Instance `isotropic`"
    " serves all directions; `radial` and `axial` come together. Lengths and forces are in `lengthUnit` and"
    " `forceUnit`, so that published constants can be authored as printed. A trap whose model is `table` or `exact`"
    " needs none; those that it has are kept for the other models.",
    attributes=(
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:stiffness",
            1e-6,
            "stiffness",
            "[0, inf)",
            unit="forceUnit/lengthUnit",
            per_world=("trap_stiffness", "trap_axial_stiffness"),
            per_world_unit="pN/µm per mW",
            doc="K, slope of the restoring force below the threshold [forceUnit/lengthUnit].",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:threshold",
            INF,
            "length",
            "(0, inf]",
            unit="lengthUnit",
            per_world=("trap_threshold", "trap_axial_threshold"),
            doc="δ, where the linear branch ends [lengthUnit].",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:inverseSquare",
            0.0,
            "force_area",
            unit="forceUnit·lengthUnit²",
            per_world=("trap_inverse_square", "trap_axial_inverse_square"),
            per_world_unit="pN·µm² per mW",
            doc="A, coefficient of the inverse-square branch [forceUnit·lengthUnit²].",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:offset",
            0.0,
            "force",
            unit="forceUnit",
            per_world=("trap_offset", "trap_axial_offset"),
            per_world_unit="pN per mW",
            doc="C, constant of the inverse-square branch [forceUnit].",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:cutoff",
            INF,
            "length",
            "(0, inf]",
            unit="lengthUnit",
            per_world=("trap_cutoff", "trap_axial_cutoff"),
            doc="Distance beyond which the force is zero [lengthUnit].",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:power",
            0.02,
            "power",
            "(0, inf)",
            doc="Trap power at which the curve holds [W]; the force is proportional to the power.",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:radius",
            0.0,
            "length",
            "[0, inf)",
            unit="lengthUnit",
            doc="Sphere radius for which the curve was fitted [lengthUnit]; 0 leaves distances unscaled.",
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:lengthUnit", 1.0, "length", "(0, inf)", doc="Length unit of the curve [m]."
        ),
        Attribute(
            "ot:trapLaw:__INSTANCE_NAME__:forceUnit", 1.0, "force", "(0, inf)", doc="Force unit of the curve [N]."
        ),
    ),
)
