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
        Attribute("ot:camera:wavelength", 632.8e-9, "length", "[1e-07, 1e-05]", doc="Illumination wavelength."),
        Attribute("ot:camera:pixelSize", 65e-9, "length", "(0, 0.0001]", doc="Pixel size in the object plane."),
        Attribute("ot:camera:focus", 0.0, "length", "[-0.01, 0.01]", doc="Height of the focal plane."),
        Attribute(
            "ot:camera:noise", 0.01, range="[0, 1]", doc="Sensor noise, standard deviation relative to full scale."
        ),
    ),
)

GOAL = Schema(
    name="OtGoalAPI",
    of="goal",
    applies_to="Xform or Sphere at the goal",
    doc="The task: bring the cell here.",
    attributes=(
        Attribute("ot:goal:cell", None, doc="The cell to deliver (required)."),
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
