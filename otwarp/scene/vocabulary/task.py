"""The microscope and the task."""

from __future__ import annotations

from otwarp.scene.vocabulary.attribute import Attribute, Schema

CAMERA = Schema(
    name="OtCameraAPI",
    of="camera",
    applies_to="Camera",
    doc="The microscope behind a camera.",
    attributes=(
        Attribute(
            "ot:camera:numericalAperture", 1.45, range="(0, 3]", doc="Numerical aperture of the imaging objective."
        ),
        Attribute("ot:camera:condenserAperture", 0.6, range="[0, 3]", doc="Numerical aperture of the condenser."),
        Attribute(
            "ot:camera:condenserShape", "disc", allowed=("disc", "annulus"), doc="Shape of the condenser's opening."
        ),
        Attribute("ot:camera:condenserInner", 0.0, range="[0, 3]", doc="Numerical aperture where an annulus begins."),
        Attribute(
            "ot:camera:contrast",
            "brightField",
            allowed=("brightField", "darkField", "phaseContrast", "dic"),
            doc="What stands in the pupils: nothing, a condenser's annulus beyond the objective's aperture, a ring that"
            " delays direct light, or two prisms (differential interference contrast).",
        ),
        Attribute(
            "ot:camera:ringDelay",
            -0.25,
            range="[-0.5, 0.5]",
            doc="By which the ring of phase contrast delays light [wavelengths]; negative shows dense things dark.",
        ),
        Attribute("ot:camera:ringTransmission", 0.25, range="[1e-06, 1]", doc="Share of light that passes that ring."),
        Attribute(
            "ot:camera:shear",
            2e-7,
            "length",
            "[1e-12, 5e-06]",
            doc="Distance of the two images of differential interference contrast.",
        ),
        Attribute("ot:camera:shearAngle", 0.0, "angle", "[-6.3, 6.3]", doc="Of the shear from the camera's x axis."),
        Attribute(
            "ot:camera:bias",
            0.25,
            range="[-1, 1]",
            doc="By which one of these images is ahead of the other [wavelengths]; 0 for a dark background.",
        ),
        Attribute("ot:camera:wavelength", 632.8e-9, "length", "[1e-07, 1e-05]", doc="Illumination wavelength."),
        Attribute(
            "ot:camera:bandwidth", 0.0, "length", "[0, 1e-06]", doc="Full width at half maximum of the illumination."
        ),
        Attribute(
            "ot:camera:immersionIndex",
            1.518,
            range="[1, 3]",
            doc="Refractive index of immersion and cover glass, taken as one.",
        ),
        Attribute(
            "ot:camera:depth",
            0.0,
            "length",
            "[0, 0.001]",
            doc="Depth of the focal plane below the cover glass, whose index aberrates it; 0 for no such error.",
        ),
        Attribute("ot:camera:defocus", 0.0, range="[-10, 10]", doc="Defocus of the objective, rms [wavelengths]."),
        Attribute(
            "ot:camera:astigmatism", 0.0, range="[-10, 10]", doc="Vertical astigmatism (Noll 6), rms [wavelengths]."
        ),
        Attribute("ot:camera:coma", 0.0, range="[-10, 10]", doc="Coma along x (Noll 8), rms [wavelengths]."),
        Attribute(
            "ot:camera:sphericalAberration",
            0.0,
            range="[-10, 10]",
            doc="Spherical aberration (Noll 11), rms [wavelengths].",
        ),
        Attribute(
            "ot:camera:magnification",
            100.0,
            range="(0, 10000]",
            doc="From the object plane to the sensor; informative: `ot:camera:pixelSize` decides.",
        ),
        Attribute("ot:camera:pixelSize", 65e-9, "length", "(0, 0.0001]", doc="Pixel size in the object plane."),
        Attribute("ot:camera:focus", 0.0, "length", "[-0.01, 0.01]", doc="Height of the focal plane."),
        Attribute(
            "ot:camera:noise", 0.01, range="[0, 1]", doc="Sensor noise, standard deviation relative to full scale."
        ),
        Attribute(
            "ot:camera:electrons", 10000.0, range="(0, inf]", doc="Photoelectrons of full scale; inf for no shot noise."
        ),
        Attribute(
            "ot:camera:nonuniformity", 0.0, range="[0, 1]", doc="Standard deviation of the pixels' sensitivities."
        ),
        Attribute("ot:camera:bits", 8, range="[1, 16]", doc="Bits of a pixel."),
        Attribute("ot:camera:gamma", 1.0, range="(0, 10]", doc="Exponent 1/gamma from light to grey level."),
        Attribute(
            "ot:camera:brightness",
            0.35,
            range="(0, 1]",
            doc="Grey level of unhindered light, before gamma, of full scale.",
        ),
        Attribute("ot:camera:exposure", 0.0, "time", "[0, 10]", doc="Exposure time, during which bodies move."),
    ),
)

GOAL = Schema(
    name="OtGoalAPI",
    of="goal",
    applies_to="Xform or Sphere at the goal",
    doc="The task: bring the cell, or the robot, here.",
    attributes=(
        Attribute("ot:goal:cell", None, doc="The cell to deliver, or the one robot that goes there itself (required)."),
        Attribute("ot:goal:robots", None, doc="The robots that carry it (required)."),
        Attribute("ot:goal:tolerance", 1e-6, "length", "(0, inf)", doc="Delivered when the cell is this close."),
        Attribute(
            "ot:goal:lostDistance",
            5e-6,
            "length",
            "(0, inf)",
            doc="A robot is lost when one of its traps is this far from the sphere it holds.",
        ),
        Attribute(
            "ot:goal:cellLostDistance",
            5e-6,
            "length",
            "(0, inf)",
            doc="The cell is lost when this far from the midpoint of its robots.",
        ),
        Attribute(
            "ot:goal:distanceWarning", 2e-6, "length", "(0, inf)", doc="Warning line of the robot–trap distance."
        ),
    ),
)
